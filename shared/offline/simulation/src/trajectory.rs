//! A simulated drive as a function of time, and what the sensors show of it.

use kerbside_geometry::Pose;

use crate::plant::{Plant, Sensors};
use crate::stepper::{Knot, Stepper};
use crate::train::Train;

impl Knot {
    /// The state `time` \[s\] (below 0) before this one, in the motion of this one: exactly this one where it stands.
    fn earlier(self, time: f64) -> Self {
        if self.motor_speed == 0.0 {
            return self;
        }
        Self {
            pose: Pose::new(
                self.pose.x + time * self.velocity.0,
                self.pose.y + time * self.velocity.1,
                self.pose.yaw + time * self.yaw_rate,
            ),
            rotation: core::array::from_fn(|wheel| {
                self.rotation[wheel] + time * self.rotation_rate[wheel]
            }),
            ..self
        }
    }

    /// The state at `time` between two knots: angles and way by cubics that keep the rates at both
    /// ends, the rates themselves by straight lines.
    #[must_use]
    pub fn between(before: &Self, after: &Self, time: f64) -> Self {
        let span = after.time - before.time;
        if span <= 0.0 {
            return *after;
        }
        let share = (time - before.time) / span;
        let line = |from: f64, to: f64| line(share, from, to);
        let cubic = |from: f64, slope: f64, to: f64, end_slope: f64| {
            hermite(share, span, [from, slope, to, end_slope])
        };
        let (a, b) = (before, after);
        Self {
            time,
            motor_speed: line(a.motor_speed, b.motor_speed),
            rack: line(a.rack, b.rack),
            speed: line(a.speed, b.speed),
            yaw_rate: line(a.yaw_rate, b.yaw_rate),
            pose: Pose::new(
                cubic(a.pose.x, a.velocity.0, b.pose.x, b.velocity.0),
                cubic(a.pose.y, a.velocity.1, b.pose.y, b.velocity.1),
                cubic(a.pose.yaw, a.yaw_rate, b.pose.yaw, b.yaw_rate),
            ),
            velocity: (line(a.velocity.0, b.velocity.0), line(a.velocity.1, b.velocity.1)),
            rotation: core::array::from_fn(|wheel| {
                let (rate, end_rate) = (a.rotation_rate[wheel], b.rotation_rate[wheel]);
                cubic(a.rotation[wheel], rate, b.rotation[wheel], end_rate)
            }),
            rotation_rate: core::array::from_fn(|wheel| {
                line(a.rotation_rate[wheel], b.rotation_rate[wheel])
            }),
        }
    }
}

/// The straight line through two values, at `share` of the way between them.
fn line(share: f64, from: f64, to: f64) -> f64 {
    from + share * (to - from)
}

/// The cubic through two values with two slopes, at `share` of the way between them.
fn hermite(share: f64, span: f64, [from, slope, to, end_slope]: [f64; 4]) -> f64 {
    let left = 1.0 - share;
    let (rise, begin, end) = (to - from, slope * span, end_slope * span);
    from + rise * share + share * left * ((begin - rise) * left - (end - rise) * share)
}

/// A simulated drive. Made once and filled again and again: it keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    knots: Vec<Knot>,
    /// For each multiple of `width` the last knot at or before it.
    index: Vec<u32>,
    width: f64,
    sensors: Option<Sensors>,
}

