//! What every hypothesis is judged on: whitened residuals, with the nuisances integrated out.

use kerbside_geometry::{Drive, WHEELS};
use kerbside_simulation::Effects;
use kerbside_simulation::effects::Link;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::bins::{CHANNELS, Channels, GYRO, STEERING, to_f64};
use crate::generic::Extent;
use crate::linear::{Design, Projection, gram};
use crate::noise::{Coefficients, Evidence, Noise, OF_WHEEL, Whitener};
use crate::nuisance::{CREEP, GRAVITY, Nuisance};
use crate::path::{Path, residuals};
use crate::prepare::Ready;

/// Whitened values of every run.
pub(crate) type Whole = Vec<DVector<f64>>;

/// The whitened data of a case about the paths of one set of effects.
pub(crate) struct Bench<'a> {
    pub ready: &'a Ready<'a>,
    pub nuisances: &'a [Nuisance],
    pub paths: Vec<Path>,
    pub coefficients: Vec<Coefficients>,
    pub whiteners: Vec<Whitener>,
    pub designs: Vec<Design>,
    pub normals: Vec<DMatrix<f64>>,
    pub extent: Extent,
    /// Residuals of `about`, not whitened.
    pub raw: Vec<Vec<Channels>>,
    raw_columns: Vec<Vec<Vec<Channels>>>,
}

impl<'a> Bench<'a> {
    /// About the paths of `about`, with noise as in `noise`.
    pub(crate) fn new(
        ready: &'a Ready<'a>,
        nuisances: &'a [Nuisance],
        about: &Effects,
        noise: &Noise,
    ) -> Self {
        let runs: Vec<usize> = (0..ready.runs.len()).collect();
        let paths: Vec<Path> = runs.par_iter().map(|run| ready.path(*run, about)).collect();
        let coefficients: Vec<Coefficients> = runs
            .iter()
            .map(|run| Coefficients::new(ready.vehicle, &ready.runs[*run].binned, &paths[*run]))
            .collect();
        let base: Vec<Vec<Channels>> =
            runs.par_iter().map(|run| ready.predicted(*run, about)).collect();
        let raw = runs
            .iter()
            .map(|run| {
                let binned = &ready.runs[*run].binned;
                residuals(binned, &paths[*run], &binned.measured, &base[*run])
            })
            .collect();
        let raw_columns: Vec<Vec<Vec<Channels>>> = runs
            .par_iter()
            .map(|run| {
                let column = |nuisance: &Nuisance| {
                    column(ready, *run, &paths[*run], about, &base[*run], nuisance)
                };
                let mut columns: Vec<Vec<Channels>> = nuisances.iter().map(column).collect();
                columns.push(late(&base[*run], GYRO, ready.runs[*run].binned.width));
                if ready.vehicle.drive == Drive::All {
                    columns.push(uneven(ready, &coefficients[*run], &paths[*run]));
                }
                columns
            })
            .collect();
        let each: Vec<&Path> = paths.iter().collect();
        let width = ready.runs.first().map_or(crate::bins::WIDTH, |run| run.binned.width);
        let extent = Extent::new(&each, width, ready.vehicle.wheelbase, ready.vehicle.radius);
        let mut bench = Self {
            ready,
            nuisances,
            paths,
            coefficients,
            whiteners: Vec::new(),
            designs: Vec::new(),
            normals: Vec::new(),
            extent,
            raw,
            raw_columns,
        };
        bench.whiten(noise);
        bench
    }

    /// Replaces the noise.
    pub(crate) fn whiten(&mut self, noise: &Noise) {
        let evidence = self.evidence(&[]);
        self.whiteners = evidence.par_iter().map(|run| run.whitener(noise)).collect();
        self.designs = self
            .whiteners
            .par_iter()
            .zip(&self.raw_columns)
            .map(|(whitener, columns)| {
                let mut values = Vec::with_capacity(whitener.values * columns.len());
                for column in columns {
                    whitener.apply(column, &mut values);
                }
                DMatrix::from_vec(whitener.values, columns.len(), values)
            })
            .collect();
        self.normals = self.designs.iter().map(gram).collect();
    }

    /// What the noise is estimated from: the residuals about which this bench is made, and the nuisances with `more`
    /// columns (`[column][run]`).
    pub(crate) fn evidence(&self, more: &[Vec<Vec<Channels>>]) -> Vec<Evidence> {
        (0..self.raw.len())
            .map(|run| {
                let mut columns = self.raw_columns[run].clone();
                columns.extend(more.iter().map(|column| column[run].clone()));
                Evidence {
                    coefficients: self.coefficients[run].clone(),
                    residuals: self.raw[run].clone(),
                    columns,
                    follows: !self.ready.runs[run].run.has_commands(),
                }
            })
            .collect()
    }

    /// Residuals of a set of effects about this bench's paths, not whitened.
    pub(crate) fn raw_of(&self, run: usize, effects: &Effects) -> Vec<Channels> {
        let binned = &self.ready.runs[run].binned;
        residuals(binned, &self.paths[run], &binned.measured, &self.ready.predicted(run, effects))
    }

    /// Whitened residuals of a set of effects, by run.
    pub(crate) fn whole(&self, effects: &Effects) -> Whole {
        (0..self.raw.len()).map(|run| self.whitened(run, &self.raw_of(run, effects))).collect()
    }

    /// Whitens channels of a run.
    pub(crate) fn whitened(&self, run: usize, channels: &[Channels]) -> DVector<f64> {
        let mut values = Vec::with_capacity(self.whiteners[run].values);
        self.whiteners[run].apply(channels, &mut values);
        DVector::from_vec(values)
    }

    /// Every run.
    pub(crate) fn all(&self) -> Vec<usize> {
        (0..self.raw.len()).collect()
    }

