//! From what was recorded to a pose: ingest and estimator, as the vehicle runs them.

use kerbside_geometry::{Pose, Vehicle};
use kerbside_messages::{EstimatorState, Header, Odometry, Raw, Travel, nanos};
use kerbside_odometry::{
    Estimator, EstimatorInputs, EstimatorSettings, Filter, Ingest, IngestSettings, InitialPose,
    NoModel, ParameterPrior, Sensors,
};
use kerbside_proving_ground::Recorded;

/// The host's clock when a drive begins \[s\].
const BEGIN: f64 = 5.0;
/// Boot of the vehicle.
const BOOT: u32 = 77;

/// Who computes a pose, from which sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contender {
    /// Rear wheels alone.
    Rear,
    /// Front wheels and steering sensor alone.
    Front,
    /// The paper's filter in its reading (i): the front pose integrated on its own from the start.
    PaperOwn,
    /// The paper's filter in its reading (ii): the front increment applied to the last fused pose.
    Paper,
    /// All wheels, without the steering sensor.
    FusedBlind,
    /// All sensors.
    Fused,
}

impl Contender {
    /// Those that are compared everywhere.
    pub const ALL: [Self; 6] =
        [Self::Rear, Self::Front, Self::PaperOwn, Self::Paper, Self::FusedBlind, Self::Fused];

    /// Name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rear => "rear",
            Self::Front => "front",
            Self::PaperOwn => "paper (i)",
            Self::Paper => "paper (ii)",
            Self::FusedBlind => "fused, no steering",
            Self::Fused => "fused",
        }
    }

    /// The filter behind it.
    #[must_use]
    pub const fn filter(self) -> Filter {
        match self {
            Self::Rear | Self::Front => Filter::Rear,
            Self::PaperOwn => Filter::PaperOwn,
            Self::Paper => Filter::Paper,
            Self::FusedBlind | Self::Fused => Filter::Fused,
        }
    }

    fn sensors(self, vehicle: &Vehicle) -> Sensors {
        let all = Sensors::of(vehicle);
        match self {
            Self::Front => Sensors { wheels: [true, true, false, false], ..all },
            Self::FusedBlind => Sensors { steering: false, ..all },
            _ => all,
        }
    }
}

/// What is believed of the vehicle.
#[derive(Clone, Debug)]
pub(crate) struct Belief {
    pub(crate) vehicle: Vehicle,
    /// What its calibration left open.
    pub(crate) prior: ParameterPrior,
    /// Where it starts.
    pub(crate) start: Pose,
}

/// Ingest and estimator.
#[derive(Debug)]
pub(crate) struct Follower {
    ingest: Ingest,
    estimator: Estimator,
    travel: Travel,
    /// The newest estimate.
    pub(crate) odometry: Odometry,
}

impl Follower {
    pub(crate) fn new(contender: Contender, belief: &Belief) -> Result<Self, NoModel> {
        let (vehicle, sensors) = (&belief.vehicle, contender.sensors(&belief.vehicle));
        let initial = InitialPose { pose: belief.start, position_noise: 0.0, yaw_noise: 0.0 };
        let settings = EstimatorSettings {
            filter: contender.filter(),
            initial_pose: Some(initial),
            ..EstimatorSettings::default()
        };
        Ok(Self {
            ingest: Ingest::with_sensors(vehicle, &sensors, &IngestSettings::default())?,
            estimator: Estimator::with_prior(vehicle, &sensors, &settings, &belief.prior)?,
            travel: Travel::default(),
            odometry: Odometry::default(),
        })
    }

    /// Takes in a reading.
    pub(crate) fn feed(&mut self, raw: &Raw) -> &Odometry {
        self.ingest.step(raw, 0, false, &mut self.travel);
        let inputs = EstimatorInputs { travel: &self.travel, missing: 0, fix: None, restore: None };
        self.estimator.step(inputs, &mut self.odometry);
        &self.odometry
    }

    /// Whether the estimate has a pose.
    pub(crate) fn is_valid(&self) -> bool {
        self.odometry.state == EstimatorState::Valid.code()
    }

    /// The estimate of the rear-axle centre.
    pub(crate) fn pose(&self) -> Pose {
        Pose::new(self.odometry.x, self.odometry.y, self.odometry.yaw)
    }
}

/// A reading at `time` \[s\] of a drive.
pub(crate) fn reading(
    time: f64,
    frame: u32,
    counts: &[Option<i64>; 4],
    steering: Option<f64>,
) -> Raw {
    let stamp = nanos(BEGIN + time);
    let mask =
        (0..4).filter(|wheel| counts[*wheel].is_some()).fold(0, |mask, wheel| mask | 1 << wheel);
    Raw {
        header: Header::stamped(stamp, 0),
        vehicle_time: stamp,
        arrival: stamp,
        counts: counts.map(|count| count.unwrap_or(0)),
        steering: steering.unwrap_or(0.0),
        boot: BOOT,
        frame,
        counts_mask: mask,
        has_steering: u8::from(steering.is_some()),
        ..Raw::default()
    }
}

/// The readings of a drive: one per reading of the encoders, with the steering angle that was read by then.
pub(crate) fn readings(recorded: &Recorded) -> Vec<Raw> {
    let mut steering = recorded.steering.iter().peekable();
    let mut raws = Vec::with_capacity(recorded.counts.len());
    for (frame, counts) in (1..).zip(&recorded.counts) {
        let mut newest = None;
        while let Some(read) = steering.next_if(|read| read.time <= counts.time) {
            newest = Some(read.value);
        }
        raws.push(reading(counts.time, frame, &counts.value, newest));
    }
    raws
}

#[cfg(test)]
mod tests {
    use kerbside_geometry::SteeringSensor;
    use kerbside_proving_ground::{Chassis, Sensors as Fitted};

    use super::*;

    #[test]
    fn a_known_steering_zero_is_taken_out_once() {
        const ZERO: f64 = 0.03;
        let mut vehicle = Chassis::paper().believed(&Fitted::paper(1.0));
        let sensor =
            vehicle.steering_sensor.map(|sensor| SteeringSensor { offset: ZERO, ..sensor });
        vehicle.steering_sensor = sensor;
        let prior = ParameterPrior::known();
        let belief = Belief { vehicle, prior, start: Pose::default() };
        let mut follower = Follower::new(Contender::Fused, &belief).unwrap();
        for frame in 0..200 {
            let counts = [Some(i64::from(frame) * 20); 4];
            follower.feed(&reading(0.02 * f64::from(frame), frame, &counts, Some(ZERO)));
        }
        // Not to the bit: the diameters differ.
        assert!(follower.odometry.distance > 0.5 && follower.pose().yaw.abs() < 0.02);
    }
}
