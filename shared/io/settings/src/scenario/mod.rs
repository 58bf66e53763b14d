//! `scenarios/NAME.toml`: where to park, among what, and what counts as parked.

mod build;
mod checks;
mod keys;

use kerbside_geometry::{Bounds, ConvexPolygon, Pose, Vehicle};
use kerbside_messages::PlanRequest;

use crate::declare::{Loaded, Reading, SourceFile, choices};
use crate::problem::Cause;
use crate::sources::{FileKind, Sources};
use crate::{SettingsError, vehicle};

pub(crate) use keys::{ScenarioDraft, schema};

/// A parking task.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Name of the file, without ending.
    pub name: String,
    /// The file, as messages name it.
    pub file: String,
    /// Name or path of the vehicle, as the file states it.
    pub vehicle: String,
    /// Name of the stack's file that suits the vehicle.
    pub stack: String,
    /// Space to stay in; everything outside is solid.
    pub bounds: Bounds,
    /// What stands in that space.
    pub obstacles: Vec<Obstacle>,
    /// Pose of the rear-axle centre at the start, undisturbed.
    pub start: Pose,
    /// Pose of the rear-axle centre to park at.
    pub goal: Pose,
    /// Direction of travel on arrival.
    pub gear: Gear,
    /// What a plan may do.
    pub plan: PlanLimits,
    /// What counts as parked, in the goal's frame.
    pub tolerance: Tolerance,
    /// How far the true start is from the stated one.
    pub disturbance: Disturbance,
}

/// Something solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// What messages call it.
    pub name: String,
    /// Its outline.
    pub outline: ConvexPolygon,
}

/// What a plan may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanLimits {
    /// Least distance of the footprint from everything solid \[m\].
    pub clearance: f64,
    /// Largest steering angle \[rad\].
    pub steering: f64,
    /// Largest speed \[m/s\].
    pub speed: f64,
    /// Most changes of the travel direction.
    pub gear_changes: u32,
}

/// What counts as parked: how far each coordinate of the end pose may be from the goal, in the
/// goal's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Of x and of y \[m\].
    pub position: f64,
    /// Of the heading \[rad\].
    pub yaw: f64,
}

impl Tolerance {
    /// Whether a vehicle at `pose` is parked at `goal`.
    #[must_use]
    pub fn accepts(&self, goal: &Pose, pose: &Pose) -> bool {
        let error = pose.seen_from(goal);
        let near = error.x.abs() <= self.position && error.y.abs() <= self.position;
        near && error.yaw.abs() <= self.yaw
    }
}

/// How far the true start is from the stated one, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbance {
    /// Largest offset of x and of y, drawn uniformly \[m\].
    pub position: f64,
    /// Largest offset of the heading, drawn uniformly \[rad\].
    pub yaw: f64,
    /// Standard deviation of each coordinate in what the estimator is told \[m\].
    pub known_position: f64,
    /// Standard deviation of the heading in what the estimator is told \[rad\].
    pub known_yaw: f64,
}

choices! {
    /// Direction of travel on arrival.
    pub enum Gear {
        /// Forward.
        Forward = "forward",
        /// In reverse.
        Reverse = "reverse",
        /// Either.
        Either = "either",
    }
}

impl Gear {
    /// The number that a plan request carries.
    #[must_use]
    pub const fn code(self) -> i8 {
        match self {
            Self::Forward => 1,
            Self::Reverse => -1,
            Self::Either => 0,
        }
    }
}

impl Scenario {
    /// The request for a plan to the goal. Its header, id and arm are the client's to fill in.
    ///
    /// Steering and speed are at most what the vehicle can do.
    #[must_use]
    pub fn plan_request(&self, vehicle: &Vehicle) -> PlanRequest {
        let mut request = PlanRequest::default();
        (request.x, request.y, request.yaw) = (self.goal.x, self.goal.y, self.goal.yaw);
        request.clearance = self.plan.clearance;
        request.steering = self.plan.steering.min(vehicle.limits.steering);
        request.speed = self.plan.speed.min(vehicle.limits.speed);
        let (min, max) = (self.bounds.min, self.bounds.max);
        request.bounds = [min[0], min[1], max[0], max[1]];
        request.gear_changes = self.plan.gear_changes;
        request.gear = self.gear.code();
        for obstacle in &self.obstacles {
            let fits = request.push_obstacle(obstacle.outline.corners());
            debug_assert!(fits, "checked when the scenario was read");
        }
        request
    }
}

/// Reads a scenario's file and checks it with its vehicle, or with `instead`.
///
/// # Errors
/// [`SettingsError::Refused`] with every problem of the file.
pub(crate) fn load(
    sources: &Sources,
    file: &SourceFile,
    instead: Option<&str>,
) -> Result<Loaded<Scenario>, SettingsError> {
    let mut reading = Reading::new(schema(), file);
    let mut draft = ScenarioDraft::default();
    reading.apply(&mut draft);
    let vehicle = vehicle::named(sources, &mut reading, &draft.vehicle, instead);
    find_stack(sources, &mut reading, &draft.stack);
    let space = build::space(&mut reading, &draft);
    let settings = reading.settings(&mut draft);
    let scenario = space.map(|space| build::scenario(file, draft, space));
    if let (Some(scenario), Some(vehicle), true) = (&scenario, vehicle, reading.is_sound()) {
        checks::check(&mut reading, scenario, &vehicle.value.vehicle);
    }
    reading.finish(scenario, settings)
}

/// Reports a stack's file that is not there; what is in it is not the scenario's matter.
fn find_stack(sources: &Sources, reading: &mut Reading<'_, ScenarioDraft>, stated: &str) {
    if let Err(error) = sources.find(FileKind::Stack, stated, Some(&reading.file)) {
        let allowed = sources.names(FileKind::Stack).join(", ");
        let cause = Cause::NotFound(error.to_string());
        reading.refuse("stack", &format!("\"{stated}\""), cause, allowed);
    }
}