impl Trajectory {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in the drive of `stepper` from its start until `until` \[s\], in steps of `step` \[s\].
    pub(crate) fn fill<T: Train>(
        &mut self,
        plant: &Plant,
        mut stepper: Stepper<T>,
        until: f64,
        step: f64,
    ) {
        self.knots.clear();
        self.index.clear();
        self.width = step;
        self.sensors = Some(plant.sensors.clone());
        self.push(stepper.knot());
        stepper.advance(until, |stepper| self.push(stepper.knot()));
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss)] // Few and positive.
    fn push(&mut self, knot: Knot) {
        let last = self.knots.len().saturating_sub(1) as u32;
        while self.index.len() as f64 * self.width < knot.time {
            self.index.push(last);
        }
        self.knots.push(knot);
    }

    /// Every step's end, and twice where rates jump.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// Lets `change` alter every knot, in the order of time: a drive that is disturbed on its way. Times stay as they are.
    pub fn alter(&mut self, mut change: impl FnMut(&mut Knot)) {
        for knot in &mut self.knots {
            let time = knot.time;
            change(knot);
            knot.time = time;
        }
    }

    /// The true state at `t` \[s\]: before 0 as the first motion came there, which of a car that stood is its
    /// start; after the end as there; all zero in an empty trajectory.
    #[must_use]
    pub fn state(&self, t: f64) -> Knot {
        let Some((before, after)) = self.around(t) else {
            let first = self.knots.first().copied().unwrap_or_default();
            return if t > 0.0 {
                self.knots.last().copied().unwrap_or_default()
            } else if t < 0.0 {
                first.earlier(t)
            } else {
                first
            };
        };
        Knot::between(before, after, t)
    }

    /// What `of` makes of the knots around `t` and the share of the way between them; of one knot outside the drive.
    fn shown<R>(&self, t: f64, of: impl Fn(&Knot, &Knot, f64) -> R) -> R {
        let Some((before, after)) = self.around(t) else {
            let only = self.state(t);
            return of(&only, &only, 0.0);
        };
        let span = after.time - before.time;
        if span <= 0.0 {
            of(after, after, 0.0)
        } else {
            of(before, after, (t - before.time) / span)
        }
    }

    /// The knots before and after `t`; none outside the drive.
    fn around(&self, t: f64) -> Option<(&Knot, &Knot)> {
        if t <= 0.0 || t.is_nan() {
            return None;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Positive; saturates.
        let cell = (t / self.width) as usize;
        let mut at = *self.index.get(cell).or(self.index.last())? as usize;
        while self.knots.get(at + 1)?.time <= t {
            at += 1;
        }
        Some((&self.knots[at], &self.knots[at + 1]))
    }

    /// True pose of the rear-axle centre at `t` \[s\], yaw not wrapped.
    #[must_use]
    pub fn pose(&self, t: f64) -> Pose {
        self.state(t).pose
    }

    /// True speed of the rear-axle centre along the body's x axis at `t` \[s\], negative in reverse
    /// \[m/s\].
    #[must_use]
    pub fn speed(&self, t: f64) -> f64 {
        self.state(t).speed
    }

    /// Rotation of fl, fr, rl, rr since the start that the encoders show at `t` \[s\], not cut to
    /// whole counts \[rad\].
    #[must_use]
    pub fn rotation(&self, t: f64) -> [f64; 4] {
        self.sensors
            .as_ref()
            .map_or([0.0; 4], |sensors| sensors.shown(self.turned(sensors.encoder_time(t))))
    }

    /// Surface speeds of fl, fr, rl, rr that the vehicle reports at `t` \[s\] in place of counts
    /// \[m/s\].
    #[must_use]
    pub fn wheel_speed(&self, t: f64) -> [f64; 4] {
        self.sensors.as_ref().map_or([0.0; 4], |sensors| {
            let rates = self.shown(sensors.encoder_time(t), |a, b, share| {
                core::array::from_fn(|wheel| {
                    line(share, a.rotation_rate[wheel], b.rotation_rate[wheel])
                })
            });
            sensors.wheel_speed(rates)
        })
    }

    /// What the steering sensor reads at `t` \[s\] \[rad\].
    #[must_use]
    pub fn steering(&self, t: f64) -> f64 {
        self.sensors.as_ref().map_or(0.0, |sensors| {
            sensors.steering(self.shown(t, |a, b, share| line(share, a.rack, b.rack)))
        })
    }

    /// What the gyro reads at `t` \[s\] \[rad/s\].
    #[must_use]
    pub fn yaw_rate(&self, t: f64) -> f64 {
        self.sensors.as_ref().map_or(0.0, |sensors| {
            sensors.yaw_rate(self.shown(t, |a, b, share| line(share, a.yaw_rate, b.yaw_rate)))
        })
    }

    /// What the reference shows in the row that it stamps `t` \[s\], yaw not wrapped.
    #[must_use]
    pub fn reference(&self, t: f64) -> Pose {
        self.sensors.as_ref().map_or(Pose::default(), |sensors| {
            sensors.reference(&self.shown(sensors.reference_time(t), |a, b, share| {
                let span = b.time - a.time;
                let cubic = |from: f64, slope: f64, to: f64, end_slope: f64| {
                    hermite(share, span, [from, slope, to, end_slope])
                };
                Pose::new(
                    cubic(a.pose.x, a.velocity.0, b.pose.x, b.velocity.0),
                    cubic(a.pose.y, a.velocity.1, b.pose.y, b.velocity.1),
                    cubic(a.pose.yaw, a.yaw_rate, b.pose.yaw, b.yaw_rate),
                )
            }))
        })
    }

    /// True rotation of the wheels at `t` \[s\] \[rad\].
    fn turned(&self, t: f64) -> [f64; 4] {
        self.shown(t, |a, b, share| {
            let span = b.time - a.time;
            core::array::from_fn(|wheel| {
                let (rate, end_rate) = (a.rotation_rate[wheel], b.rotation_rate[wheel]);
                hermite(share, span, [a.rotation[wheel], rate, b.rotation[wheel], end_rate])
            })
        })
    }
}
