//! A run in lockstep.

use kerbside_messages::nanos;

use super::scene::Start;
use super::trace::Trace;
use super::{Job, Run};
use crate::exit::Failure;
use crate::lockstep::{Schedule, Searching, Task, Watcher, World, drive};
use crate::manoeuvre::End;

/// Runs `job` in lockstep, under these faults.
///
/// # Errors
/// [`Failure`] where the vehicle has nothing to compute motion from.
pub fn run(job: &Job, schedule: Schedule) -> Result<Run, Failure> {
    let begun = kerbside_runtime::now();
    let task = Task {
        service: &job.service,
        scenario: &job.scenario,
        start: &Start::draw(&job.scenario, job.seed),
        plant: &job.plant,
        seed: job.seed,
        rearm: job.rearm,
    };
    let mut world = task.world(schedule)?;
    let mut trace = Trace::new(world.now());
    // A trace watches to the end.
    let end = drive(&task, &mut world, &mut Searching, &mut trace).unwrap_or(End::Interrupted);
    let wall = kerbside_messages::seconds(kerbside_runtime::now() - begun);
    Ok(Run {
        trace,
        end,
        recording: None,
        instance: None,
        wall_seconds: wall,
        search_seconds: world.search_seconds,
        simulated_seconds: kerbside_messages::seconds(world.elapsed().max(nanos(1e-9))),
    })
}

impl Watcher for Trace {
    fn tick(&mut self, world: &World) -> bool {
        let fresh = &world.fresh;
        self.odometry.extend(fresh.odometry.as_deref());
        self.truth.extend(fresh.truth);
        self.actuators.extend(fresh.actuator.as_deref());
        if let Some(command) = &fresh.command {
            self.command(command);
        }
        if let Some(state) = &fresh.state {
            self.state(state);
        }
        true
    }

    fn planned(&mut self, world: &World) {
        if let Some((head, points)) = world.plan() {
            super::take_plan(self, world.now(), head, points);
        }
    }
}
