//! A run in lockstep.

use kerbside_messages::{Nanos, Verb, nanos};

use super::scene::Start;
use super::trace::Trace;
use super::{Job, Run};
use crate::exit::Failure;
use crate::lockstep::{Script, World};
use crate::manoeuvre::{Act, Manoeuvre, Observation};
use crate::vehicle::Making;

/// The operator looks every so often \[ns\].
const LOOK: Nanos = 20_000_000;

/// Runs `job` in lockstep.
///
/// # Errors
/// [`Failure`] where the vehicle has nothing to compute motion from.
pub fn run(job: &Job, script: Script) -> Result<Run, Failure> {
    let begun = kerbside_runtime::now();
    let scenario = &job.scenario;
    let start = Start::draw(scenario, job.seed);
    let making = Making {
        vehicle: job.plant.vehicle.clone(),
        effects: job.plant.effects.clone(),
        start: start.truth,
        seed: job.seed,
        boot: 1,
        silence: job.service.safety().timeouts.vehicle_silence,
    };
    let mut world = World::new(&job.service, &making, script)?;
    let mut trace = Trace::new(world.now());
    let mut manoeuvre = Manoeuvre::new(world.now(), &job.service.vehicle, job.rearm);
    let mut look_due = world.now();
    let mut plans = 0;
    let end = loop {
        world.tick();
        take_in(&mut trace, &world);
        if world.now() < look_due {
            continue;
        }
        look_due = world.now() + LOOK;
        let (armed, planned) = (world.take_answer(), world.take_planned());
        if planned.is_some()
            && let Some((head, points)) = world.plan()
        {
            super::take_plan(&mut trace, world.now(), head, points);
        }
        let seen = Observation {
            state: world.state(),
            odometry: world.odometry(),
            armed: armed.as_ref(),
            planned: planned.as_ref(),
            ..Observation::default()
        };
        match manoeuvre.step(world.now(), &seen) {
            Act::Watch => {}
            Act::Fix => world.fix(&start.fix(world.now())),
            Act::Arm => world.ask(1, Verb::Arm),
            Act::Plan { arm } => {
                plans += 1;
                let mut request = scenario.plan_request(&job.service.vehicle);
                (request.id, request.arm) = (plans, arm);
                world.request_plan(&request);
            }
            Act::End(end) => break end,
        }
    };
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

fn take_in(trace: &mut Trace, world: &World) {
    let fresh = &world.fresh;
    trace.odometry.extend(fresh.odometry);
    trace.truth.extend(fresh.truth);
    trace.actuators.extend(fresh.actuator);
    if let Some(command) = &fresh.command {
        trace.command(command);
    }
    if let Some(state) = &fresh.state {
        trace.state(state);
    }
}
