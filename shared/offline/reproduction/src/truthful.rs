//! Row 7 beyond the S path: is the covariance the truth, whatever is driven and whatever fails?

use kerbside_geometry::Wheel;
use kerbside_proving_ground::{
    EncoderFault, Failure, Leg, Manoeuvre, Pace, Physics, Section, Sensors,
};

use crate::belief::{Knowledge, trial};
use crate::calibrations::{Circumstances, Told};
use crate::ends::SPEEDS;
use crate::error::ReproductionError;
use crate::figure::{Accept, Figure};
use crate::follower::Contender;
use crate::progress::Progress;
use crate::random::seed_of;
use crate::scatter::{Course, Spread, drive, scatter};
use crate::statistics::{mean, mean_between, quantile};

/// Distances of the growth table \[m\].
pub const LENGTHS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Who is in it.
const CONTENDERS: [Contender; 3] = [Contender::PaperOwn, Contender::Paper, Contender::Fused];
/// Strengths of the physics that are driven.
pub const STRENGTHS: [f64; 4] = [0.0, 0.25, 0.5, 1.0];
/// Calibrations that the filter is told of, in turn, at each strength.
const CALIBRATIONS: u64 = 8;
/// An encoder fails after so much time \[s\].
const FAILS: f64 = 8.0;

/// NEES over the distance on one kind of path, with residual errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Growth {
    /// What is driven, for people.
    pub name: &'static str,
    /// Per contender: paper (i), paper (ii), fused; stations are [`LENGTHS`].
    pub spreads: Vec<Spread>,
}

/// NEES of the fused filter under other circumstances, on the S path.
#[derive(Clone, Debug, PartialEq)]
pub struct Circumstance {
    /// What is the matter, for people.
    pub name: String,
    /// Errors of rear and fused.
    pub spreads: Vec<Spread>,
    /// Strength of the physics; 0 is the kinematic limit.
    pub strength: f64,
    /// What is accepted of NEES over 3.
    pub accept: Accept,
}

impl Growth {
    /// Mean NEES over 3 of a contender per station of [`LENGTHS`], with its interval.
    #[must_use]
    pub fn nees(&self, contender: Contender) -> Vec<(f64, (f64, f64))> {
        let spread = self.spreads.iter().find(|spread| spread.contender == contender);
        let of = |nees: &Vec<f64>| {
            let (mean, (low, high)) = mean_between(nees, 9);
            (mean / 3.0, (low / 3.0, high / 3.0))
        };
        // The last station is the end, which is the fourth one.
        spread.map_or(Vec::new(), |spread| {
            let last = spread.nees.len() - 1;
            spread.nees[..last - 1].iter().chain(&spread.nees[last..]).map(of).collect()
        })
    }

    fn figures(&self) -> Vec<Figure> {
        let mut figures = Vec::new();
        for (contender, accept) in [
            (Contender::Fused, Accept::Within(0.85, 1.15)),
            (Contender::PaperOwn, Accept::Shown),
            (Contender::Paper, Accept::Shown),
        ] {
            for (length, (ours, interval)) in LENGTHS.into_iter().zip(self.nees(contender)) {
                let name = format!("{} NEES/3, {length} m {}", contender.name(), self.name);
                figures.push(Figure::new(7, name, "", ours, accept).between(interval));
            }
        }
        figures
    }
}

impl Circumstance {
    /// Errors of a contender.
    #[must_use]
    pub fn of(&self, contender: Contender) -> Option<&Spread> {
        self.spreads.iter().find(|spread| spread.contender == contender)
    }

    /// Mean over the drives of what the sensors disagree on; 1 where they err as believed.
    #[must_use]
    pub fn disagreement(&self) -> f64 {
        self.of(Contender::Fused).map_or(f64::NAN, |s| mean(s.disagreement.iter().copied()))
    }

