//! Each run left out in turn: what the others say of it, and how far its gap shrinks.

use kerbside_geometry::math;
use kerbside_simulation::Effects;
use nalgebra::DVector;
use rayon::prelude::*;

use crate::analyse::Analysis;
use crate::bench::Whole;
use crate::bins::{Channels, to_f64};
use crate::fit::{Fit, Search};
use crate::linear::Projection;

/// A fit seen from the point it was fitted to: everything that leaving runs out needs.
pub(crate) struct Linearised {
    whole: Whole,
    slopes: Vec<Whole>,
    /// Offsets of the coordinates from their priors' centres, in deviations.
    offset: DVector<f64>,
}

/// What a fit's evidence is over some of the runs, and where its coordinates would be.
pub(crate) struct Over {
    pub log_evidence: f64,
    /// Change of the coordinates, in units of the priors.
    pub step: DVector<f64>,
}

impl Linearised {
    pub(crate) fn new(search: &Search<'_>, fit: &Fit) -> Option<Self> {
        let projection = search.projection(&fit.set, &search.bench.all())?;
        let whole = search.bench.whole(&fit.effects);
        let slopes = search.slopes(fit, &whole, &projection);
        Some(Self { whole, slopes, offset: search.offsets(fit) })
    }

    pub(crate) fn over(&self, search: &Search<'_>, projection: &Projection) -> Option<Over> {
        let n = self.slopes.len();
        let mut vectors: Vec<&[DVector<f64>]> = self.slopes.iter().map(Vec::as_slice).collect();
        vectors.push(&self.whole);
        let products = projection.products(&search.bench.designs, &vectors);
        let mut normal = products.view((0, 0), (n, n)).into_owned();
        let mut right = DVector::zeros(n);
        for i in 0..n {
            normal[(i, i)] += 1.0;
            right[i] = -products[(i, n)] - self.offset[i];
        }
        let square = products[(n, n)] + self.offset.norm_squared();
        let root = normal.cholesky()?;
        let step = root.solve(&right);
        let occam: f64 = root.l_dirty().diagonal().iter().map(|d| math::ln(*d)).sum();
        let log_evidence = -0.5 * (square - right.dot(&step)) - occam - projection.occam();
        Some(Over { log_evidence, step })
    }
}

/// Twice what each run gains in log-likelihood over no effect while it is left out of the fit.
pub(crate) fn left_out(
    search: &Search<'_>,
    nothing: &Linearised,
    fit: &Fit,
    own: &Linearised,
) -> Vec<f64> {
    let all = search.bench.all();
    let gain = |runs: &[usize]| -> Option<f64> {
        let with = own.over(search, &search.projection(&fit.set, runs)?)?;
        let without = nothing.over(search, &search.projection(&[], runs)?)?;
        Some(with.log_evidence - without.log_evidence)
    };
    let whole = gain(&all);
    all.iter()
        .map(|run| {
            let others: Vec<usize> = all.iter().copied().filter(|other| other != run).collect();
            match (whole, gain(&others)) {
                (Some(whole), Some(others)) => 2.0 * (whole - others),
                _ => f64::NAN,
            }
        })
        .collect()
}

/// Drives that are asked for before blocks of one count as one.
const DRIVES: usize = 4;

/// How far a fit's coordinates move as parts of the runs are left out in turn: their standard errors in units of the
/// priors (the jackknife of Quenouille and Tukey), which hold whatever differs from drive to drive; of blocks where
/// there are few drives. None where there are too few of either.
pub(crate) fn jackknife(search: &Search<'_>, fit: &Fit, own: &Linearised) -> Option<DVector<f64>> {
    let all = search.bench.all();
    let drives = search.bench.groups();
    let parts =
        if drives.len() < DRIVES { all.iter().map(|run| vec![*run]).collect() } else { drives };
    if parts.len() < DRIVES {
        return None;
    }
    let without = |part: &Vec<usize>| {
        let others: Vec<usize> = all.iter().copied().filter(|run| !part.contains(run)).collect();
        Some(own.over(search, &search.projection(&fit.set, &others)?)?.step)
    };
    let steps: Vec<DVector<f64>> = parts.par_iter().map(without).collect::<Option<_>>()?;
    let count = to_f64(steps.len());
    let mut mean = DVector::zeros(own.slopes.len());
    steps.iter().for_each(|step| mean += step / count);
    let mut square = DVector::zeros(own.slopes.len());
    steps.iter().for_each(|step| square += (step - &mean).map(|d| d * d));
    Some(square.map(|sum| (sum * (count - 1.0) / count).sqrt()))
}

