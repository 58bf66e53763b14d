//! The tracker: pose and plan to command.
//!
//! Topics in: `odometry`, every one in order; `plan`; `permit`. Topics out: `command`, one per odometry while driving.

use kerbside_messages::{Command, Odometry, Permit};
use kerbside_runtime::{Newest, now};
use kerbside_tracking::{Tracker, TrackerInputs};

use crate::exit::{Exit, Failure};
use crate::ingest::WAIT;
use crate::life::{Life, Service};

/// Runs the tracker.
///
/// # Errors
/// [`Failure`] where the process cannot take part.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    let mut stage = Tracker::new(&service.vehicle, &service.stack.tracker);
    let mut life = Life::join(service, 1)?;
    let mut odometry = life.subscriber::<Odometry>(512)?;
    let mut plan = life.open(|session| session.plan_subscriber())?;
    let mut permit = Newest::of(life.subscriber::<Permit>(1)?);
    let mut command = life.publisher::<Command>()?;
    let listener = life.listener::<Odometry>()?;
    life.waits_for(None);
    while life.goes_on() {
        listener.wait(WAIT);
        plan.update();
        permit.update();
        while let Some(sample) = odometry.receive() {
            life.begin(sample.header.origin);
            let sent = command.send(|out| {
                let inputs = TrackerInputs {
                    now: now(),
                    odometry: &sample,
                    plan: plan.get(),
                    permit: permit.get(),
                };
                stage.step(inputs, out)
            });
            if let Err(error) = sent {
                tracing::error!(%error, "command lost");
            }
        }
        life.checkpoint(0);
        life.end();
        life.counts(odometry.refusals());
    }
    Ok(life.exit())
}
