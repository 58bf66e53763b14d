//! All rows, or some of them.

use crate::calibrations::{Calibrations, Circumstances, Told, repeat};
use crate::ends::{self, Ends};
use crate::error::ReproductionError;
use crate::figure::{Figure, Verdict};
use crate::parking::{self, Driver, Parkings, Scene};
use crate::progress::{Progress, Watcher};
use crate::slips::{self, Slipped};
use crate::truthful::{self, Circumstance, Growth};
use crate::{conversion, tables};

/// How many rows there are.
pub const ROWS: u8 = 9;

/// Trials that are asked for; with fewer of them, what an interval does not decide is open.
pub const FULL: usize = 400;

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Trials per case.
    pub trials: usize,
    /// Seed of everything.
    pub seed: u64,
    /// Rows, 1 to [`ROWS`]; none for all.
    pub rows: Vec<u8>,
}

impl Asked {
    /// Whether `row` is asked for.
    #[must_use]
    pub fn wants(&self, row: u8) -> bool {
        self.rows.is_empty() || self.rows.contains(&row)
    }
}

/// What came out.
#[derive(Clone, Debug, PartialEq)]
pub struct Reproduction {
    /// What was asked for.
    pub asked: Asked,
    /// All figures, in the order of the rows.
    pub figures: Vec<Figure>,
    /// Calibrations; empty where no row needs them.
    pub calibrations: Vec<Calibrations>,
    /// Drives of the S path; empty where no row needs them.
    pub ends: Vec<Ends>,
    /// NEES over the distance.
    pub growth: Vec<Growth>,
    /// NEES under other circumstances.
    pub circumstances: Vec<Circumstance>,
    /// Drives with slips.
    pub slips: Vec<Slipped>,
    /// Parkings on a given path.
    pub parkings: Vec<Parkings>,
}

impl Reproduction {
    fn nothing(asked: &Asked) -> Self {
        Self {
            asked: asked.clone(),
            figures: Vec::new(),
            calibrations: Vec::new(),
            ends: Vec::new(),
            growth: Vec::new(),
            circumstances: Vec::new(),
            slips: Vec::new(),
            parkings: Vec::new(),
        }
    }

    /// What becomes of a figure of these.
    #[must_use]
    pub fn verdict(&self, figure: &Figure) -> Verdict {
        figure.verdict(self.asked.trials >= FULL)
    }

    /// Whether no figure is missed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.figures.iter().all(|figure| self.verdict(figure) != Verdict::Missed)
    }
}

/// Runs the rows that are asked for; `watcher` is told after every trial.
///
/// # Errors
/// [`ReproductionError`] where there are too few trials, or the watcher ends it.
pub fn reproduce(asked: &Asked, watcher: Watcher<'_>) -> Result<Reproduction, ReproductionError> {
    if asked.trials < 2 {
        return Err(ReproductionError::FewTrials(asked.trials));
    }
    let mut progress = Progress::new(watcher, total(asked));
    let mut out = Reproduction::nothing(asked);
    calibrate(asked, &mut progress, &mut out)?;
    if asked.wants(4) {
        out.figures.extend(conversion::figures());
    }
    filters(asked, &mut progress, &mut out)?;
    if asked.wants(9) {
        progress.begin("parking");
        out.parkings = parking::park_all(asked.trials, asked.seed, &mut progress)?;
        out.figures.extend(parking::figures(&out.parkings));
    }
    out.figures.sort_by_key(|figure| figure.row);
    Ok(out)
}

/// Rows 5 to 8.
fn filters(
    asked: &Asked,
    progress: &mut Progress<'_>,
    out: &mut Reproduction,
) -> Result<(), ReproductionError> {
    if [5, 6, 7].into_iter().any(|row| asked.wants(row)) {
        progress.begin("the S path");
        out.ends = ends::drive_all(asked.trials, asked.seed, progress)?;
        out.figures.extend(ends::figures(&out.ends, &|row| asked.wants(row)));
    }
    if asked.wants(7) {
        progress.begin("covariances");
        out.growth = truthful::growth(asked.trials, asked.seed, progress)?;
        out.circumstances = truthful::circumstances(asked.trials, asked.seed, progress)?;
        out.figures.extend(truthful::figures(&out.growth, &out.circumstances));
    }
    if asked.wants(8) {
        progress.begin("slips");
        let physical = Told::by(&Circumstances::physical(1.0, 5).yard, asked.seed)?;
        out.slips = slips::drive_all(asked.trials, asked.seed, &physical, progress)?;
        out.figures.extend(slips::figures(&out.slips));
    }
    Ok(())
}

/// Repetitions of a calibration for so many trials: 60 for 400.
fn repeats(trials: usize) -> usize {
    (3 * trials / 20).clamp(2, 200)
}

/// Of what is shown beside.
fn few(repeats: usize) -> usize {
    (repeats / 4).max(2)
}

/// Rows 1 to 3.
fn calibrate(
    asked: &Asked,
    progress: &mut Progress<'_>,
    out: &mut Reproduction,
) -> Result<(), ReproductionError> {
    let (repeats, seed) = (repeats(asked.trials), asked.seed);
    let few = few(repeats);
    progress.begin("calibrations");
    if asked.wants(1) || asked.wants(2) {
        let fine = repeat(&Circumstances::fine(), repeats, seed, progress)?;
        let bent = repeat(&Circumstances::bent(), repeats, seed, progress)?;
        let wide = repeat(&Circumstances::wide(), few, seed, progress)?;
        let physical = repeat(&Circumstances::physical(1.0, 5), few, seed, progress)?;
        let mut figures = tables::straights(&fine, &bent);
        figures.extend(tables::arcs(&fine, &wide));
        figures.extend(tables::physical(&physical));
        out.figures.extend(figures.into_iter().filter(|figure| asked.wants(figure.row)));
        out.calibrations.extend([fine, bent, wide, physical]);
    }
    if asked.wants(3) {
        let coarse = repeat(&Circumstances::coarse(), repeats, seed, progress)?;
        out.figures.extend(tables::coarse(&coarse));
        out.calibrations.push(coarse);
    }
    Ok(())
}

/// Trials that the rows take together.
fn total(asked: &Asked) -> u64 {
    let (trials, repeats) = (asked.trials, repeats(asked.trials));
    let any = |rows: &[u8]| rows.iter().any(|row| asked.wants(*row));
    let rows = [
        (any(&[1, 2]), 2 * repeats + 2 * few(repeats)),
        (any(&[3]), repeats),
        (any(&[5, 6, 7]), ends::CASES * trials),
        (any(&[7]), (truthful::KINDS + truthful::CIRCUMSTANCES) * trials),
        (any(&[8]), slips::SETTINGS * slips::PER_SETTING * trials),
        (any(&[9]), Scene::ALL.len() * Driver::ALL.len() * trials),
    ];
    rows.iter().filter(|row| row.0).map(|row| row.1 as u64).sum()
}