/// The effects that the other runs choose and fit for each run: none where they choose nothing.
pub(crate) fn chosen(found: &Analysis<'_>, search: &Search<'_>, rivals: &[usize]) -> Vec<Effects> {
    let linear: Vec<Option<Linearised>> =
        rivals.par_iter().map(|rival| Linearised::new(search, &found.fits[*rival])).collect();
    let all = search.bench.all();
    all.iter()
        .map(|run| {
            let others: Vec<usize> = all.iter().copied().filter(|other| other != run).collect();
            let mut best: Option<(f64, Effects)> = None;
            for (rival, linear) in rivals.iter().zip(&linear) {
                let fit = &found.fits[*rival];
                let over = linear
                    .as_ref()
                    .and_then(|own| own.over(search, &search.projection(&fit.set, &others)?));
                let Some(over) = over else { continue };
                if best.as_ref().is_none_or(|(evidence, _)| over.log_evidence > *evidence) {
                    best = Some((over.log_evidence, search.moved(fit, &over.step)));
                }
            }
            best.map_or(Effects::NEUTRAL, |(_, effects)| effects)
        })
        .collect()
}

/// A run's position errors from a common start, as they grow: time and distance \[s, m\], and the yaw's \[rad\]. The mean
/// pose of the first half second is laid on each other.
pub(crate) fn errors(
    width: f64,
    measured: &[Channels],
    predicted: &[Channels],
) -> Vec<(f64, f64, f64)> {
    use crate::bins::REFERENCE;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let window = (0.5 / width).round().max(1.0) as usize;
    let seen = |row: &Channels| row[REFERENCE].is_finite() && row[REFERENCE + 1].is_finite();
    let rows: Vec<usize> =
        (0..measured.len()).filter(|k| seen(&measured[*k]) && seen(&predicted[*k])).collect();
    let first: Vec<usize> = rows.iter().copied().take(window).collect();
    if first.is_empty() {
        return Vec::new();
    }
    let has_yaw = measured[first[0]][REFERENCE + 2].is_finite();
    let laid = |all: &[Channels]| -> (f64, f64, f64) {
        let mean = |c: usize| {
            first.iter().map(|k| all[*k][REFERENCE + c]).sum::<f64>()
                / crate::bins::to_f64(first.len())
        };
        (mean(0), mean(1), if has_yaw { mean(2) } else { 0.0 })
    };
    let (m, p) = (laid(measured), laid(predicted));
    let local = |row: &Channels, start: (f64, f64, f64)| {
        let (sin, cos) = kerbside_geometry::math::sin_cos(start.2);
        let (dx, dy) = (row[REFERENCE] - start.0, row[REFERENCE + 1] - start.1);
        (cos * dx + sin * dy, -sin * dx + cos * dy, row[REFERENCE + 2] - start.2)
    };
    rows.iter()
        .map(|k| {
            let (a, b) = (local(&measured[*k], m), local(&predicted[*k], p));
            let yaw = if has_yaw { kerbside_geometry::angle::wrap(a.2 - b.2) } else { f64::NAN };
            (
                crate::bins::to_f64(*k) * width,
                kerbside_geometry::math::hypot(a.0 - b.0, a.1 - b.1),
                yaw,
            )
        })
        .collect()
}
