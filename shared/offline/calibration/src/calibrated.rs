//! A calibration and all that a report needs of it.

use kerbside_geometry::{Gyro, Vehicle, math};

use crate::closed_form::{ClosedForm, closed_form};
use crate::condense::Condensed;
use crate::diagnose::{Finding, diagnose_runs};
use crate::error::CalibrationError;
use crate::gyro::GyroBias;
use crate::information::{Information, prior};
use crate::joint::{JointFit, Rejected, RunResiduals, joint_fit};
use crate::left_out::{LeftOut, left_out};
use crate::missing::{Missing, missing};
use crate::noise::Settings;
use crate::normal::Square;
use crate::parameters::{PARAMETERS, Parameter, Parameters, Vector};
use crate::run::Run;
use crate::steering_check::{SteeringCheck, check_steering};

/// Deviations of a 95 % interval.
const INTERVAL: f64 = 1.959_964;

/// An identified parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The parameter.
    pub parameter: Parameter,
    /// Its value, in the parameter's unit; that of the nominal vehicle, or near it, where not identified.
    pub value: f64,
    /// Standard deviation.
    pub deviation: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of it.
    pub high: f64,
    /// Whether the runs identify it; if not, the interval is the weak prior's and says nothing.
    pub identified: bool,
    /// The nominal value.
    pub nominal: f64,
}

/// A quantity computed from parameters, which may be identified where they are not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derived {
    /// Name.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Standard deviation by the runs alone; huge where they do not tell.
    pub deviation: f64,
    /// Unit.
    pub unit: &'static str,
}

/// A calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibrated {
    /// The nominal vehicle with radii, tracks and wheelbase replaced by what was identified.
    pub vehicle: Vehicle,
    /// All parameters.
    pub parameters: Parameters,
    /// Per parameter that the sensors involve, in the order of [`PARAMETERS`].
    pub estimates: Vec<Estimate>,
    /// Covariance, in the order of [`PARAMETERS`]; 0 for what the sensors do not involve.
    pub covariance: Square,
    /// Variances of the parameters from drive to drive, beyond what the readings' noise explains; 0 where there is nothing
    /// beyond. The next drive's parameters scatter about these by both.
    pub between: Vector,
    /// What the gyro reads at rest; none where it does not tell of the turn.
    pub gyro_bias: Option<GyroBias>,
    /// What the runs told, priors excluded.
    pub information: Information,
    /// Epsilons (the paper's, left minus right) and ratios.
    pub derived: Vec<Derived>,
    /// Factor by which the variances were widened, as residuals were larger than believed; 1 where not.
    pub inflation: f64,
    /// Mean square of the residuals of known poses, distances and turns (1 is as believed).
    pub truth_mean_square: f64,
    /// Mean square of what front wheels, rear wheels and steering disagree on (1 is as believed).
    pub comparison_mean_square: f64,
    /// Residuals less unknowns.
    pub freedom: usize,
    /// Residuals per run that counts.
    pub residuals: Vec<RunResiduals>,
    /// Runs that do not count, and why.
    pub rejected: Vec<Rejected>,
    /// What was found in the runs besides.
    pub findings: Vec<Finding>,
    /// Parameters that are not identified, and what would identify them.
    pub missing: Vec<Missing>,
    /// End errors of runs left out, before and after.
    pub left_out: Vec<LeftOut>,
    /// The steering sensor against the front wheels.
    pub steering: Option<SteeringCheck>,
    /// The paper's closed form beside it.
    pub closed_form: ClosedForm,
}

/// Calibrates `vehicle` by the joint method from all of `runs`.
///
/// Runs with findings that forbid their use are left out and named; the fit starts from the closed form.
///
/// # Errors
/// [`CalibrationError::NoRuns`] where there is none, [`CalibrationError::Unusable`] with every run's reason where none can
/// be used, and [`CalibrationError::Diverged`].
pub fn calibrate(
    runs: &[Run],
    vehicle: &Vehicle,
    settings: &Settings,
) -> Result<Calibrated, CalibrationError> {
    let findings = diagnose_runs(runs, vehicle, &settings.noise);
    let (kept, condensed, mut rejected) = sift(runs, &findings, vehicle, settings)?;
    let good: Vec<Run> = kept.iter().map(|run| (*run).clone()).collect();
    let form = closed_form(&good, vehicle, &settings.noise);
    let all: Vec<&Condensed> = condensed.iter().collect();
    let fit = joint_fit(&all, vehicle, &form.parameters, settings)?;
    rejected.extend(fit.rejected.iter().cloned());
    let counts = |run: &Condensed| fit.rejected.iter().all(|out| out.run != run.name);
    let counting: Vec<usize> = (0..all.len()).filter(|index| counts(all[*index])).collect();
    let fitted: Vec<&Condensed> = counting.iter().map(|index| all[*index]).collect();
    let manoeuvres: Vec<String> =
        counting.iter().map(|index| kept[*index].manoeuvre.clone()).collect();
    let prior = prior(&fitted, vehicle, settings);
    let p = &fit.parameters;
    let counted: Vec<&Run> = counting.iter().map(|index| kept[*index]).collect();
    Ok(Calibrated {
        vehicle: with_bias(p.applied(vehicle), fit.gyro_bias),
        parameters: *p,
        estimates: estimates(&fit, vehicle),
        covariance: fit.covariance,
        between: fit.between,
        gyro_bias: fit.gyro_bias,
        derived: derived(&fit, &prior.scale),
        inflation: fit.inflation,
        truth_mean_square: fit.truth,
        comparison_mean_square: fit.comparison,
        freedom: fit.freedom,
        missing: fitted.first().map_or_else(Vec::new, |like| {
            missing(&fit.information, &prior, like, vehicle, p, settings)
        }),
        left_out: left_out(&fitted, &manoeuvres, vehicle, p, settings)?,
        steering: check_steering(&counted, p),
        closed_form: form,
        information: fit.information,
        residuals: fit.residuals,
        rejected,
        findings,
    })
}

