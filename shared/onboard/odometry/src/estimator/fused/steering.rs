//! The steering angle that a reading's way is taken to have had.

use kerbside_geometry::math;
use kerbside_messages::{FilterState, Nanos, Travel};

use super::record::Steered;
use crate::wheels::elapsed;

/// An angle is held so long \[s\]; then there is none.
const LONGEST_HOLD: f64 = 1.0;

/// The newest angle, and what of its error is already in the pose.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SteeringTrack {
    newest: Option<f64>,
    before: f64,
    stamp: Nanos,
    /// Travels in a row with a new angle, the newest included.
    run: u32,
    /// Way since it was read \[m\].
    way: f64,
    direction: Option<(f64, (f64, f64))>,
}

impl SteeringTrack {
    /// Writes down what the newest angle, which every odometry carries, does not say.
    pub(crate) fn save(&self, out: &mut FilterState) {
        out.has_steering = u8::from(self.newest.is_some());
        (out.steering_before, out.steering_way) = (self.before, self.way);
        (out.steering_stamp, out.steering_run) = (self.stamp, self.run);
    }

    /// Goes on from `newest`, unless this life has read an angle itself.
    pub(crate) fn load(&mut self, saved: &FilterState, newest: f64) {
        if self.newest.is_none() && saved.has_steering == 1 {
            self.newest = Some(newest);
            (self.before, self.way) = (saved.steering_before, saved.steering_way);
            (self.stamp, self.run) = (saved.steering_stamp, saved.steering_run);
        }
    }

    pub(crate) fn take(&mut self, travel: &Travel) {
        self.run = if travel.steering_is_new == 1 { self.run.saturating_add(1) } else { 0 };
        if travel.has_steering == 1 && (travel.steering_is_new == 1 || self.newest.is_none()) {
            self.before = self.newest.unwrap_or(travel.steering);
            self.newest = Some(travel.steering);
            self.stamp = travel.header.stamp;
            self.way = 0.0;
        }
    }

    /// For a way of `way` metres up to `now`. Between two angles read with two readings in a row it
    /// is their mean; else the newest, uncertain by half of how far it moved last. What an angle is
    /// off, it is off for as long as it is held: the squares of its errors do not add, the errors
    /// do.
    pub(crate) fn over(&mut self, way: f64, now: Nanos, variance: f64) -> Option<Steered> {
        let newest = self.newest?;
        if elapsed(now, self.stamp) > LONGEST_HOLD {
            return None;
        }
        let between = self.run >= 2 && self.way == 0.0;
        let moved = 0.5 * (newest - self.before);
        let angle = if between { newest - moved } else { newest };
        let lag = if between { 0.0 } else { moved * moved };
        let common = if way > 0.0 { 1.0 + 2.0 * self.way / way } else { 1.0 };
        self.way += way;
        Some(Steered { direction: self.turned(angle), variance: (variance + lag) * common })
    }

    /// Cosine and sine, computed once per angle.
    fn turned(&mut self, angle: f64) -> (f64, f64) {
        match self.direction {
            Some((known, direction)) if known == angle => direction,
            _ => {
                let (sin, cos) = math::sin_cos(angle);
                self.direction = Some((angle, (cos, sin)));
                (cos, sin)
            }
        }
    }
}
