//! A stretch of a manoeuvre.

use core::f64::consts::TAU;

use kerbside_geometry::math;

/// How the steering goes within a piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// Both jump to their values.
    Step,
    /// Both go evenly from where the piece before ended.
    Ramp,
    /// The steering swings so many times as a sine of this amplitude.
    Sine(f64),
    /// The steering swings so many times as a triangle of this amplitude.
    Triangle(f64),
}

/// A stretch of a manoeuvre, in any unit of time, speed and angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) duration: f64,
    pub(super) speed: f64,
    pub(super) steering: f64,
    pub(super) shape: Shape,
}

impl Piece {
    /// Speed and steering after this `share` of the piece, 0 to 1; the one before ended at `begin`.
    pub(super) fn at(&self, share: f64, begin: (f64, f64)) -> (f64, f64) {
        match self.shape {
            Shape::Step => (self.speed, self.steering),
            Shape::Ramp => {
                let towards = |from: f64, to: f64| from + share * (to - from);
                (towards(begin.0, self.speed), towards(begin.1, self.steering))
            }
            Shape::Sine(turns) => (self.speed, self.steering * math::sin(TAU * turns * share)),
            Shape::Triangle(turns) => {
                let phase = turns * share + 0.25;
                let saw = 2.0 * (phase - phase.floor());
                (self.speed, self.steering * (1.0 - 2.0 * (saw - 1.0).abs()))
            }
        }
    }

    /// Speed and steering at its end.
    pub(super) fn end(&self) -> (f64, f64) {
        self.at(1.0, (0.0, 0.0))
    }
}
