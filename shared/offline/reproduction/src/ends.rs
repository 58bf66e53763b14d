//! The S path: Figures 7, 8 and 9 of the paper, rows 5, 6 and 7.

use kerbside_geometry::Pose;
use kerbside_proving_ground::{Manoeuvre, Pace, Physics, Sensors};

use crate::belief::{Knowledge, trial};
use crate::error::ReproductionError;
use crate::figure::{Accept, Figure};
use crate::follower::Contender;
use crate::progress::Progress;
use crate::random::seed_of;
use crate::scatter::{Course, Spread, drive, scatter};
use crate::statistics::{
    all, bias, bootstrap, mean_between, mean_distance, mean_square, number, variance,
};

/// Variance of the front wheels' noise over the rear wheels', and the case's name.
pub const NOISE_CASES: [(f64, &str); 3] =
    [(1.0 / 3.0, "front 3x better"), (1.0, "equal"), (2.0, "front 2x worse")];

/// The paper's mean speeds, about \[m/s\].
pub const SPEEDS: [f64; 2] = [0.09, 0.26];

/// Largest ratio of fused to rear variance per case: parameters known, and with residual errors (row 6).
const ALLOWED: [[f64; 3]; 2] = [[0.30, 0.57, 0.80], [0.30, 0.37, 0.40]];

/// Distances at which errors are taken along the path \[m\].
const STATIONS: [f64; 12] = [0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.5];
/// From this station on row 5 is held.
const FIRST_HELD: usize = 1;

/// Drives of the S path under one noise case at one speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Ends {
    /// Top speed \[m/s\].
    pub speed: f64,
    /// Number of the noise case in [`NOISE_CASES`].
    pub case: usize,
    /// What is known of the vehicle.
    pub knowledge: Knowledge,
    /// Per contender, in the order of [`Contender::ALL`].
    pub spreads: Vec<Spread>,
    /// Distances of the stations \[m\]; the last one is the path's length.
    pub stations: Vec<f64>,
    /// True path of every drive, at the readings.
    pub truth: Vec<Pose>,
    /// Stamps of the readings \[s\].
    pub times: Vec<f64>,
    seed: u64,
}

/// How many cases [`drive_all`] drives.
pub(crate) const CASES: usize = 2 * SPEEDS.len() * NOISE_CASES.len();

