//! Rows 1 to 3: Tables 1 and 2 and Figure 6 of the paper.

use kerbside_calibration::{
    COUNT as PARAMETERS, Calibrated, ClosedForm, Information, Parameters, Run, calibrate,
    closed_form, information,
};
use kerbside_geometry::{Pose, Vehicle, angle};
use kerbside_odometry::{PARAMETERS as BELIEVED, ParameterPrior};
use kerbside_proving_ground::{Driven, Physics, Reference, Residuals};
use nalgebra::{SMatrix, SVector};

use crate::belief::deviations;
use crate::error::ReproductionError;
use crate::follower::Belief;
use crate::progress::Progress;
use crate::random::{Random, seed_of};
use crate::scatter::Trial;
use crate::yard::{COUNT, Yard, reckon};

/// What one repetition of a calibration found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Estimate minus truth of the joint fit, in the order of the calibration's parameters.
    pub joint: [f64; PARAMETERS],
    /// Standard deviations that the joint fit states.
    pub deviations: [f64; PARAMETERS],
    /// Estimate minus truth of the paper's closed form.
    pub closed: [f64; PARAMETERS],
    /// Factor by which the fit widened its covariance: 1 where residuals were as believed.
    pub inflation: f64,
    /// Runs that were rejected.
    pub rejected: usize,
    /// Ends of runs that the fit has not seen, by axle (rear, front): of straights and of left circles.
    pub ends: [[Ends; 2]; 2],
}

/// Ends of ten runs, estimate minus truth in the frame of the start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ends {
    /// By what was measured by hand.
    pub before: Vec<Pose>,
    /// By the joint fit.
    pub after: Vec<Pose>,
    /// By the closed form.
    pub closed: Vec<Pose>,
}

/// Repetitions of a calibration under the same circumstances.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrations {
    /// The circumstances, for people.
    pub name: &'static str,
    /// Cramer-Rao bounds of the parameters; infinite for what is not identified.
    pub bound: [f64; PARAMETERS],
    /// The truth.
    pub truth: Parameters,
    /// What each found.
    pub found: Vec<Found>,
}

/// What calibrations of a yard tell a filter: of each, parameters scattered about what a calibration without noise
/// finds, by the covariance that one with noise states.
#[derive(Clone, Debug)]
pub(crate) struct Told {
    nominal: Vehicle,
    centre: Parameters,
    root: SMatrix<f64, IDENTIFIED, IDENTIFIED>,
    prior: ParameterPrior,
}

/// How many parameters a filter is told: all but the steering's gain.
const IDENTIFIED: usize = 8;

/// Circumstances.
#[derive(Clone, Debug)]
pub(crate) struct Circumstances {
    pub(crate) name: &'static str,
    pub(crate) yard: Yard,
    /// Number of the case.
    pub(crate) case: u64,
    /// Whether runs left out are driven.
    pub(crate) judged: bool,
}

impl Circumstances {
    /// The paper's car and a reference of 2 mm and 2 mrad.
    pub(crate) fn fine() -> Self {
        let yard = Yard::new(Reference::fine(), 0.0);
        Self { name: "2 mm / 2 mrad", yard, case: 1, judged: true }
    }

    /// The same, its steering sensor off by 0.2 degrees.
    pub(crate) fn bent() -> Self {
        let yard = Yard::new(Reference::fine(), angle::radians(0.2));
        Self { name: "steering zero off by 0.2 deg", yard, case: 2, judged: false }
    }

    /// The paper's reference.
    pub(crate) fn coarse() -> Self {
        let yard = Yard::new(Reference::coarse(), 0.0);
        Self { name: "5 cm / 5 deg", yard, case: 3, judged: false }
    }

    /// Circles of another radius.
    pub(crate) fn wide() -> Self {
        let yard = Yard { radius: 2.5, ..Yard::new(Reference::fine(), 0.0) };
        Self { name: "circles of 2.5 m", yard, case: 4, judged: false }
    }

