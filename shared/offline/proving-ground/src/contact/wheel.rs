//! A wheel's part in the balance of forces.

use kerbside_geometry::{Drive, Wheel as Corner};

use super::{CENTRE_SPLIT, FORWARD, FRONT_SPLIT, LATERAL, REAR_SPLIT, YAW};
use crate::balance::UNKNOWNS;

/// A wheel's fixed properties.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) radius: f64,
    pub(super) load: f64,
    pub(super) driven: bool,
    pub(super) lateral_compliance: f64,
    pub(super) longitudinal_compliance: f64,
    /// Signs with which the splits of the differentials enter its rotation rate.
    pub(super) split: [f64; UNKNOWNS],
}

/// One wheel in one round of the iteration; speeds per unit of commanded speed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wheel {
    pub(super) sin: f64,
    pub(super) cos: f64,
    /// Along the wheel's own heading.
    pub(super) along: f64,
    /// What the wheel's surface runs ahead of that; 0 of one that is not driven.
    pub(super) spin: f64,
    /// Stiffnesses, scaled.
    pub(super) lateral_weight: f64,
    pub(super) longitudinal_weight: f64,
}

impl Contact {
    /// Whether the wheel is on the front axle.
    pub(super) fn is_steered(&self) -> bool {
        self.x != 0.0
    }

    /// Speed of the surface of a driven wheel.
    pub(super) fn surface(&self, motor: f64, z: &[f64; UNKNOWNS]) -> f64 {
        let split: f64 = (FRONT_SPLIT..UNKNOWNS).map(|i| self.split[i] * z[i]).sum();
        self.radius * (motor + split)
    }

    /// Row and target of the side slip, linear about the present bend of a linkage that bends.
    pub(super) fn lateral_row(
        &self,
        wheel: &Wheel,
        bend: f64,
        bends: bool,
    ) -> ([f64; UNKNOWNS], f64) {
        let (sin, cos) = (wheel.sin, wheel.cos);
        let turned = if bends && self.is_steered() { -wheel.along } else { 0.0 };
        let row = [-sin, cos, sin * self.y + cos * self.x, turned, 0.0, 0.0, 0.0];
        (row, turned * bend)
    }

    /// Row and target of the longitudinal slip.
    pub(super) fn longitudinal_row(&self, wheel: &Wheel, motor: f64) -> ([f64; UNKNOWNS], f64) {
        let (sin, cos) = (wheel.sin, wheel.cos);
        let mut row = self.split.map(|sign| sign * self.radius);
        row[FORWARD] = -cos;
        row[LATERAL] = -sin;
        row[YAW] = cos * self.y - sin * self.x;
        (row, -self.radius * motor)
    }
}

/// How the differentials' splits enter a wheel's rotation rate.
pub(super) fn split(drive: Drive, wheel: Corner) -> [f64; UNKNOWNS] {
    let mut split = [0.0; UNKNOWNS];
    let side = if wheel.is_left() { -1.0 } else { 1.0 };
    let all = drive == Drive::All;
    if wheel.is_front() && (all || drive == Drive::Front) {
        split[FRONT_SPLIT] = side;
    }
    if !wheel.is_front() && (all || drive == Drive::Rear) {
        split[REAR_SPLIT] = side;
    }
    if all {
        split[CENTRE_SPLIT] = if wheel.is_front() { 1.0 } else { -1.0 };
    }
    split
}
