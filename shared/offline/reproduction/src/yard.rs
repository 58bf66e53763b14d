//! The runs of a calibration: ten straights of 5 m, ten full circles of 1.5 m to both sides, on the proving ground.

use core::f64::consts::TAU;

use kerbside_calibration::{
    COUNT as COUNT_PARAMETERS, Noise, Parameters, ReferencePose, Run, Series, Settings,
    rear_from_front,
};
use kerbside_geometry::{Pose, Vehicle, angle, math};
use kerbside_proving_ground::{
    Chassis, Driven, Leg, Manoeuvre, Pace, Physics, Recorded, Reference, Section, Sensors,
    TestDrive,
};

use crate::random::seed_of;

/// Straights of a calibration, and as many circles.
pub(crate) const COUNT: usize = 10;
/// Length of a straight \[m\].
const STRAIGHT: f64 = 5.0;
/// How fast calibration runs are driven.
const PACE: Pace = Pace { speed: 0.25, acceleration: 0.1 };

/// Where and with what a calibration is driven.
#[derive(Clone, Debug)]
pub(crate) struct Yard {
    pub(crate) physics: Physics,
    pub(crate) sensors: Sensors,
    /// Radius of the circles \[m\].
    pub(crate) radius: f64,
}

/// What is driven: a straight, a circle to the left, one to the right.
pub(crate) type Drives = [TestDrive; 3];

impl Yard {
    /// The kinematic car with equal noise on both axles, judged by `reference`; its steering sensor reads
    /// `steering_zero` \[rad\] too much.
    pub(crate) fn new(reference: Reference, steering_zero: f64) -> Self {
        let mut sensors = Sensors { reference: Some(reference), ..Sensors::paper(1.0) };
        if let Some(steering) = &mut sensors.steering {
            steering.offset = steering_zero;
        }
        Self { physics: Physics::NEUTRAL, sensors, radius: 1.5 }
    }

    /// What is driven: the driver trusts the steering sensor, whose zero bends what should be straight.
    pub(crate) fn drives(&self) -> Drives {
        let wheelbase = Chassis::paper().wheelbase;
        let zero = self.sensors.steering.map_or(0.0, |sensor| sensor.offset);
        let bent = |curvature: f64| math::tan(math::atan(wheelbase * curvature) - zero) / wheelbase;
        let circle = |radius: f64| {
            let curvature = bent(1.0 / radius);
            Section { length: TAU / curvature.abs(), curvature }
        };
        let straight = Section { length: STRAIGHT, curvature: bent(0.0) };
        [straight, circle(self.radius), circle(-self.radius)].map(|section| {
            let manoeuvre = Manoeuvre::path(vec![Leg::new(true, &[section], 0.0)], PACE);
            crate::scatter::drive(self.physics, &self.sensors, manoeuvre)
        })
    }

    /// Nominal vehicle: what is measured by hand.
    pub(crate) fn nominal(&self) -> Vehicle {
        let chassis = Chassis {
            track_front: 0.310,
            track_rear: 0.310,
            radius: [0.5 * 0.145; 4],
            ..Chassis::paper()
        };
        chassis.believed(&self.sensors)
    }

    /// Settings of a calibration that believes the noise that there is.
    pub(crate) fn settings(&self) -> Settings {
        let vehicle = self.nominal();
        Settings { noise: Noise::of(&vehicle), folds: 0, ..Settings::of(&vehicle) }
    }

    /// The truth in the calibration's terms.
    pub(crate) fn truth(&self) -> Parameters {
        let mut truth = Parameters::nominal(&Chassis::paper().believed(&self.sensors));
        truth.values[7] = self.sensors.steering.map_or(0.0, |sensor| sensor.offset);
        truth
    }

    /// The runs of one calibration.
    pub(crate) fn runs(&self, driven: &[Driven<'_>; 3], seed: u64) -> Vec<Run> {
        let straight = |i: usize| {
            let recorded = driven[0].record(seed_of(seed, 0, i as u64));
            self.run(format!("straight-{i}"), "straight", &recorded)
        };
        let circle = |i: usize| {
            let recorded = driven[1 + i % 2].record(seed_of(seed, 1, i as u64));
            self.run(format!("circle-{i}"), "circle", &recorded)
        };
        (0..COUNT).map(straight).chain((0..COUNT).map(circle)).collect()
    }

    /// A run that no calibration sees.
    pub(crate) fn left_out(&self, recorded: &Recorded) -> Run {
        self.run("left-out".to_owned(), "", recorded)
    }

    /// A run, its reference known at both ends.
    fn run(&self, name: String, manoeuvre: &str, recorded: &Recorded) -> Run {
        let reference = &recorded.reference;
        let seen = [reference.first(), reference.last()].into_iter().flatten();
        let pose = |seen: &kerbside_proving_ground::Stamped<Pose>| {
            let Pose { x, y, yaw } = seen.value;
            ReferencePose { t: seen.time, x, y, yaw: Some(angle::wrap(yaw)) }
        };
        let reference = seen.map(pose).collect();
        let mut run = Run { name, manoeuvre: manoeuvre.to_owned(), reference, ..Run::default() };
        let Some(encoders) = &self.sensors.encoders else { return run };
        let times: Vec<f64> = recorded.counts.iter().map(|counts| counts.time).collect();
        run.rotation = core::array::from_fn(|wheel| {
            let per_turn = encoders.counts_per_revolution[wheel]?;
            let counts: Option<Vec<i64>> =
                recorded.counts.iter().map(|counts| counts.value[wheel]).collect();
            let bits = encoders.counter_bits;
            Some(Series::from_wrapping_counts(times.clone(), &counts?, bits, per_turn))
        });
        let steering = &recorded.steering;
        run.steering = (!steering.is_empty()).then(|| Series {
            t: steering.iter().map(|read| read.time).collect(),
            value: steering.iter().map(|read| read.value).collect(),
        });
        run
    }
}

/// Where dead reckoning from the origin ends: by the rear axle, or by the front one.
pub(crate) fn reckon(run: &Run, parameters: &Parameters, front: bool) -> Pose {
    let [fl, fr, rl, rr, track_front, track_rear, wheelbase, ..]: [f64; COUNT_PARAMETERS] =
        parameters.values.into();
    let (wheels, radii) = if front { ([0, 1], [fl, fr]) } else { ([2, 3], [rl, rr]) };
    let (Some(left), Some(right)) = (&run.rotation[wheels[0]], &run.rotation[wheels[1]]) else {
        return Pose::default();
    };
    let steering = run.steering.as_ref();
    let mut pose = Pose::default();
    for index in 1..left.len() {
        let turned = |series: &Series| series.value[index] - series.value[index - 1];
        let (left, right) = (radii[0] * turned(left), radii[1] * turned(right));
        let (distance, turn) = match steering {
            Some(steering) if front => {
                let read = 0.5 * (steering.value[index] + steering.value[index - 1]);
                let angle = parameters.road_angle(read);
                rear_from_front(left, right, angle, track_front, wheelbase)
            }
            _ => (0.5 * (left + right), (right - left) / track_rear),
        };
        pose = pose.advance(distance, turn);
    }
    pose
}

#[cfg(test)]
mod tests;
