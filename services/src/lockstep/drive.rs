//! A parking manoeuvre in a simulated world, with its operator.

use kerbside_messages::{Nanos, Odometry, PlanRequest, Verb};
use kerbside_settings::Scenario;

use super::schedule::Schedule;
use super::world::{Plans, World};
use crate::exit::Failure;
use crate::manoeuvre::{Act, End, Manoeuvre, Observation};
use crate::park::scene::Start;
use crate::planner::{Answered, answer_request};
use crate::service::Service;
use crate::vehicle::Making;
use crate::vehicle::plant::Plant;

/// The operator looks every so often \[ns\].
const LOOK: Nanos = 20_000_000;

/// A manoeuvre to drive in lockstep.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// Configuration.
    pub service: &'a Service,
    /// Where to park.
    pub scenario: &'a Scenario,
    /// Where it begins.
    pub start: &'a Start,
    /// The vehicle that is driven.
    pub plant: &'a Plant,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Arm again after a fault.
    pub rearm: bool,
}

impl Task<'_> {
    /// The world in which it is driven.
    ///
    /// # Errors
    /// [`Failure`] where the vehicle has nothing to compute motion from.
    pub fn world(&self, schedule: Schedule) -> Result<World, Failure> {
        let making = Making {
            vehicle: self.plant.vehicle.clone(),
            effects: self.plant.effects,
            start: self.start.truth,
            seed: self.seed,
            boot: 1,
            silence: self.service.safety().timeouts.vehicle_silence,
        };
        World::new(self.service, &making, schedule)
    }
}

/// Who watches a world.
pub trait Watcher {
    /// A tick is over; false ends the drive.
    fn tick(&mut self, world: &World) -> bool;

    /// A plan stands that was asked for.
    fn planned(&mut self, world: &World);
}

/// Searches anew for each request.
#[derive(Clone, Copy, Debug, Default)]
pub struct Searching;

impl Plans for Searching {
    fn answer(
        &mut self,
        service: &Service,
        request: &PlanRequest,
        odometry: Option<&Odometry>,
    ) -> Answered {
        answer_request(service, request, odometry, &mut |_| {})
    }
}

/// Drives `task` in `world` until its operator is done; none where the watcher ended it.
pub fn drive(
    task: &Task<'_>,
    world: &mut World,
    plans: &mut dyn Plans,
    watcher: &mut dyn Watcher,
) -> Option<End> {
    let vehicle = &task.service.vehicle;
    let mut manoeuvre = Manoeuvre::new(world.now(), vehicle, task.rearm);
    let mut look_due = world.now();
    let mut requests = 0;
    loop {
        world.tick(plans);
        if !watcher.tick(world) {
            return None;
        }
        if world.now() < look_due {
            continue;
        }
        look_due = world.now() + LOOK;
        let (armed, planned) = (world.take_answer(), world.take_planned());
        if planned.is_some() {
            watcher.planned(world);
        }
        let seen = Observation {
            state: world.state(),
            odometry: world.odometry(),
            armed: armed.as_ref(),
            planned: planned.as_ref(),
            supervisor_lost: world.supervisor_is_dead(),
            ..Observation::default()
        };
        match manoeuvre.step(world.now(), &seen) {
            Act::Watch => {}
            Act::Fix => world.fix(&task.start.fix(world.now())),
            Act::Arm => world.ask(1, Verb::Arm),
            Act::Plan { arm } => {
                requests += 1;
                let mut request = task.scenario.plan_request(vehicle);
                (request.id, request.arm) = (requests, arm);
                world.request_plan(&request);
            }
            Act::End(end) => return Some(end),
        }
    }
}