    fn figure(&self) -> Option<Figure> {
        let fused = self.of(Contender::Fused)?;
        let (mean, (low, high)) = mean_between(fused.end_nees(), 10);
        let name = format!("fused NEES/3, {}", self.name);
        Some(Figure::new(7, name, "", mean / 3.0, self.accept).between((low / 3.0, high / 3.0)))
    }
}

/// Growth of the NEES forward, in reverse and on a circle.
pub(crate) fn growth(
    trials: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Vec<Growth>, ReproductionError> {
    let length = LENGTHS[LENGTHS.len() - 1];
    let circle = Section { length, curvature: 1.0 / 1.5 };
    let straight = Section::straight(length);
    let kinds = [
        ("straight", true, straight, 0.26),
        ("straight in reverse", false, straight, 0.26),
        ("straight at 0.5 m/s", true, straight, 0.5),
        ("circle", true, circle, 0.26),
        ("circle in reverse, slow", false, circle, 0.09),
    ];
    let sensors = Sensors::paper(1.0);
    let mut rows = Vec::new();
    for (number, (name, forward, section, speed)) in kinds.into_iter().enumerate() {
        let leg = Leg::new(forward, &[section], 0.0);
        let manoeuvre = Manoeuvre::path(vec![leg], Pace::paper(speed));
        let test = drive(Physics::NEUTRAL, &sensors, manoeuvre);
        let course = Course {
            driven: &test.driven(),
            sensors: &sensors,
            slips: &[],
            stations: &LENGTHS,
            seed: (seed, 400 + number as u64),
            trials,
        };
        let trial_of = |seed: u64| trial(Knowledge::Residual, &sensors, seed);
        rows.push(Growth { name, spreads: scatter(&course, &CONTENDERS, &trial_of, progress)? });
    }
    Ok(rows)
}

/// How many kinds of path [`growth`] drives.
pub(crate) const KINDS: usize = 5;
/// How many circumstances [`circumstances`] drives.
pub(crate) const CIRCUMSTANCES: usize = 6 + SPEEDS.len() * STRENGTHS.len();

/// Sensors of which one encoder fails.
fn failing(wheel: Wheel, failure: Failure) -> Sensors {
    let mut sensors = Sensors::paper(1.0);
    if let Some(encoders) = &mut sensors.encoders {
        encoders.faults.push(EncoderFault { wheel, failure, begin: FAILS, end: f64::INFINITY });
    }
    sensors
}

/// Dead encoders, common errors.
fn failures(
    trials: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Vec<Circumstance>, ReproductionError> {
    let clean = || Sensors::paper(1.0);
    let kinds = [
        ("common error of all radii", clean(), Knowledge::Common),
        ("encoder rl silent", failing(Wheel::RearLeft, Failure::Missing), Knowledge::Residual),
        ("encoder fr silent", failing(Wheel::FrontRight, Failure::Missing), Knowledge::Residual),
        ("encoder rl stuck", failing(Wheel::RearLeft, Failure::Stuck), Knowledge::Residual),
        ("encoder fr stuck", failing(Wheel::FrontRight, Failure::Stuck), Knowledge::Residual),
    ];
    let mut rows = Vec::new();
    for (number, (name, sensors, knowledge)) in kinds.into_iter().enumerate() {
        let manoeuvre = Manoeuvre::s_path(Pace::paper(SPEEDS[1]));
        let test = drive(Physics::NEUTRAL, &sensors, manoeuvre);
        let course = Course {
            driven: &test.driven(),
            sensors: &sensors,
            slips: &[],
            stations: &[],
            seed: (seed, 500 + number as u64),
            trials,
        };
        let trial_of = |seed: u64| trial(knowledge, &sensors, seed);
        let pair = [Contender::Rear, Contender::Fused];
        rows.push(Circumstance {
            name: name.to_owned(),
            spreads: scatter(&course, &pair, &trial_of, progress)?,
            strength: 0.0,
            accept: Accept::Within(0.85, 1.15),
        });
    }
    Ok(rows)
}

/// What the covariance is worth when an encoder dies, when errors are common, and when filter and calibration meet a
/// car with physics. The calibrations that are met are those of each strength.
pub(crate) fn circumstances(
    trials: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Vec<Circumstance>, ReproductionError> {
    let mut rows = failures(trials, seed, progress)?;
    let mut allowed = None;
    for (number, strength) in STRENGTHS.into_iter().enumerate() {
        let case = 600 + number as u64;
        let yard = Circumstances::physical(strength, case).yard;
        let told = Told::by_many(&yard, CALIBRATIONS, |number| seed_of(seed, case, number))?;
        for speed in SPEEDS {
            let asked = (trials, seed);
            rows.push(with_physics(strength, speed, &told, asked, progress)?);
        }
        if strength >= 1.0 {
            let told: Vec<Told> = told.into_iter().map(Told::with_allowance).collect();
            let mut row = with_physics(strength, SPEEDS[0], &told, (trials, seed), progress)?;
            row.name.push_str(", ordinary allowance");
            row.accept = Accept::Shown;
            allowed = Some(row);
        }
    }
    excuse(&mut rows);
    rows.extend(allowed);
    Ok(rows)
}

fn with_physics(
    strength: f64,
    speed: f64,
    told: &[Told],
    (trials, seed): (usize, u64),
    progress: &mut Progress<'_>,
) -> Result<Circumstance, ReproductionError> {
    let sensors = Sensors::paper(1.0);
    let physics = Physics::ordinary().at_strength(strength);
    let test = drive(physics, &sensors, Manoeuvre::s_path(Pace::paper(speed)));
    let course = Course {
        driven: &test.driven(),
        sensors: &sensors,
        slips: &[],
        stations: &[],
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // per cent and mm/s
        seed: (seed, 700 + (100.0 * strength + 1e5 * speed) as u64),
        trials,
    };
    #[allow(clippy::cast_possible_truncation)] // a remainder
    let trial_of = |seed: u64| told[(seed % told.len() as u64) as usize].trial(seed);
    let pair = [Contender::Rear, Contender::Fused];
    let spreads = scatter(&course, &pair, &trial_of, progress)?;
    let accept =
        if strength == 0.0 { Accept::Within(0.85, 1.15) } else { Accept::Within(0.8, 1.25) };
    let percent = 100.0 * strength;
    let name = format!("calibrated, physics at {percent:.0} %, {:.0} mm/s", 1e3 * speed);
    Ok(Circumstance { name, spreads, strength, accept })
}

/// Beyond what the calibration allows for, the innovation test has to say so, and the covariance need not hold: where the
/// sensors of the median drive disagree by more than those of 99 in 100 drives of the ideal car.
fn excuse(rows: &mut [Circumstance]) {
    let of = |row: &Circumstance| {
        row.of(Contender::Fused).map_or(Vec::new(), |fused| fused.disagreement.clone())
    };
    let calibrated =
        |row: &&Circumstance| row.strength == 0.0 && row.name.starts_with("calibrated");
    let ideal: Vec<f64> = rows.iter().filter(calibrated).flat_map(of).collect();
    let limit = quantile(ideal, 0.99);
    for row in rows.iter_mut().filter(|row| row.strength > 0.0) {
        if quantile(of(row), 0.5) > limit {
            row.accept = Accept::Shown;
            row.name.push_str(", innovation test speaks");
        }
    }
}

/// The figures that these give to row 7.
pub(crate) fn figures(growth: &[Growth], circumstances: &[Circumstance]) -> Vec<Figure> {
    let mut figures: Vec<Figure> = growth.iter().flat_map(Growth::figures).collect();
    for row in circumstances {
        figures.extend(row.figure());
        if row.name.starts_with("calibrated") {
            let name = format!("sensors' disagreement, {}", row.name);
            figures.push(Figure::new(7, name, "", row.disagreement(), Accept::Shown));
        }
    }
    figures
}
