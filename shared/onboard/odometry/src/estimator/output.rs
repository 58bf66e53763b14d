//! What the estimator says of itself, in every step.

use kerbside_messages::{FilterKind, FilterState, Header, Odometry, Travel, WheelUse};
use nalgebra::{Matrix3, Vector3};

use super::{Estimator, fused};
use crate::settings::Filter;

impl Estimator {
    /// The covariance to publish: while a wheel is awaited, with what the others say has been
    /// rolled.
    fn published_covariance(&self) -> Matrix3<f64> {
        let awaiting = self.wheels.awaiting();
        if awaiting == 0.0 {
            return self.estimate.covariance;
        }
        let yaw = self.curvature * awaiting;
        let unknown = Vector3::new(awaiting, awaiting, yaw).map(|deviation| deviation * deviation);
        self.estimate.covariance + Matrix3::from_diagonal(&unknown)
    }

    /// What the filter says of itself.
    fn record(&self) -> fused::Statistics {
        if let Some(fused) = &self.fused {
            return *fused.statistics();
        }
        let front = self.front.as_ref().map(|front| *front.record()).unwrap_or_default();
        fused::Statistics {
            innovation: front.innovation,
            test_ratio: front.test_ratio,
            corrections: front.corrections,
            gated: front.gated,
            corrected: front.corrected,
            ..fused::Statistics::default()
        }
    }

    fn wheel_use(&self) -> [WheelUse; 4] {
        if let Some(fused) = &self.fused {
            return fused.uses();
        }
        let needed = self.model.needed();
        core::array::from_fn(|wheel| match needed[wheel] || self.front.is_some() {
            true => WheelUse::Used,
            false => WheelUse::Unneeded,
        })
    }

    /// What a later life needs besides pose, covariance and travel.
    fn filter_state(&self) -> FilterState {
        let mut state = FilterState::default();
        self.wheels.save(&mut state);
        self.gyro.save(&mut state);
        if let Some(fused) = &self.fused {
            fused.save(&mut state);
        }
        state
    }

    pub(super) fn write(&self, travel: &Travel, gap: bool, out: &mut Odometry) {
        let stamp = travel.header.stamp;
        let standstill = self.standstill(stamp);
        let (speed, yaw_rate) = if standstill { (0.0, 0.0) } else { self.twist.at(stamp) };
        let record = self.record();
        let mut covariance = [0.0; 9];
        covariance.copy_from_slice(self.published_covariance().as_slice());
        *out = Odometry {
            header: Header { stamp, origin: travel.header.origin, ..out.header },
            x: self.estimate.pose.x,
            y: self.estimate.pose.y,
            yaw: self.estimate.pose.yaw,
            speed,
            yaw_rate,
            steering: self.steering.unwrap_or(0.0),
            covariance,
            innovation: record.innovation,
            test_ratio: record.test_ratio,
            wheel_ratio: record.wheel_ratio,
            block_ratio: record.block_ratio,
            distance: self.distance,
            travel: self.wheels.applied(self.fused.is_some()),
            counter_epoch: travel.counter_epoch,
            resets: self.resets,
            corrections: record.corrections,
            gated: record.gated,
            unusable: self.unusable,
            state: self.state.code(),
            model: self.model.kind().code(),
            reset_reason: self.reason.code(),
            fix_verdict: self.verdict.code(),
            standstill: u8::from(standstill),
            corrected: u8::from(record.corrected),
            gap: u8::from(gap),
            filter: filter_kind(self.settings.filter).code(),
            wheel_use: self.wheel_use().map(WheelUse::code),
            fix_sequence: self.fix_sequence,
            filter_state: self.filter_state(),
        };
    }
}

fn filter_kind(filter: Filter) -> FilterKind {
    match filter {
        Filter::Rear => FilterKind::Rear,
        Filter::Paper => FilterKind::Paper,
        Filter::PaperOwn => FilterKind::PaperOwn,
        Filter::Fused => FilterKind::Fused,
    }
}