/// `vehicle` with what its gyro was found to read at rest.
fn with_bias(vehicle: Vehicle, found: Option<GyroBias>) -> Vehicle {
    let bias = |gyro: Gyro| Gyro { bias: found.map_or(gyro.bias, |found| found.value), ..gyro };
    Vehicle { gyro: vehicle.gyro.map(bias), ..vehicle }
}

/// The runs that can be used, condensed; and those that cannot, with why.
type Sifted<'a> = (Vec<&'a Run>, Vec<Condensed>, Vec<Rejected>);

fn sift<'a>(
    runs: &'a [Run],
    findings: &[Finding],
    vehicle: &Vehicle,
    settings: &Settings,
) -> Result<Sifted<'a>, CalibrationError> {
    let (mut kept, mut condensed, mut rejected) = (Vec::new(), Vec::new(), Vec::new());
    for run in runs {
        let against: Vec<String> = findings
            .iter()
            .filter(|finding| finding.forbids && finding.run.as_ref() == Some(&run.name))
            .map(|finding| finding.to_string())
            .collect();
        if !against.is_empty() {
            rejected.push(Rejected { run: run.name.clone(), why: against.join("; ") });
            continue;
        }
        match Condensed::new(run, vehicle, settings) {
            Ok(ready) => {
                kept.push(run);
                condensed.push(ready);
            }
            Err(error) => {
                rejected.push(Rejected { run: run.name.clone(), why: error.to_string() });
            }
        }
    }
    if kept.is_empty() {
        let reason = |out: &Rejected| match out.why.strip_prefix("run ") {
            Some(_) => out.why.clone(),
            None => format!("run {}: {}", out.run, out.why),
        };
        let reasons: Vec<String> = rejected.iter().map(reason).collect();
        return Err(match reasons.is_empty() {
            true => CalibrationError::NoRuns,
            false => CalibrationError::Unusable { reasons },
        });
    }
    Ok((kept, condensed, rejected))
}

fn estimates(fit: &JointFit, vehicle: &Vehicle) -> Vec<Estimate> {
    let (deviations, nominal) = (fit.deviations(), Parameters::nominal(vehicle));
    let involved =
        PARAMETERS.into_iter().filter(|parameter| fit.information.free[parameter.index()]);
    involved
        .map(|parameter| {
            let (value, deviation) = (fit.parameters.get(parameter), deviations[parameter.index()]);
            Estimate {
                parameter,
                value,
                deviation,
                low: value - INTERVAL * deviation,
                high: value + INTERVAL * deviation,
                identified: fit.information.identified[parameter.index()],
                nominal: nominal.get(parameter),
            }
        })
        .collect()
}

/// Differences and ratios with deviations by the runs alone (first order).
fn derived(fit: &JointFit, scale: &Vector) -> Vec<Derived> {
    let p = &fit.parameters.values;
    let free = &fit.information.free;
    let Some(covariance) = fit.information.covariance(scale) else { return Vec::new() };
    let covariance = covariance * fit.inflation;
    let deviation = |gradient: &Vector| root(gradient.dot(&(covariance * gradient)));
    let mut list = Vec::new();
    for (name, left) in [("epsilon front", 0), ("epsilon rear", 2)] {
        if free[left] && free[left + 1] {
            let mut gradient = Vector::zeros();
            (gradient[left], gradient[left + 1]) = (1.0, -1.0);
            let value = p[left] - p[left + 1];
            list.push(Derived { name, value, deviation: deviation(&gradient), unit: "m" });
        }
    }
    let ratios = [
        ("radius fl / fr", 0, 1),
        ("radius rl / rr", 2, 3),
        ("track front / radius fl", 4, 0),
        ("track rear / radius rl", 5, 2),
        ("wheelbase / radius rl", 6, 2),
        ("track front / track rear", 4, 5),
    ];
    for (name, above, below) in ratios {
        if free[above] && free[below] {
            let value = p[above] / p[below];
            let mut gradient = Vector::zeros();
            (gradient[above], gradient[below]) = (1.0 / p[below], -value / p[below]);
            list.push(Derived { name, value, deviation: deviation(&gradient), unit: "-" });
        }
    }
    list
}

fn root(variance: f64) -> f64 {
    variance.max(0.0).sqrt()
}

impl Calibrated {
    /// The estimate of one parameter; none where the sensors do not involve it.
    #[must_use]
    pub fn estimate(&self, parameter: Parameter) -> Option<&Estimate> {
        self.estimates.iter().find(|estimate| estimate.parameter == parameter)
    }

    /// Root mean square over the left-out runs of the end error's distance before and after \[m\], by one source;
    /// none where there are no such runs.
    #[must_use]
    pub fn left_out_distance(&self, source: crate::path::Source) -> Option<(f64, f64)> {
        let rows: Vec<&LeftOut> = self.left_out.iter().filter(|row| row.source == source).collect();
        #[allow(clippy::cast_precision_loss)] // runs
        let count = rows.len() as f64;
        let rms = |of: fn(&LeftOut) -> f64| {
            let sum: f64 = rows.iter().map(|row| of(row) * of(row)).sum();
            root(sum / count)
        };
        let before = rms(|row| math::hypot(row.before.x, row.before.y));
        let after = rms(|row| math::hypot(row.after.x, row.after.y));
        (count > 0.0).then_some((before, after))
    }
}
