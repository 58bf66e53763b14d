//! No collision: the true footprint touches nothing solid.

use kerbside_geometry::{ConvexPolygon, Pose, Vehicle};
use kerbside_settings::Scenario;

use crate::lockstep::World;

#[derive(Debug)]
pub(super) struct ClearanceWatch<'a> {
    scenario: &'a Scenario,
    vehicle: &'a Vehicle,
    obstacles: Vec<&'a ConvexPolygon>,
    least: f64,
    /// No part of the vehicle can touch anything before it has rolled so far \[m\].
    safe_until: f64,
    /// How far the outermost part moves for a metre of the rear axle.
    lever: f64,
}

impl<'a> ClearanceWatch<'a> {
    pub(super) fn new(scenario: &'a Scenario, vehicle: &'a Vehicle) -> Self {
        use kerbside_geometry::math;
        // Beyond the steering's limit, for effects and overshoot.
        let curvature = math::tan((1.2 * vehicle.limits.steering).min(1.2)) / vehicle.wheelbase;
        Self {
            scenario,
            vehicle,
            obstacles: scenario.obstacles.iter().map(|obstacle| &obstacle.outline).collect(),
            least: f64::INFINITY,
            safe_until: 0.0,
            lever: 1.0 + curvature * vehicle.footprint.reach(),
        }
    }

    pub(super) fn least(&self) -> f64 {
        self.least
    }

    pub(super) fn look(&mut self, world: &World) -> Result<(), String> {
        let Some(truth) = &world.fresh.truth else { return Ok(()) };
        if truth.distance < self.safe_until {
            return Ok(());
        }
        let pose = Pose::new(truth.x, truth.y, truth.yaw);
        let footprint = self.vehicle.footprint.polygon_at(&pose);
        let inside = self.scenario.bounds.depth(footprint.corners());
        let distances = self.obstacles.iter().map(|obstacle| footprint.distance(obstacle));
        let clearance = distances.fold(inside, f64::min);
        self.least = self.least.min(clearance);
        if clearance <= 0.0 {
            return Err(format!(
                "the footprint touches something at x {:.3}, y {:.3}, yaw {:.3}, at {:.3} m/s",
                truth.x, truth.y, truth.yaw, truth.speed
            ));
        }
        self.safe_until = truth.distance + clearance / self.lever;
        Ok(())
    }
}
