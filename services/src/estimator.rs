//! The estimator: travel to pose.
//!
//! Topics in: `travel`, every one in order; `fix`; `restore`. Topics out: `odometry`, one per travel.

use kerbside_messages::{Fix, Odometry, Restore, Travel};
use kerbside_odometry::EstimatorInputs;
use kerbside_runtime::Newest;

use crate::exit::{Exit, Failure};
use crate::ingest::WAIT;
use crate::life::{Life, Service};

/// Runs the estimator.
///
/// # Errors
/// [`Failure`] where the process cannot take part, or the vehicle has nothing to compute motion from.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    let mut stage = service.estimator()?;
    let mut life = Life::join(service, 1)?;
    let mut travel = life.subscriber::<Travel>(512)?;
    let mut fixes = life.subscriber::<Fix>(16)?;
    let mut restore = Newest::of(life.subscriber::<Restore>(1)?);
    let mut odometry = life.publisher::<Odometry>()?;
    let listener = life.listener::<Travel>()?;
    life.waits_for(None);
    while life.goes_on() {
        listener.wait(WAIT);
        restore.update();
        while let Some(sample) = travel.receive() {
            life.begin(life.arrival(sample.header.origin, &sample.header));
            let fix = fixes.receive();
            let sent = odometry.send(|out| {
                let inputs = EstimatorInputs {
                    travel: &sample,
                    missing: sample.missing,
                    fix: fix.as_deref(),
                    restore: restore.get(),
                };
                stage.step(inputs, out);
                true
            });
            if let Err(error) = sent {
                tracing::error!(%error, "odometry lost");
            }
        }
        life.checkpoint(0);
        life.end();
        life.counts(travel.refusals());
    }
    Ok(life.exit())
}
