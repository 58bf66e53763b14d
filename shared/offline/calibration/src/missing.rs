//! Which manoeuvre would identify what a set of runs leaves open: ideal drives are added to the runs' information.

use core::f64::consts::TAU;

use kerbside_geometry::{Pose, Vehicle, math};

use crate::condense::Condensed;
use crate::information::Information;
use crate::noise::Settings;
use crate::normal::Square;
use crate::parameters::{PARAMETERS, Parameter, Parameters};
use crate::run::{ReferencePose, Run, Series};
use crate::solve::{Fit, Prior, first_start};

/// Runs of each manoeuvre that are assumed.
const REPEATS: f64 = 10.0;
/// Readings per second that are assumed \[Hz\].
const RATE: f64 = 50.0;

/// A parameter that the runs do not identify, and what would.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// The parameter.
    pub parameter: Parameter,
    /// The manoeuvre or sensor that would identify it, in words.
    pub needs: String,
}

/// What one manoeuvre adds: a drive of (curvature \[1/m\], distance \[m\]), and what of it is measured.
#[derive(Clone, Copy, Debug)]
struct Drive {
    curvature: f64,
    distance: f64,
    by_tape: bool,
}

/// A manoeuvre, what it tells, and that with what the runs told.
struct Candidate {
    words: String,
    added: Square,
    with: Information,
}

impl Candidate {
    /// Whether the runs and this identify `parameter`, and its readings depend on it enough to do so if all else were
    /// known: a straight that only settles the steering's zero makes no wheelbase of a motorway's faint bends.
    fn identifies(&self, parameter: Parameter, prior: &Prior, settings: &Settings) -> bool {
        let (index, share) = (parameter.index(), settings.identified_share);
        let scale = prior.scale[index];
        let own = self.added[(index, index)] * scale * scale;
        self.with.identified[index] && own * share * share >= 1.0
    }
}

/// Names what each parameter that `information` leaves open needs; `like` says which sensors there are.
pub(crate) fn missing(
    information: &Information,
    prior: &Prior,
    like: &Condensed,
    vehicle: &Vehicle,
    parameters: &Parameters,
    settings: &Settings,
) -> Vec<Missing> {
    let open = |parameter: &Parameter| {
        let index = parameter.index();
        information.free[index] && !information.identified[index]
    };
    let open: Vec<Parameter> = PARAMETERS.into_iter().filter(open).collect();
    let mut found: Vec<Missing> = absent(information, like, vehicle);
    if open.is_empty() {
        return found;
    }
    let garage = Garage { prior, like, vehicle, parameters, settings };
    let candidates: Vec<Candidate> = manoeuvres(vehicle, parameters)
        .into_iter()
        .filter_map(|(words, drives)| {
            let added: Option<Vec<Square>> =
                drives.iter().map(|drive| garage.information(drive)).collect();
            let added = added?.iter().sum::<Square>() * REPEATS;
            let with = Information::new(information.matrix + added, prior, settings);
            Some(Candidate { words, added, with })
        })
        .collect();
    for parameter in open {
        let helps = |candidate: &&Candidate| candidate.identifies(parameter, prior, settings);
        let needs = candidates.iter().find(helps);
        let needs = needs
            .map_or_else(|| without_cure(like).to_owned(), |candidate| candidate.words.clone());
        found.push(Missing { parameter, needs });
    }
    found
}

fn without_cure(like: &Condensed) -> &'static str {
    if like.steered {
        "a finer reference: no straight or circle identifies it with this one"
    } else {
        "a steering sensor: no straight or circle identifies it without one"
    }
}

/// Parameters that the sensors do not involve at all although the vehicle has them.
fn absent(information: &Information, like: &Condensed, vehicle: &Vehicle) -> Vec<Missing> {
    let needs = |parameter: Parameter| match parameter {
        Parameter::RadiusFrontLeft
        | Parameter::RadiusFrontRight
        | Parameter::RadiusRearLeft
        | Parameter::RadiusRearRight => "an encoder on that wheel",
        Parameter::TrackFront => "encoders on the front wheels",
        Parameter::TrackRear => "encoders on both rear wheels",
        Parameter::SteeringGain => "to be asked for, and circles of at least two radii",
        Parameter::Wheelbase | Parameter::SteeringZero => "a steering sensor",
        Parameter::MarkerX | Parameter::MarkerY | Parameter::MarkerYaw => {
            "to be asked for, and a reference on curves to both sides"
        }
    };
    let has = |parameter: &Parameter| match parameter {
        // A wheel that is not counted may not be there at all.
        Parameter::RadiusFrontRight => vehicle.track_front > 0.0,
        Parameter::RadiusRearRight => vehicle.track_rear > 0.0,
        Parameter::TrackFront => vehicle.track_front > 0.0,
        Parameter::TrackRear => vehicle.track_rear > 0.0,
        Parameter::SteeringGain
        | Parameter::MarkerX
        | Parameter::MarkerY
        | Parameter::MarkerYaw => false,
        Parameter::SteeringZero => vehicle.steering_sensor.is_some() || like.steered,
        _ => true,
    };
    PARAMETERS
        .into_iter()
        .filter(|parameter| !information.free[parameter.index()] && has(parameter))
        .map(|parameter| Missing { parameter, needs: needs(parameter).to_owned() })
        .collect()
}

