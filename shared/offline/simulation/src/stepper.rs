//! Moves motor, rack and body on through time: the one loop behind every way to simulate.

use kerbside_geometry::Pose;

use crate::body::Body;
use crate::ground::{Ground, Motion};
use crate::plant::{Patch, Plant};
use crate::train::{Ahead, Train};

/// Slip that differs by less than this at a kink is the same.
const SAME: f64 = 1e-12;
/// Shortest piece of a step worth a step of its own \[s\].
const SHORTEST: f64 = 1e-9;
/// No wheel turns more than a hundred times what rolling needs.
const LEAST_KEPT: f64 = 0.01;

/// The state of everything at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Knot {
    /// \[s\]
    pub time: f64,
    /// The motor's speed through the driven wheels' mean nominal radius \[m/s\].
    pub motor_speed: f64,
    /// Angle of the rack \[rad\].
    pub rack: f64,
    /// Speed of the rear-axle centre along the body's x axis \[m/s\].
    pub speed: f64,
    /// \[rad/s\]
    pub yaw_rate: f64,
    /// Of the rear-axle centre, yaw not wrapped.
    pub pose: Pose,
    /// Of the rear-axle centre in the frame of the pose (x, y) \[m/s\].
    pub velocity: (f64, f64),
    /// Of fl, fr, rl, rr since the start \[rad\].
    pub rotation: [f64; 4],
    /// \[rad/s\]
    pub rotation_rate: [f64; 4],
}

/// Motor and rack, ground and body.
#[derive(Clone, Debug)]
pub(crate) struct Stepper<T> {
    pub(crate) train: T,
    pub(crate) time: f64,
    pub(crate) motion: Motion,
    pub(crate) body: Body,
    step: f64,
    ground: Ground,
    slip: Slip,
    /// Whether anything depends on the direction of travel, so that standstill is a kink.
    directed: bool,
}

/// How much of their way the driven wheels keep.
#[derive(Clone, Debug)]
struct Slip {
    steady: f64,
    acceleration: f64,
    patch: Option<Patch>,
    inside: bool,
    /// At the end of the latest step.
    kept: f64,
}

impl Slip {
    fn varies(&self) -> bool {
        self.acceleration != 0.0 || self.patch.is_some()
    }

    /// While the motor changes its speed by `acceleration` \[m/s^2\] in the sense of `direction`.
    fn kept(&self, acceleration: f64, direction: f64) -> f64 {
        let speeding = if acceleration * direction < 0.0 { -1.0 } else { 1.0 };
        let ratio = speeding * self.acceleration * acceleration.abs();
        let patch = self.patch.filter(|_| self.inside).map_or(1.0, |patch| patch.kept);
        (self.steady * (1.0 - ratio) * patch).max(LEAST_KEPT)
    }
}

impl Patch {
    fn excess(&self, pose: &Pose) -> f64 {
        let (x, y) = (pose.x - self.x, pose.y - self.y);
        x * x + y * y - self.radius * self.radius
    }

    fn contains(&self, pose: &Pose) -> bool {
        self.excess(pose) < 0.0
    }

    /// Share of the straight way between two poses, one inside and one outside, that lies before the
    /// edge.
    fn edge(&self, from: &Pose, to: &Pose) -> f64 {
        let (x, y) = (from.x - self.x, from.y - self.y);
        let (along_x, along_y) = (to.x - from.x, to.y - from.y);
        let square = along_x * along_x + along_y * along_y;
        let half = (x * along_x + y * along_y) / square;
        let root = (half * half - self.excess(from) / square).max(0.0).sqrt();
        // From inside there is one way out; from outside the nearer edge comes first.
        let share = if self.excess(from) < 0.0 { root - half } else { -half - root };
        if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }
    }
}

impl<T: Train> Stepper<T> {
    /// Standing at `start`, in steps of at most `step` \[s\].
    pub(crate) fn new(plant: &Plant, train: T, start: Pose, step: f64) -> Self {
        let contact = &plant.contact;
        let patch = (contact.patch.kept != 1.0).then_some(contact.patch);
        let steady = contact.kept.max(LEAST_KEPT);
        let mut stepper = Self {
            time: 0.0,
            step,
            ground: Ground::new(contact),
            motion: Motion::default(),
            body: Body::new(start, contact),
            slip: Slip {
                steady,
                acceleration: contact.acceleration_slip,
                patch,
                inside: patch.is_some_and(|patch| patch.contains(&start)),
                kept: steady,
            },
            directed: contact.acceleration_slip != 0.0
                || contact.lateral_drift != 0.0
                || contact.floor != (0.0, 0.0),
            train,
        };
        stepper.slip.kept = stepper.slip.kept(0.0, 1.0);
        stepper.settle();
        stepper
    }

