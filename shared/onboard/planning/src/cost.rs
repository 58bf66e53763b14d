//! What the search minimises: the time a plan takes, plus what makes a plan hard to follow.
//!
//! The extras are counted in units of the time that steering from straight ahead to the limit
//! takes, lengths in wheelbases, so that they weigh alike for vehicles of any size and pace.

use crate::pace::Pace;
use crate::segment::Piece;

/// Pieces shorter than this are little more than the start and stop of their actuators
/// \[wheelbases\] ...
const SHORT: f64 = 0.2;
/// ... and cost up to so much extra \[units\].
const SHORT_EXTRA: f64 = 1.0;
/// What errors are left when the last piece begins is corrected along it: this much is welcome
/// \[wheelbases\], ...
const LAST: f64 = 0.6;
/// ... its want costs up to so much, ...
const LAST_EXTRA: f64 = 4.0;
/// ... and its bend up to so much \[units\].
const LAST_BEND: f64 = 1.0;

/// Costs of the parts of a path \[s\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cost {
    pace: Pace,
    wheelbase: f64,
    curvature: f64,
    unit: f64,
}

impl Cost {
    pub(crate) fn new(pace: Pace, wheelbase: f64, curvature: f64) -> Self {
        Self { pace, wheelbase, curvature, unit: pace.steer_time(0.0, curvature, false) }
    }

    /// Of driving a piece, from rest to rest.
    pub(crate) fn piece(&self, piece: &Piece, last: bool) -> f64 {
        let wheelbases = piece.length.abs() / self.wheelbase;
        let mut extra = SHORT_EXTRA * want(wheelbases, SHORT);
        if last {
            let bend = piece.curvature.abs() / self.curvature;
            extra += LAST_EXTRA * want(wheelbases, LAST) + LAST_BEND * bend;
        }
        self.pace.drive_time(piece.length) + self.unit * extra
    }

    /// Of standing between two pieces.
    pub(crate) fn joint(&self, from: &Piece, to: &Piece) -> f64 {
        if from.continues(to) {
            return 0.0;
        }
        self.pace.steer_time(from.curvature, to.curvature, from.gear() != to.gear())
    }

    /// Of standing before the first piece, the steering straight ahead.
    pub(crate) fn first(&self, piece: &Piece) -> f64 {
        self.pace.steer_time(0.0, piece.curvature, false)
    }

    /// Less than anything that drives `length` costs.
    pub(crate) fn at_least(&self, length: f64) -> f64 {
        self.pace.fastest(length)
    }
}

/// What is missing to `enough`, as a share of it.
fn want(found: f64, enough: f64) -> f64 {
    (1.0 - found / enough).max(0.0)
}
