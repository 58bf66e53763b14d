//! What either method finds, in one form.

use kerbside_calibration::{
    COUNT, Calibrated, CalibrationError, ClosedForm, Derived, Finding, GyroBias, PARAMETERS,
    Parameter, Parameters, Rejected, Run, RunResiduals, Settings, Square, SteeringCheck, Vector,
    calibrate, check_steering, closed_form, diagnose_runs, fold_of, information,
};
use kerbside_geometry::Vehicle;
use kerbside_settings::CALIBRATED;

use super::Method;
use crate::exit::{Exit, Failure};

/// A parameter, and what was found of it; each in its unit.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// Which.
    pub parameter: Parameter,
    /// As the vehicle's file states it.
    pub nominal: f64,
    /// As found; what is not identified is nominal or near it.
    pub value: f64,
    /// Standard deviation and 95 % interval; none where the method gives none.
    pub spread: Option<(f64, [f64; 2])>,
    /// Whether the runs identify it.
    pub identified: bool,
    /// What the closed form finds; none where it does not identify it.
    pub closed_form: Option<f64>,
}

/// What is missing for a parameter.
#[derive(Clone, Debug)]
pub struct Missing {
    /// Which.
    pub parameter: Parameter,
    /// Manoeuvre or sensor that would identify it.
    pub manoeuvre: String,
}

/// What a method found.
#[derive(Debug)]
pub struct Found {
    /// What is written down: those that were identified; the others stay as the vehicle's file has them.
    pub parameters: Parameters,
    /// Those that the sensors involve.
    pub estimates: Vec<Estimate>,
    /// Of all parameters; none where the method gives none.
    pub covariance: Option<Square>,
    /// Variances of all parameters from drive to drive, beyond the readings' noise; 0 where there is nothing beyond.
    pub between: Vector,
    /// What the gyro reads at rest; none where it does not tell of the turn.
    pub gyro_bias: Option<GyroBias>,
    /// Runs that the parameters come from.
    pub runs: Vec<String>,
    /// Runs that were rejected.
    pub rejected: Vec<Rejected>,
    /// What else was found in the runs.
    pub findings: Vec<Finding>,
    /// What is missing.
    pub missing: Vec<Missing>,
    /// Residuals per run.
    pub residuals: Vec<RunResiduals>,
    /// Factor on the variances; 1 where residuals are as believed.
    pub inflation: f64,
    /// Differences and ratios.
    pub derived: Vec<Derived>,
    /// The steering sensor against the front wheels.
    pub steering: Option<SteeringCheck>,
}

/// The key of vehicle.toml that holds a parameter.
pub fn key(parameter: Parameter) -> &'static str {
    CALIBRATED.get(parameter.index()).copied().unwrap_or(parameter.name())
}

/// Fits `runs` by `method`.
///
/// # Errors
/// [`Failure`] naming runs and evidence where none is left, or the fit fails.
pub fn fit(
    method: Method,
    runs: &[Run],
    vehicle: &Vehicle,
    settings: &Settings,
) -> Result<Found, Failure> {
    match method {
        Method::Joint => match calibrate(runs, vehicle, settings) {
            Ok(found) => Ok(joint(found, vehicle)),
            Err(error) => Err(refusal(&error, runs, vehicle, settings)),
        },
        Method::ClosedForm => closed(runs, vehicle, settings),
    }
}

fn by_closed_form(form: &ClosedForm, parameter: Parameter) -> Option<f64> {
    form.identified[parameter.index()].then(|| form.parameters.get(parameter))
}

