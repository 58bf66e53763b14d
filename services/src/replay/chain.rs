//! Ingest and estimator in one thread, with the checks between them that shared memory would make.

use kerbside_messages::{Admission, Odometry, Raw, Refusal, Refusals, Travel, seal};
use kerbside_odometry::{Estimator, EstimatorInputs, Ingest};

use super::order::Order;
use crate::exit::Failure;
use crate::ingest::no_model;
use crate::lockstep::Channel;
use crate::service::Service;

/// The two stages and what lies between.
#[derive(Debug)]
pub struct Chain {
    order: Order,
    raw: Admission<Raw>,
    ingest: Ingest,
    travel: Channel<Travel>,
    estimator: Estimator,
    odometry: Channel<Odometry>,
    refused: u32,
}

impl Chain {
    /// The stages as the processes of `service`'s instance would have them.
    ///
    /// # Errors
    /// [`Failure`] where the vehicle has nothing to compute motion from.
    pub fn new(service: &Service) -> Result<Self, Failure> {
        let (vehicle, sensors, stack) = (&service.vehicle, &service.sensors, &service.stack);
        Ok(Self {
            order: Order::default(),
            raw: Admission::default(),
            ingest: Ingest::with_sensors(vehicle, sensors, &stack.ingest).map_err(no_model)?,
            travel: Channel::new(1),
            estimator: Estimator::with_sensors(vehicle, sensors, &stack.estimator)
                .map_err(no_model)?,
            odometry: Channel::new(1),
            refused: 0,
        })
    }

    /// The odometry that a reading leads to; none where it is refused.
    pub fn step(&mut self, raw: &Raw) -> Option<Odometry> {
        let Self { raw: admission, ingest, travel, estimator, odometry, .. } = self;
        let (now, place) = (raw.arrival, self.order.place(raw));
        let mut sealed = *raw;
        seal(&mut sealed, &[], 1 + place.life, place.sequence, now);
        let admitted = admission.admit(&sealed, &[], now).ok()?;
        let (travel, passed) = travel.send(now, |out| {
            ingest.step(&sealed, admitted.missing, admitted.new_epoch, out);
            true
        })?;
        self.refused = travel.refused;
        let estimate = odometry.send(now, |out| {
            let (fix, restore) = (None, None);
            estimator.step(
                EstimatorInputs { travel: &travel, missing: passed.missing, fix, restore },
                out,
            );
            true
        });
        estimate.map(|(odometry, _)| odometry)
    }

    /// What was refused on the way in, by reason.
    pub fn refusals(&self) -> Vec<(&'static str, u64)> {
        let Refusals { by_reason, .. } = self.raw.counts();
        let named = |index: usize| REASONS[index];
        let mut refusals: Vec<_> = by_reason
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
            .map(|(index, count)| (named(index), *count))
            .collect();
        if self.refused > 0 {
            refusals.push(("repeated, or no vehicle can move so", u64::from(self.refused)));
        }
        refusals
    }
}

/// Words for [`Refusal::index`].
const REASONS: [&str; Refusal::KINDS] = [
    "another layout version",
    "another topic",
    "check sum does not match",
    "from an earlier life of the interface",
    "repeated or out of order",
    "too old",
    "from the future",
    "a number that is none",
    "a number out of range",
];