/// Drives the S path `trials` times for every noise case, speed and state of knowledge.
pub(crate) fn drive_all(
    trials: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Vec<Ends>, ReproductionError> {
    let mut rows = Vec::new();
    for knowledge in [Knowledge::Known, Knowledge::Residual] {
        for speed in SPEEDS {
            for case in 0..NOISE_CASES.len() {
                rows.push(drive_one(knowledge, speed, case, (trials, seed), progress)?);
            }
        }
    }
    Ok(rows)
}

fn drive_one(
    knowledge: Knowledge,
    speed: f64,
    case: usize,
    (trials, seed): (usize, u64),
    progress: &mut Progress<'_>,
) -> Result<Ends, ReproductionError> {
    let sensors = Sensors::paper(NOISE_CASES[case].0);
    let test = drive(Physics::NEUTRAL, &sensors, Manoeuvre::s_path(Pace::paper(speed)));
    let driven = test.driven();
    // The errors of the sensors are the same whatever is known: what the knowledge is worth is compared in pairs.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // mm/s
    let number = 100 + 10 * (1e3 * speed) as u64 + case as u64;
    let course = Course {
        driven: &driven,
        sensors: &sensors,
        slips: &[],
        stations: &STATIONS,
        seed: (seed, number),
        trials,
    };
    let truths = driven.record(0).truth;
    let spreads =
        scatter(&course, &Contender::ALL, &|seed| trial(knowledge, &sensors, seed), progress)?;
    let length = truths.last().map_or(0.0, |state| state.distance);
    Ok(Ends {
        speed,
        case,
        knowledge,
        spreads,
        stations: STATIONS.into_iter().chain([length]).collect(),
        truth: truths.iter().map(|state| state.pose).collect(),
        times: truths.iter().map(|state| state.time).collect(),
        seed: seed_of(seed, number, u64::MAX),
    })
}

impl Ends {
    /// The errors of one contender; none where it did not take part.
    #[must_use]
    pub fn of(&self, contender: Contender) -> Option<&Spread> {
        self.spreads.iter().find(|spread| spread.contender == contender)
    }

    /// Words for the case.
    #[must_use]
    pub fn name(&self) -> String {
        let speed = 1e3 * self.speed;
        format!("{}, {speed:.0} mm/s, {}", NOISE_CASES[self.case].1, self.knowledge.name())
    }

    /// Variance of the end of `above` over that of `below`, and its paired interval.
    #[must_use]
    pub fn variance_ratio(&self, above: Contender, below: Contender) -> (f64, (f64, f64)) {
        let (Some(above), Some(below)) = (self.of(above), self.of(below)) else {
            return (f64::NAN, (f64::NAN, f64::NAN));
        };
        let ratio =
            |indices: &[usize]| variance(above.end(), indices) / variance(below.end(), indices);
        let count = above.end().len();
        (ratio(&all(count)), bootstrap(count, self.seed, ratio))
    }

    /// Root mean square error of fused over that of rear at each station, and its paired interval: Figure 8.
    #[must_use]
    pub fn along(&self) -> Vec<(f64, (f64, f64))> {
        let (Some(fused), Some(rear)) = (self.of(Contender::Fused), self.of(Contender::Rear))
        else {
            return Vec::new();
        };
        let at = |station: usize| {
            let ratio = |indices: &[usize]| {
                let square = |spread: &Spread| mean_square(&spread.errors[station], indices);
                (square(fused) / square(rear)).sqrt()
            };
            let count = fused.end().len();
            (ratio(&all(count)), bootstrap(count, self.seed, ratio))
        };
        (0..self.stations.len()).map(at).collect()
    }

    /// Mean end error of a contender \[m\].
    #[must_use]
    pub fn mean_error(&self, contender: Contender) -> f64 {
        self.of(contender).map_or(f64::NAN, |spread| mean_distance(spread.end()))
    }

    /// Variance of x plus variance of y of the end of a contender \[m^2\].
    #[must_use]
    pub fn variance(&self, contender: Contender) -> f64 {
        self.of(contender)
            .map_or(f64::NAN, |spread| variance(spread.end(), &all(spread.end().len())))
    }

    /// Row 5.
    fn along_figures(&self) -> Vec<Figure> {
        let ratios = self.along();
        let held = ratios.iter().skip(FIRST_HELD);
        let worst = held.max_by(|a, b| a.0.total_cmp(&b.0)).copied();
        let (ours, interval) = worst.unwrap_or((f64::NAN, (f64::NAN, f64::NAN)));
        let name = format!("fused/rear rms, worst station, {}", self.name());
        let ratio = Figure::new(5, name, "", ours, Accept::AtMost(0.78))
            .between(interval)
            .beside("EKF below rear");
        let excess = self.of(Contender::Fused).map_or(f64::NAN, |fused| {
            fused.errors.iter().map(|errors| excess_bias(errors)).fold(f64::MIN, f64::max)
        });
        let name = format!("fused bias beyond 3 sd/sqrt(M), {}", self.name());
        vec![ratio, Figure::new(5, name, "mm", 1e3 * excess, Accept::AtMost(2.0))]
    }

    /// Row 6.
    fn variance_figures(&self) -> Vec<Figure> {
        let group = usize::from(self.knowledge != Knowledge::Known);
        let (ours, interval) = self.variance_ratio(Contender::Fused, Contender::Rear);
        let name = format!("fused/rear variance, {}", self.name());
        let allowed = Accept::AtMost(ALLOWED[group][self.case]);
        let mut figures =
            vec![Figure::new(6, name, "", ours, allowed).between(interval).beside("0.66")];
        figures.push(self.blind_figure(allowed, group == 0));
        let better = [Contender::Rear, Contender::Front]
            .into_iter()
            .min_by(|a, b| self.variance(*a).total_cmp(&self.variance(*b)));
        if let Some(better) = better {
            let (ours, interval) = self.variance_ratio(Contender::Fused, better);
            let name = format!("fused/better axle, interval's low end, {}", self.name());
            figures.push(
                Figure::new(6, name, "", interval.0, Accept::AtMost(1.0))
                    .between((interval.0, ours)),
            );
        }
        for paper in [Contender::PaperOwn, Contender::Paper] {
            let (ours, interval) = self.variance_ratio(paper, Contender::Rear);
            let explains = paper == Contender::Paper && group == 1;
            let accept = if explains { Accept::Within(0.55, 0.72) } else { Accept::Shown };
            let name = format!("{}/rear variance, {}", paper.name(), self.name());
            figures.push(Figure::new(6, name, "", ours, accept).between(interval).beside("0.66"));
        }
        figures
    }

    /// By the wheels alone, as the limits for known parameters were found; with residual errors it is shown beside.
    fn blind_figure(&self, allowed: Accept, held: bool) -> Figure {
        let (ours, interval) = self.variance_ratio(Contender::FusedBlind, Contender::Rear);
        let name = format!("fused without steering/rear variance, {}", self.name());
        let accept = if held { allowed } else { Accept::Shown };
        Figure::new(6, name, "", ours, accept).between(interval).beside("0.66")
    }

    /// Row 7.
    fn consistency_figures(&self) -> Vec<Figure> {
        let accept = |contender: Contender| match (contender, self.knowledge) {
            (Contender::Fused, Knowledge::Known) => Accept::Within(0.90, 1.10),
            (Contender::Fused, _) => Accept::Within(0.85, 1.15),
            (Contender::Paper | Contender::PaperOwn, Knowledge::Known) => Accept::AtLeast(100.0),
            _ => Accept::Shown,
        };
        let figure = |spread: &Spread| {
            let (mean, (low, high)) = mean_between(spread.end_nees(), self.seed);
            let name = format!("{} NEES/3, {}", spread.contender.name(), self.name());
            Figure::new(7, name, "", mean / 3.0, accept(spread.contender))
                .between((low / 3.0, high / 3.0))
        };
        self.spreads.iter().map(figure).collect()
    }
}

/// What the length of the mean error has beyond three of its own standard deviations \[m\].
fn excess_bias(errors: &[[f64; 3]]) -> f64 {
    let count = errors.len();
    bias(errors) - 3.0 * (variance(errors, &all(count)) / number(count)).sqrt()
}

/// The figures of rows 5, 6 and 7 that these drives give, of the rows in `wanted`.
pub(crate) fn figures(ends: &[Ends], wanted: &dyn Fn(u8) -> bool) -> Vec<Figure> {
    let mut figures = Vec::new();
    let equal = |ends: &&Ends| ends.case == 1 && ends.knowledge == Knowledge::Known;
    if wanted(5) {
        figures.extend(ends.iter().filter(equal).flat_map(Ends::along_figures));
    }
    if wanted(6) {
        figures.extend(ends.iter().flat_map(Ends::variance_figures));
    }
    if wanted(7) {
        figures.extend(ends.iter().flat_map(Ends::consistency_figures));
    }
    figures
}