    /// With tyres, linkage and actuators that are not ideal.
    pub(crate) fn physical(strength: f64, case: u64) -> Self {
        let physics = Physics::ordinary().at_strength(strength);
        let yard = Yard { physics, ..Yard::new(Reference::fine(), 0.0) };
        Self { name: "with physics", yard, case, judged: strength >= 1.0 }
    }
}

/// Repeats a calibration.
pub(crate) fn repeat(
    what: &Circumstances,
    repeats: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Calibrations, ReproductionError> {
    let (yard, truth) = (&what.yard, what.yard.truth());
    let drives = yard.drives();
    let driven = [drives[0].driven(), drives[1].driven(), drives[2].driven()];
    let (vehicle, settings) = (yard.nominal(), yard.settings());
    let plan = yard.runs(&driven, seed_of(seed, what.case, u64::MAX));
    let bound = information(&plan, &vehicle, &truth, &settings)?;
    let mut all = Calibrations { name: what.name, bound: bounds(&bound), truth, found: Vec::new() };
    for repeat in 0..repeats {
        let seed = seed_of(seed, what.case, repeat as u64);
        let runs = yard.runs(&driven, seed);
        let calibrated = calibrate(&runs, &vehicle, &settings)?;
        let closed = closed_form(&runs, &vehicle, &settings.noise);
        let ends = if what.judged {
            ends(yard, &driven, !seed, &calibrated, &closed)
        } else {
            Default::default()
        };
        all.found.push(found(&calibrated, &closed, &truth, ends));
        progress.step()?;
    }
    Ok(all)
}

fn bounds(bound: &Information) -> [f64; PARAMETERS] {
    core::array::from_fn(|i| if bound.free[i] { bound.bound[i] } else { f64::INFINITY })
}

fn found(
    calibrated: &Calibrated,
    closed: &ClosedForm,
    truth: &Parameters,
    ends: [[Ends; 2]; 2],
) -> Found {
    let error = |found: &Parameters| core::array::from_fn(|i| found.values[i] - truth.values[i]);
    Found {
        joint: error(&calibrated.parameters),
        deviations: core::array::from_fn(|i| calibrated.covariance[(i, i)].max(0.0).sqrt()),
        closed: error(&closed.parameters),
        inflation: calibrated.inflation,
        rejected: calibrated.rejected.len(),
        ends,
    }
}

impl Told {
    /// By a calibration in `yard`.
    pub(crate) fn by(yard: &Yard, seed: u64) -> Result<Self, ReproductionError> {
        let centre = Self::centre(yard, seed)?;
        Self::about(centre, yard, seed)
    }

    /// By each of `count` calibrations in `yard`: what one finds of how far its runs differ is itself left to chance.
    pub(crate) fn by_many(
        yard: &Yard,
        count: u64,
        seed: impl Fn(u64) -> u64,
    ) -> Result<Vec<Self>, ReproductionError> {
        let centre = Self::centre(yard, seed(0))?;
        (0..count).map(|number| Self::about(centre, yard, seed(number))).collect()
    }

    /// What a calibration finds whose sensors do not err.
    fn centre(yard: &Yard, seed: u64) -> Result<Parameters, ReproductionError> {
        let quiet = Yard { sensors: yard.sensors.clone().without_errors(), ..yard.clone() };
        Ok(Self::calibrate(&quiet, yard, seed)?.parameters)
    }

    fn about(centre: Parameters, yard: &Yard, seed: u64) -> Result<Self, ReproductionError> {
        let calibrated = Self::calibrate(yard, yard, seed)?;
        let covariance = calibrated.covariance.fixed_view::<IDENTIFIED, IDENTIFIED>(0, 0);
        let root = covariance.into_owned().cholesky().map(|cholesky| cholesky.l());
        Ok(Self {
            nominal: yard.nominal(),
            centre,
            root: root.ok_or(kerbside_calibration::CalibrationError::Diverged)?,
            prior: prior(&calibrated, yard),
        })
    }

    /// The same, the filter allowing besides for the residual errors of an ordinary calibration ([`Residuals::paper`]), as
    /// it does where a vehicle's file says nothing.
    pub(crate) fn with_allowance(mut self) -> Self {
        let deviations = deviations(&Residuals::paper());
        for (i, deviation) in deviations.into_iter().enumerate() {
            self.prior.covariance[(i, i)] += deviation * deviation;
        }
        self
    }

    /// Calibrates with the readings of `driven` and the beliefs of `believed`.
    fn calibrate(
        driven: &Yard,
        believed: &Yard,
        seed: u64,
    ) -> Result<Calibrated, ReproductionError> {
        let drives = driven.drives();
        let runs = driven.runs(&[drives[0].driven(), drives[1].driven(), drives[2].driven()], seed);
        Ok(calibrate(&runs, &believed.nominal(), &believed.settings())?)
    }

    /// What is believed by the calibration that `seed` draws; nothing else is wrong.
    pub(crate) fn trial(&self, seed: u64) -> Trial {
        let mut random = Random::new(!seed);
        let deviates = SVector::<f64, IDENTIFIED>::from_fn(|_, _| random.normal());
        let mut parameters = self.centre;
        let drawn = self.root * deviates;
        (0..IDENTIFIED).for_each(|i| parameters.values[i] += drawn[i]);
        let belief = Belief {
            vehicle: parameters.applied(&self.nominal),
            prior: self.prior.clone(),
            start: Pose::default(),
        };
        Trial { belief, steering_zero: 0.0 }
    }
}

/// The filter's parameters are relative in the radii, and have a gyro where the calibration has the steering's gain.
fn prior(calibrated: &Calibrated, yard: &Yard) -> ParameterPrior {
    let scale: [f64; BELIEVED] = core::array::from_fn(|i| match i {
        0..=3 => 1.0 / calibrated.parameters.values[i],
        8 => 0.0,
        _ => 1.0,
    });
    let mut prior = ParameterPrior::known();
    for i in 0..BELIEVED {
        for j in 0..BELIEVED {
            prior.covariance[(i, j)] = scale[i] * scale[j] * calibrated.covariance[(i, j)];
        }
        prior.covariance[(i, i)] += scale[i] * scale[i] * calibrated.between[i];
    }
    prior.wheel_noise = yard.sensors.encoders.as_ref().map(|encoders| encoders.noise);
    prior
}

/// Ends of ten straights and ten left circles that no fit has seen.
fn ends(
    yard: &Yard,
    driven: &[Driven<'_>; 3],
    seed: u64,
    calibrated: &Calibrated,
    closed: &ClosedForm,
) -> [[Ends; 2]; 2] {
    let nominal = Parameters::nominal(&yard.nominal());
    [0, 1].map(|kind: usize| {
        let mut by_axle: [Ends; 2] = Default::default();
        for i in 0..COUNT as u64 {
            let recorded = driven[kind].record(seed_of(seed, 10 + kind as u64, i));
            let truth = recorded.truth.last().map_or(Pose::default(), |state| state.pose);
            let run = yard.left_out(&recorded);
            for (front, ends) in [false, true].into_iter().zip(&mut by_axle) {
                let error = |parameters: &Parameters| miss(&run, parameters, front, &truth);
                ends.before.push(error(&nominal));
                ends.after.push(error(&calibrated.parameters));
                ends.closed.push(error(&closed.parameters));
            }
        }
        by_axle
    })
}

fn miss(run: &Run, parameters: &Parameters, front: bool, truth: &Pose) -> Pose {
    let end = reckon(run, parameters, front);
    Pose::new(end.x - truth.x, end.y - truth.y, angle::wrap(end.yaw - truth.yaw))
}
