//! Ingest: counts to travel.
//!
//! Topics in: `raw`, every one in order. Topics out: `travel`, one per reading.

use core::time::Duration;

use kerbside_messages::{Raw, Travel};
use kerbside_odometry::{Ingest, NoModel};

use crate::exit::{Exit, Failure};
use crate::life::{Life, Service};

/// Longest wait of ingest, estimator and tracker for the event of their input; its timing decides nothing.
///
/// They block on the event. `kerbside bench transport`, 280 bytes on 2 cores of a virtual machine, p50: event 36 us on
/// the other core and 20 us on the same, polling the descriptor 38 and 21, spinning for 200 us first 35 and 19. At 200 Hz
/// a spin ends 4.8 ms before the next sample comes, so it would burn a core and win nothing; a poll gains nothing, and
/// can lose a wake-up where the event cannot. Which core counts more than how: with real-time rights the path shares one.
pub const WAIT: Duration = Duration::from_millis(20);

/// Runs ingest.
///
/// # Errors
/// [`Failure`] where the process cannot take part, or the vehicle has nothing to compute motion from.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    let mut stage = Ingest::with_sensors(&service.vehicle, &service.sensors, &service.stack.ingest)
        .map_err(no_model)?;
    let mut life = Life::join(service, 1)?;
    let mut raw = life.subscriber::<Raw>(512)?;
    let mut travel = life.publisher::<Travel>()?;
    let listener = life.listener::<Raw>()?;
    life.waits_for(None);
    while life.goes_on() {
        listener.wait(WAIT);
        while let Some(sample) = raw.receive() {
            life.begin(life.arrival(sample.arrival, &sample.header));
            let sent = travel.send(|out| {
                stage.step(&sample, sample.missing, sample.new_epoch, out);
                true
            });
            if let Err(error) = sent {
                tracing::error!(%error, "travel lost");
            }
        }
        life.checkpoint(0);
        life.end();
        life.counts(raw.refusals());
    }
    Ok(life.exit())
}

/// A vehicle that has nothing to compute motion from.
#[must_use]
pub fn no_model(error: NoModel) -> Failure {
    Failure::new(Exit::Data, error)
}