    /// Takes the motion from where motor and rack stand now.
    fn settle(&mut self) {
        self.motion = self.ground.motion(self.train.speed(), self.train.rack(), self.slip.kept);
    }

    /// Sets the longest step \[s\].
    pub(crate) fn set_step(&mut self, step: f64) {
        self.step = step;
    }

    /// The state now.
    pub(crate) fn knot(&self) -> Knot {
        Knot {
            time: self.time,
            motor_speed: self.train.speed(),
            rack: self.train.rack(),
            speed: self.motion.speed,
            yaw_rate: self.motion.yaw_rate,
            pose: self.body.pose,
            velocity: self.body.velocity(&self.motion),
            rotation: self.body.rotation,
            rotation_rate: self.motion.rotation_rate,
        }
    }

    /// Moves on until the time is `to` \[s\]; a time that is past changes nothing. `each` sees every
    /// step's end, and the beginning of the next one where rates jump there.
    pub(crate) fn advance(&mut self, to: f64, mut each: impl FnMut(&Self)) {
        while self.time < to {
            if self.train.begin(self.time) {
                self.settle();
                each(self);
            }
            let until = to.min(self.train.next());
            let standstill = if self.directed { self.train.standstill() } else { f64::INFINITY };
            let smooth = self.train.smooth().min(self.step).min(standstill);
            let left = until - self.time;
            // A remainder that is only rounding is not worth a step of its own.
            let whole = left <= smooth || (smooth == self.step && left < smooth * 1.000_001);
            let step = if whole { left } else { smooth };
            let taken = self.roll(step, step == standstill, &mut each);
            if taken < step {
                self.time += taken;
            } else {
                self.time = if whole { until } else { self.time + step };
            }
            each(self);
        }
    }

    /// Rolls for `step` \[s\] or to the patch's edge, and returns how long that took.
    fn roll(&mut self, step: f64, to_rest: bool, each: &mut impl FnMut(&Self)) -> f64 {
        let mut ahead = self.train.ahead(step);
        if to_rest {
            ahead.speed[1] = 0.0;
        }
        if self.motion.is_rest() && ahead.speed == [0.0; 2] {
            self.train.move_to(&ahead);
            return step;
        }
        if self.slip.varies() {
            return self.roll_slipping(step, ahead, each);
        }
        let motions = self.motions(&ahead, [self.slip.kept; 2]);
        self.train.move_to(&ahead);
        self.motion = motions[2];
        self.body.roll(step, &motions);
        step
    }

    fn motions(&self, ahead: &Ahead, kept: [f64; 2]) -> [Motion; 3] {
        let at =
            |index: usize| self.ground.motion(ahead.speed[index], ahead.rack[index], kept[index]);
        [self.motion, at(0), at(1)]
    }

    fn roll_slipping(&mut self, step: f64, ahead: Ahead, each: &mut impl FnMut(&Self)) -> f64 {
        let kept = self.kept(&ahead);
        if (kept[0] - self.slip.kept).abs() > SAME {
            self.slip.kept = kept[0];
            self.settle();
            each(self);
        }
        let motions = self.motions(&ahead, [kept[1], kept[2]]);
        let before = self.body.clone();
        self.body.roll(step, &motions);
        if let Some(patch) = self.slip.patch {
            let inside = patch.contains(&self.body.pose);
            if inside != self.slip.inside {
                let part = step * patch.edge(&before.pose, &self.body.pose);
                if part > SHORTEST && step - part > SHORTEST {
                    self.body = before;
                    self.roll_to_edge(part);
                    return part;
                }
                self.slip.inside = inside;
            }
        }
        self.slip.kept = kept[2];
        self.train.move_to(&ahead);
        self.motion = motions[2];
        step
    }

    /// Rolls for `step` \[s\], at whose end the patch begins or ends.
    fn roll_to_edge(&mut self, step: f64) {
        let ahead = self.train.ahead(step);
        let kept = self.kept(&ahead);
        let motions = self.motions(&ahead, [kept[1], kept[2]]);
        self.body.roll(step, &motions);
        self.slip.kept = kept[2];
        self.slip.inside = !self.slip.inside;
        self.train.move_to(&ahead);
        self.motion = motions[2];
    }

    /// What the driven wheels keep now and at the two instants ahead.
    fn kept(&self, ahead: &Ahead) -> [f64; 3] {
        let direction = ahead.speed[0];
        self.train.acceleration(ahead).map(|acceleration| self.slip.kept(acceleration, direction))
    }
}