    /// With the nuisances integrated out over `runs`, but for those that `drop` says.
    pub(crate) fn projection(
        &self,
        runs: &[usize],
        drop: impl Fn(&Nuisance) -> bool,
    ) -> Option<Projection> {
        let dropped: Vec<usize> = self
            .nuisances
            .iter()
            .enumerate()
            .filter(|(_, n)| drop(n))
            .map(|(column, _)| column)
            .collect();
        Projection::new(&self.normals, runs, &dropped)
    }

    /// Sensitivities of a run to the nuisances, not whitened.
    pub(crate) fn raw_columns(&self, run: usize) -> &[Vec<Channels>] {
        &self.raw_columns[run]
    }

    /// Whether the model predicts a number wherever one was measured: a description may be so wrong that it does not.
    pub(crate) fn is_whole(&self) -> bool {
        let present = |run: usize| &self.coefficients[run].present;
        self.raw.iter().enumerate().all(|(run, rows)| {
            rows.iter().zip(present(run)).all(|(row, present)| {
                row.iter().zip(present).all(|(value, present)| !present || value.is_finite())
            })
        })
    }

    /// Whether every run lacks commands: motor and rack are what was measured of them.
    pub(crate) fn only_follows(&self) -> bool {
        self.ready.runs.iter().all(|run| !run.run.has_commands())
    }

    /// As how many runs the pieces count: those of one drive share more than those of several.
    pub(crate) fn independent(&self) -> f64 {
        let drives = to_f64(self.groups().len());
        drives + 0.5 * (to_f64(self.raw.len()) - drives)
    }

    /// Whether some runs are pieces of one recorded drive.
    pub(crate) fn is_cut(&self) -> bool {
        self.groups().len() < self.raw.len()
    }

    /// The runs of each recorded drive.
    pub(crate) fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
        for (run, drive) in self.ready.drives.iter().enumerate() {
            match groups.iter_mut().find(|(own, _)| own == drive) {
                Some((_, runs)) => runs.push(run),
                None => groups.push((*drive, vec![run])),
            }
        }
        groups.into_iter().map(|(_, runs)| runs).collect()
    }

    /// Number of whitened values in all.
    pub(crate) fn values(&self) -> usize {
        self.whiteners.iter().map(|whitener| whitener.values).sum()
    }
}

/// Delay of a gyro's reading that is no gap: a filter's or half a period of its own \[s\].
const LATE: f64 = 0.004;

/// How much further the front wheels of a car driven at all of them slip than the rear ones, per acceleration
/// \[s^2/m\]: both axles bring up the same force, under loads of 40 to 60 % of the weight, and a tyre's slip is its force
/// over its load (Pacejka, *Tire and Vehicle Dynamics*, chapter 1).
const UNEVEN: f64 = 0.2 * CREEP / GRAVITY;

/// What that does to the wheels while the car speeds up or slows down.
fn uneven(ready: &Ready<'_>, coefficients: &Coefficients, path: &Path) -> Vec<Channels> {
    let speed = |k: usize| path.steps[k].distance / coefficients.width;
    let slip: Vec<f64> = (0..path.pose.len())
        .map(|k| {
            let (before, after) = (k.saturating_sub(1), k.min(path.steps.len().saturating_sub(1)));
            if before == after || path.steps.is_empty() {
                return 0.0;
            }
            let rate = (speed(after).abs() - speed(before).abs()) / coefficients.width;
            let most = ready.vehicle.limits.acceleration;
            UNEVEN * rate.clamp(-most, most)
        })
        .collect();
    let rear: Vec<f64> = slip.iter().map(|slip| -slip).collect();
    let mut sum = vec![[0.0; CHANNELS]; path.pose.len()];
    for wheel in WHEELS {
        let own = if wheel.is_front() { &slip } else { &rear };
        for (sum, row) in sum.iter_mut().zip(coefficients.response(OF_WHEEL + wheel.index(), own)) {
            for (sum, value) in sum.iter_mut().zip(row) {
                *sum += value;
            }
        }
    }
    sum
}

/// What a channel does that is read a little late.
fn late(base: &[Channels], channel: usize, width: f64) -> Vec<Channels> {
    let mut column = vec![[0.0; CHANNELS]; base.len()];
    for k in 1..base.len().saturating_sub(1) {
        let slope = (base[k + 1][channel] - base[k - 1][channel]) / (2.0 * width);
        column[k][channel] = if slope.is_finite() { -LATE * slope } else { 0.0 };
    }
    column
}

/// Sensitivity of a run's residuals to a nuisance of one standard deviation. What motor or rack make of a command may be
/// cut off at the vehicle's limits: to the other side it is not.
fn column(
    ready: &Ready<'_>,
    run: usize,
    path: &Path,
    about: &Effects,
    base: &[Channels],
    nuisance: &Nuisance,
) -> Vec<Channels> {
    let binned = &ready.runs[run].binned;
    let off = |by: f64| {
        let mut effects = *about;
        effects.set(nuisance.parameter, effects.get(nuisance.parameter) + by);
        ready.predicted(run, &effects)
    };
    let more = residuals(binned, path, &off(nuisance.deviation), base);
    let link = nuisance.parameter.effect().link;
    if !matches!(link, Link::SpeedActuation | Link::SteeringActuation) {
        return more;
    }
    let less = residuals(binned, path, base, &off(-nuisance.deviation));
    if commanded(&less) > commanded(&more) { less } else { more }
}

/// How much wheels and steering sensor show of a column.
fn commanded(column: &[Channels]) -> f64 {
    let values = column.iter().flat_map(|row| &row[..=STEERING]);
    values.filter(|value| value.is_finite()).map(|value| value * value).sum()
}