fn joint(found: Calibrated, vehicle: &Vehicle) -> Found {
    let estimate = |e: &kerbside_calibration::Estimate| Estimate {
        parameter: e.parameter,
        nominal: e.nominal,
        value: e.value,
        spread: Some((e.deviation, [e.low, e.high])),
        identified: e.identified,
        closed_form: by_closed_form(&found.closed_form, e.parameter),
    };
    let missing = |m: &kerbside_calibration::Missing| Missing {
        parameter: m.parameter,
        manoeuvre: m.needs.clone(),
    };
    let mut parameters = Parameters::nominal(vehicle);
    for found in found.estimates.iter().filter(|found| found.identified) {
        parameters.set(found.parameter, found.value);
    }
    Found {
        parameters,
        estimates: found.estimates.iter().map(estimate).collect(),
        covariance: Some(found.covariance),
        between: found.between,
        gyro_bias: found.gyro_bias,
        runs: found.residuals.iter().map(|run| run.run.clone()).collect(),
        missing: found.missing.iter().map(missing).collect(),
        rejected: found.rejected,
        findings: found.findings,
        residuals: found.residuals,
        inflation: found.inflation,
        derived: found.derived,
        steering: found.steering,
    }
}

fn closed(runs: &[Run], vehicle: &Vehicle, settings: &Settings) -> Result<Found, Failure> {
    let findings = diagnose_runs(runs, vehicle, &settings.noise);
    let against = |run: &Run| forbidding(&findings, &run.name);
    let (kept, bad): (Vec<&Run>, Vec<&Run>) = runs.iter().partition(|run| against(run).is_empty());
    let kept: Vec<Run> = kept.into_iter().cloned().collect();
    if kept.is_empty() {
        return Err(refusal(&CalibrationError::NoRuns, runs, vehicle, settings));
    }
    let form = closed_form(&kept, vehicle, &settings.noise);
    let mut rejected: Vec<Rejected> = bad
        .into_iter()
        .map(|run| Rejected { run: run.name.clone(), why: against(run).join("; ") })
        .collect();
    rejected.extend(form.refused.iter().cloned());
    let used: Vec<String> = form.straights.iter().chain(&form.arcs).cloned().collect();
    let unused = kept.iter().filter(|run| {
        !used.contains(&run.name) && rejected.iter().all(|rejected| rejected.run != run.name)
    });
    let why = "neither a straight of known length nor an arc of known turn: \
               the closed form takes no other runs";
    let unused: Vec<Rejected> =
        unused.map(|run| Rejected { run: run.name.clone(), why: why.to_owned() }).collect();
    rejected.extend(unused);
    let counting: Vec<&Run> = kept.iter().collect();
    Ok(Found {
        parameters: form.parameters,
        estimates: closed_estimates(&form, vehicle, &kept),
        covariance: None,
        between: Vector::zeros(),
        gyro_bias: None,
        runs: used,
        rejected,
        findings,
        missing: closed_missing(&form, vehicle, &kept),
        residuals: Vec::new(),
        inflation: 1.0,
        derived: Vec::new(),
        steering: check_steering(&counting, &form.parameters),
    })
}

/// Parameters that the closed form could identify with these sensors.
fn closed_free(vehicle: &Vehicle, runs: &[Run]) -> [bool; COUNT] {
    let has = |wheel: usize| runs.iter().any(|run| run.wheels()[wheel]);
    let pair = |left: usize, track: f64| has(left) && has(left + 1) && track > 0.0;
    let steered = runs.iter().any(|run| run.steering.is_some());
    PARAMETERS.map(|parameter| match parameter {
        Parameter::TrackFront => pair(0, vehicle.track_front) && steered,
        Parameter::TrackRear => pair(2, vehicle.track_rear),
        Parameter::Wheelbase
        | Parameter::SteeringZero
        | Parameter::SteeringGain
        | Parameter::MarkerX
        | Parameter::MarkerY
        | Parameter::MarkerYaw => false,
        radius => has(radius.index()),
    })
}

fn closed_estimates(form: &ClosedForm, vehicle: &Vehicle, runs: &[Run]) -> Vec<Estimate> {
    let (nominal, free) = (Parameters::nominal(vehicle), closed_free(vehicle, runs));
    let involved = PARAMETERS.into_iter().filter(|parameter| free[parameter.index()]);
    let estimate = |parameter: Parameter| Estimate {
        parameter,
        nominal: nominal.get(parameter),
        value: form.parameters.get(parameter),
        spread: None,
        identified: form.identified[parameter.index()],
        closed_form: by_closed_form(form, parameter),
    };
    involved.map(estimate).collect()
}

