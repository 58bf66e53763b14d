//! Ideal rolling along a path, without integration in time.

use kerbside_geometry::{Pose, math};

use crate::chassis::Chassis;
use crate::leg::Leg;
use crate::manoeuvre::Path;
use crate::plant::State;

/// Longest piece of path that one quadrature covers \[m\]: at a curvature of 1/m its error is below 1e-16 m.
const PIECE: f64 = 0.02;
/// Three points and weights of Gauss and Legendre on 0..1: exact for polynomials of fifth degree (Abramowitz and Stegun,
/// *Handbook of Mathematical Functions*, 25.4.30).
const POINTS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// A vehicle in the kinematic limit, driven along a path. The heading is the exact integral of the piecewise linear
/// curvature, and position and travel of the front wheels are its quadrature. Pieces begin at places that the path sets,
/// so the truth at an instant does not depend on what was asked for before, to the last bit.
#[derive(Clone, Debug)]
pub(crate) struct Rolling {
    chassis: Chassis,
    /// Truth now.
    state: State,
    /// Truth where the present piece begins, and its place.
    anchor: State,
    leg: usize,
    distance: f64,
}

impl Rolling {
    /// At rest at the beginning of `path`.
    pub(crate) fn new(chassis: &Chassis, path: &Path, start: Pose) -> Self {
        let state = State { pose: start, ..State::default() };
        let mut rolling = Self { chassis: *chassis, state, anchor: state, leg: 0, distance: 0.0 };
        rolling.advance(path, 0.0);
        rolling
    }

    /// Truth now.
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// Rolls on until the time is `to` \[s\].
    pub(crate) fn advance(&mut self, path: &Path, to: f64) {
        let along = path.at(to);
        while self.leg < along.leg {
            self.roll_leg(path, f64::INFINITY);
            self.leg += 1;
            self.distance = 0.0;
        }
        self.state = self.roll_leg(path, along.distance);
        self.state.time = to;
        if let Some(leg) = path.leg(along.leg) {
            let (curvature, _) = leg.curvature(along.distance);
            self.state.speed = leg.direction() * along.speed;
            self.state.yaw_rate = self.state.speed * curvature;
            self.state.steering = math::atan(self.chassis.wheelbase * curvature);
        }
    }

    /// Moves the anchor as far as whole pieces lead, and rolls from there to `to` \[m\] of the leg.
    fn roll_leg(&mut self, path: &Path, to: f64) -> State {
        let Some(leg) = path.leg(self.leg) else {
            return self.anchor;
        };
        let to = to.min(leg.length());
        loop {
            let next = leg.next_knot(self.distance).min(self.distance + PIECE);
            if next > to {
                return self.roll(leg, to);
            }
            self.anchor = self.roll(leg, next);
            self.distance = next;
        }
    }

    /// Truth at `to` \[m\] of the leg, within the piece on which the curvature is linear.
    fn roll(&self, leg: &Leg, to: f64) -> State {
        let (chassis, direction, length) = (&self.chassis, leg.direction(), to - self.distance);
        let (curvature, slope) = leg.curvature(self.distance);
        let turned = |s: f64| direction * s * (curvature + 0.5 * slope * s);
        let Pose { x, y, yaw } = self.anchor.pose;
        let (mut dx, mut dy, mut travel) = (0.0, 0.0, [0.0; 4]);
        for (point, weight) in POINTS {
            let (s, weight) = (point * length, weight * length);
            let (sin, cos) = math::sin_cos(yaw + turned(s));
            dx += weight * cos;
            dy += weight * sin;
            let ways = chassis.travel_per_metre(curvature + slope * s);
            travel.iter_mut().zip(ways).for_each(|(sum, way)| *sum += weight * way);
        }
        let mut state = self.anchor;
        state.pose = Pose::new(x + direction * dx, y + direction * dy, yaw + turned(length));
        state.distance += length;
        for (i, travel) in travel.into_iter().enumerate() {
            let turn = direction * travel / chassis.radius[i];
            state.rotation[i] += turn;
            state.turned[i] += turn.abs();
        }
        state
    }
}
