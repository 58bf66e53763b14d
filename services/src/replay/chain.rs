//! Ingest and estimator in one thread, with the checks between them that shared memory would make.

use kerbside_messages::{Admission, Fix, Odometry, Raw, Refusal, Refusals, Travel};
use kerbside_odometry::{Estimator, EstimatorInputs, Ingest};

use super::order::Order;
use crate::exit::Failure;
use crate::ingest::no_model;
use crate::service::Service;

/// The two stages and what lies between.
#[derive(Debug)]
pub struct Chain {
    order: Order,
    raw: Admission<Raw>,
    ingest: Ingest,
    travels: Admission<Travel>,
    travel: Travel,
    travel_sequence: u64,
    estimator: Estimator,
    odometries: Admission<Odometry>,
    odometry: Odometry,
    odometry_sequence: u64,
    rolled: [f64; 4],
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
            travels: Admission::default(),
            travel: Travel::default(),
            travel_sequence: 0,
            estimator: service.estimator()?,
            odometries: Admission::default(),
            odometry: Odometry::default(),
            odometry_sequence: 0,
            rolled: [0.0; 4],
        })
    }

    /// The odometry that a reading leads to; none where it is refused.
    pub fn step(&mut self, raw: &Raw) -> Option<&Odometry> {
        self.step_with(raw, None)
    }

    /// The same where a fix came before the reading.
    pub fn step_with(&mut self, raw: &Raw, fix: Option<&Fix>) -> Option<&Odometry> {
        let place = self.order.place(raw);
        let admitted = self.raw.admit_unsealed(raw, 1 + place.life, place.sequence).ok()?;
        self.ingest.step(raw, admitted.missing, admitted.new_epoch, &mut self.travel);
        self.roll();
        self.travel_sequence += 1;
        let admitted = self.travels.admit_unsealed(&self.travel, 1, self.travel_sequence).ok()?;
        let (travel, missing) = (&self.travel, admitted.missing);
        let inputs = EstimatorInputs { travel, missing, fix, restore: None };
        self.estimator.step(inputs, &mut self.odometry);
        self.odometry_sequence += 1;
        self.odometry.header.sequence = self.odometry_sequence;
        self.odometries.admit_unsealed(&self.odometry, 1, self.odometry_sequence).ok()?;
        Some(&self.odometry)
    }

    fn roll(&mut self) {
        for (rolled, increment) in self.rolled.iter_mut().zip(self.travel.increment) {
            *rolled += increment;
        }
    }

    /// What each wheel has rolled by its valid readings \[m\].
    pub fn rolled(&self) -> [f64; 4] {
        self.rolled
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
        if self.travel.refused > 0 {
            let refused = u64::from(self.travel.refused);
            refusals.push(("repeated, or no vehicle can move so", refused));
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