fn closed_missing(form: &ClosedForm, vehicle: &Vehicle, runs: &[Run]) -> Vec<Missing> {
    let free = closed_free(vehicle, runs);
    let steered = runs.iter().any(|run| run.steering.is_some());
    let needs = |parameter: Parameter| match parameter {
        Parameter::Wheelbase | Parameter::SteeringZero => {
            "the joint method: the closed form takes it as it is"
        }
        Parameter::TrackFront | Parameter::TrackRear => {
            "straight runs with their distance, and full circles with their end heading measured"
        }
        _ => "straight runs with their distance measured",
    };
    let open = |parameter: &Parameter| match parameter {
        Parameter::Wheelbase | Parameter::SteeringZero => steered,
        other => free[other.index()] && !form.identified[other.index()],
    };
    let open = PARAMETERS.into_iter().filter(open);
    open.map(|parameter| Missing { parameter, manoeuvre: needs(parameter).to_owned() }).collect()
}

/// A part of the runs, and what a fit of the others found.
pub struct Fold<'a> {
    /// By the others.
    pub found: Found,
    /// The part.
    pub out: Vec<&'a Run>,
}

/// Every run of `fitted` once in a part that is left out of a fit of the others, in as many parts as `settings` say;
/// empty where they are too few.
pub fn folds<'a>(
    method: Method,
    fitted: &[&'a Run],
    vehicle: &Vehicle,
    settings: &Settings,
) -> Vec<Fold<'a>> {
    let count = settings.folds.min(fitted.len());
    let manoeuvres: Vec<String> = fitted.iter().map(|run| run.manoeuvre.clone()).collect();
    let fold = fold_of(&manoeuvres, count);
    // The parts are judged by what would be written down.
    let alone = Settings { folds: 0, ..*settings };
    let mut folds = Vec::new();
    for part in 0..if count < 2 { 0 } else { count } {
        let rest = (0..fitted.len()).filter(|index| fold[*index] != part);
        let rest: Vec<Run> = rest.map(|index| fitted[index].clone()).collect();
        let Ok(found) = fit(method, &rest, vehicle, &alone) else { continue };
        let out = (0..fitted.len()).filter(|index| fold[*index] == part);
        folds.push(Fold { found, out: out.map(|index| fitted[index]).collect() });
    }
    folds
}

/// What forbids the run called `name`, with the evidence.
pub fn forbidding(findings: &[Finding], name: &str) -> Vec<String> {
    let of_it = findings.iter().filter(|found| found.forbids && found.run.as_deref() == Some(name));
    of_it.map(ToString::to_string).collect()
}

/// Nothing can be fitted: every run with what was found in it.
fn refusal(
    error: &CalibrationError,
    runs: &[Run],
    vehicle: &Vehicle,
    settings: &Settings,
) -> Failure {
    if let CalibrationError::Unusable { .. } = error {
        return Failure::new(Exit::Data, error.to_string());
    }
    let findings = diagnose_runs(runs, vehicle, &settings.noise);
    let nominal = Parameters::nominal(vehicle);
    let why = |run: &Run| {
        let against = forbidding(&findings, &run.name);
        if !against.is_empty() {
            return Some(format!("run {}: {}", run.name, against.join("; ")));
        }
        let alone = core::slice::from_ref(run);
        information(alone, vehicle, &nominal, settings).err().map(|error| error.to_string())
    };
    let reasons: Vec<String> = runs.iter().filter_map(why).collect();
    let told = if reasons.len() == runs.len() {
        format!("no run can be used:\n{}", reasons.join("\n"))
    } else {
        core::iter::once(error.to_string()).chain(reasons).collect::<Vec<_>>().join("\n")
    };
    Failure::new(Exit::Data, told)
}