/// Manoeuvres in the order of the trouble they make.
fn manoeuvres(vehicle: &Vehicle, parameters: &Parameters) -> Vec<(String, Vec<Drive>)> {
    let base = parameters.get(Parameter::Wheelbase);
    let tightest = base / math::tan(0.8 * vehicle.limits.steering).max(1e-3);
    let radius = tightest.max(3.0 * base);
    let length = 10.0 * base;
    let straight = |by_tape| Drive { curvature: 0.0, distance: length, by_tape };
    let circle = |radius: f64, turns: f64| Drive {
        curvature: 1.0 / radius,
        distance: turns * TAU * radius.abs(),
        by_tape: false,
    };
    let both = vec![circle(radius, 1.0), circle(-radius, 1.0)];
    let with_straight: Vec<Drive> = both.iter().copied().chain([straight(false)]).collect();
    let two_radii = with_straight.iter().copied();
    let two_radii =
        two_radii.chain([circle(2.0 * radius, 1.0), circle(-2.0 * radius, 1.0)]).collect();
    let poses = "with start and end pose measured";
    vec![
        (
            format!("straight runs of {length:.1} m with their distance measured"),
            vec![straight(true)],
        ),
        (format!("straight runs of {length:.1} m {poses}"), vec![straight(false)]),
        (format!("full circles of {radius:.1} m radius to one side {poses}"), vec![both[0]]),
        (format!("full circles of {radius:.1} m radius to both sides {poses}"), both),
        (
            format!(
                "straight runs of {length:.1} m and full circles of {radius:.1} m radius to both sides {poses}"
            ),
            with_straight,
        ),
        (
            format!(
                "straight runs of {length:.1} m and full circles of {radius:.1} m and {:.1} m radius to both sides \
                 {poses}",
                2.0 * radius
            ),
            two_radii,
        ),
    ]
}

/// All that an ideal drive depends on.
struct Garage<'a> {
    prior: &'a Prior,
    like: &'a Condensed,
    vehicle: &'a Vehicle,
    parameters: &'a Parameters,
    settings: &'a Settings,
}

impl Garage<'_> {
    fn information(&self, drive: &Drive) -> Option<Square> {
        let run = self.run(drive);
        let run = Condensed::new(&run, self.vehicle, self.settings).ok()?;
        let start = first_start(&run, self.parameters, self.settings);
        let fit = Fit::at(
            &[&run],
            *self.parameters,
            vec![start],
            self.prior,
            self.settings,
            f64::INFINITY,
        )?;
        Some(fit.information())
    }

    /// The drive as sensors without noise would see it.
    fn run(&self, drive: &Drive) -> Run {
        let p = &self.parameters.values;
        let step = 0.5 * self.vehicle.limits.speed / RATE;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands
        let count = (drive.distance / step).ceil().max(2.0) as u32;
        let t: Vec<f64> = (0..=count).map(|index| f64::from(index) / RATE).collect();
        let end = t[t.len() - 1];
        let turn = drive.curvature * drive.distance;
        let rotation = core::array::from_fn(|wheel| {
            let half = [0.5 * p[4], -0.5 * p[4], 0.5 * p[5], -0.5 * p[5]][wheel];
            let across = if wheel < 2 { p[6] * turn } else { 0.0 };
            let travel = math::hypot(drive.distance - half * turn, across);
            let value = t.iter().map(|t| travel / p[wheel] * t / end).collect();
            self.like.wheels[wheel].then(|| Series { t: t.clone(), value })
        });
        let angle = math::atan(p[6] * drive.curvature) * p[8] + p[7];
        let steering = Series { t: t.clone(), value: vec![angle; t.len()] };
        let marker = self.parameters.marker();
        let seen = |t: f64, body: Pose| {
            let marker = body.compose(&marker);
            ReferencePose { t, x: marker.x, y: marker.y, yaw: Some(marker.yaw) }
        };
        let last = Pose::default().advance(drive.distance, turn);
        let reference = vec![seen(0.0, Pose::default()), seen(end, last)];
        Run {
            name: "ideal".to_owned(),
            rotation,
            steering: self.like.steered.then_some(steering),
            reference: if drive.by_tape { Vec::new() } else { reference },
            distance: drive.by_tape.then_some(drive.distance),
            ..Run::default()
        }
    }
}
