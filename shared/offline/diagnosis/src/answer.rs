//! The answer's effects, its alternatives, and what to drive next.

use kerbside_geometry::math;
use kerbside_simulation::effects::ParameterDefinition;
use kerbside_simulation::{Command, Effects};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::bench::Bench;
use crate::bins::{Channels, REFERENCE, to_f64};
use crate::candidate::Coordinate;
use crate::case::{Case, Run, Series, Wheels};
use crate::decide::{SET, temper};
use crate::diagnose::{Found, Settings};
use crate::fit::{Fit, Search};
use crate::folds::{Linearised, jackknife};
use crate::prepare::Ready;
use crate::verdict::{Alternative, FoundEffect, FoundParameter, Interval, Next};

const WHEELS: [&str; 4] = ["fl", "fr", "rl", "rr"];
/// Half a 90 % interval in standard deviations.
const HALF: f64 = 1.645;
/// What a cost is divided by for the posterior along a staircase, square root: evidences are tempered.
const WIDER: f64 = 1.41;

/// The effects of the likeliest set.
pub(crate) fn effects(found: &Found<'_>, search: &Search<'_>) -> Vec<FoundEffect> {
    let Some(best) = found.decision.sets.first() else { return Vec::new() };
    let fit = &found.analysis.fits[best.fit];
    let covariance = covariance(fit);
    let wider = temper(found.analysis).sqrt();
    // What differs from drive to drive is not in the covariance.
    let scatter = Linearised::new(search, fit).and_then(|own| jackknife(search, fit, &own));
    let mut effects = Vec::new();
    let mut row = 0;
    for (member, (candidate, at)) in fit.set.iter().zip(&fit.at).enumerate() {
        let own = &search.candidates[*candidate];
        // A place is known as well as the path that the model drives.
        let astray = if own.is_patch() { astray(search, fit) } else { 0.0 };
        let spread: Vec<f64> = (0..at.len())
            .map(|c| {
                let model = wider * covariance[(row + c, row + c)].sqrt();
                let error = scatter.as_ref().map_or(model, |scatter| model.max(scatter[row + c]));
                let error = error * own.coordinates[c].deviation;
                HALF * if own.is_patch() && c < 3 { math::hypot(error, astray) } else { error }
            })
            .collect();
        row += at.len();
        let of =
            |name: &str| own.definition.parameters.iter().find(|parameter| parameter.name == name);
        let intervals = match own.is_staircase() {
            true => vec![(own.definition.parameters[0].name, staircase(search, fit, member))],
            false => own.intervals(at, &spread),
        };
        let parameters = intervals
            .into_iter()
            .map(|(name, value)| FoundParameter { name, unit: of(name).map_or("", unit), value })
            .collect();
        let probability = found
            .decision
            .sets
            .iter()
            .filter(|set| {
                found.analysis.fits[set.fit]
                    .set
                    .iter()
                    .any(|c| search.candidates[*c].definition.id == own.definition.id)
            })
            .map(|set| set.probability + set.unseen)
            .sum::<f64>()
            .min(1.0);
        effects.push(FoundEffect {
            id: own.definition.id,
            link: own.definition.link,
            wheel: own.wheel.map(|wheel| WHEELS[wheel]),
            parameters,
            probability,
        });
    }
    effects
}

/// How far the reference sees the car from where the model with a fit's effects has it \[m\], root mean square.
fn astray(search: &Search<'_>, fit: &Fit) -> f64 {
    let rows =
        search.bench.all().into_iter().flat_map(|run| search.bench.raw_of(run, &fit.effects));
    let square =
        |row: Channels| row[REFERENCE] * row[REFERENCE] + row[REFERENCE + 1] * row[REFERENCE + 1];
    let squares: Vec<f64> = rows.map(square).filter(|square| square.is_finite()).collect();
    (squares.iter().sum::<f64>() / to_f64(squares.len().max(1))).sqrt()
}

/// Points of a staircase that are tried.
const TREADS: usize = 64;

/// The interval of a coordinate whose cost is a staircase, where a slope says nothing: by the posterior at points all
/// over its range, the others left where they are. The value is the median.
fn staircase(search: &Search<'_>, fit: &Fit, member: usize) -> Interval {
    let own = &search.candidates[fit.set[member]].coordinates[0];
    let here = fit.at[member][0];
    let nothing = Interval { value: here, low: here, high: here };
    let Some(projection) = search.projection(&fit.set, &search.bench.all()) else { return nothing };
    let point = |k: usize| own.low + (own.high - own.low) * (to_f64(k) + 0.5) / to_f64(TREADS);
    let costs: Vec<f64> = (0..TREADS)
        .into_par_iter()
        .map(|k| {
            let mut at = fit.at.clone();
            at[member][0] = point(k);
            search.fit(&fit.set, &at, &projection, 1).cost
        })
        .collect();
    let least = costs.iter().copied().fold(fit.cost, f64::min);
    let weights: Vec<f64> =
        costs.iter().map(|cost| math::exp(-0.5 * (cost - least) / (WIDER * WIDER))).collect();
    let whole: f64 = weights.iter().sum();
    if whole < 1e-3 {
        // Narrower than the points are apart.
        let half = 0.5 * (own.high - own.low) / to_f64(TREADS);
        return Interval { value: here, low: (here - half).max(own.low), high: here + half };
    }
    let reach = |share: f64| {
        let mut sum = 0.0;
        let at = weights.iter().position(|weight| {
            sum += weight;
            sum >= share * whole
        });
        point(at.unwrap_or(TREADS - 1))
    };
    let half = 0.5 * (own.high - own.low) / to_f64(TREADS);
    Interval { value: reach(0.5), low: (reach(0.05) - half).max(own.low), high: reach(0.95) + half }
}

fn unit(parameter: &'static ParameterDefinition) -> &'static str {
    if parameter.unit == "1" { "" } else { parameter.unit }
}

fn covariance(fit: &Fit) -> DMatrix<f64> {
    let n = fit.normal.ncols();
    fit.normal.clone().cholesky().map_or_else(|| DMatrix::identity(n, n), |root| root.inverse())
}

/// The 90 % set: the fewest sets of effects, likeliest first, that hold nine tenths of what listed effects hold.
pub(crate) fn alternatives(found: &Found<'_>) -> Vec<Alternative> {
    let listed: f64 = found.decision.sets.iter().map(|set| set.probability).sum();
    if found.decision.answer == 0 || listed <= 0.0 {
        return Vec::new();
    }
    let mut reached = 0.0;
    let mut alternatives: Vec<Alternative> = Vec::new();
    for set in &found.decision.sets {
        if reached >= SET * listed {
            break;
        }
        reached += set.probability;
        let fit = &found.analysis.fits[set.fit];
        let ids: Vec<&'static str> =
            fit.set.iter().map(|c| found.analysis.candidates[*c].definition.id).collect();
        // The same effect at another wheel is no other alternative.
        match alternatives.iter_mut().find(|alternative| alternative.ids == ids) {
            Some(same) => same.probability += set.probability,
            None => alternatives.push(Alternative { ids, probability: set.probability }),
        }
    }
    alternatives
}

/// Standard deviations, by the simulator, at which a drive tells two sets apart for sure: a real vehicle is not quite as any
/// effect says, and shows less.
const APART: f64 = 8.0;
/// A drive that shows less than this is no use.
const USELESS: f64 = 2.0;
/// Time between two repetitions \[s\].
const STILL: f64 = 0.5;
/// A manoeuvre is driven so often at most.
const REPEATS: u32 = 4;

/// What a manoeuvre is worth that is repeated until it tells for sure, or as often as it may be.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Worth {
    sigma: f64,
    seconds: f64,
    repeats: u32,
}

impl Worth {
    fn of(sigma: f64, duration: f64) -> Self {
        let enough = (1..=REPEATS).find(|n| sigma * f64::from(*n).sqrt() >= APART);
        let repeats = enough.unwrap_or(REPEATS);
        let times = f64::from(repeats);
        Self { sigma: sigma * times.sqrt(), seconds: duration * times, repeats }
    }

    /// Whether it is the better choice: what is sure comes first, then what is short, else what shows most.
    fn beats(&self, other: &Self) -> bool {
        match (self.sigma >= APART, other.sigma >= APART) {
            (true, true) => self.seconds < other.seconds,
            (false, false) => self.sigma > other.sigma,
            (sure, _) => sure,
        }
    }
}

/// The manoeuvre that separates the two likeliest sets: the shortest that does so for sure, repeated where that helps, else
/// the one that separates them most; none where they are separated, or where no manoeuvre would with these sensors.
pub(crate) fn next(
    case: &Case,
    found: &Found<'_>,
    search: &Search<'_>,
    settings: &Settings,
) -> Option<Next> {
    let decision = found.decision;
    let uncertain = decision.answer > 1
        || (decision.answer == 1
            && decision.sets.len() > 1
            && decision.sets[0].probability + decision.sets[0].unseen < 0.95);
    let [first, second] = [decision.sets.first()?, decision.sets.get(1)?];
    if !uncertain {
        return None;
    }
    let (one, other) = (&found.analysis.fits[first.fit], &found.analysis.fits[second.fit]);
    let mut best: Option<(Worth, usize)> = None;
    for (i, manoeuvre) in settings.menu.iter().enumerate() {
        let Some(first) = manoeuvre.commands.first() else { continue };
        let duration = manoeuvre.commands.last().map_or(0.0, |last| last.t - first.t).max(1.0);
        let run = imagined(case, &manoeuvre.name, &manoeuvre.commands, duration);
        let imagined = Case { runs: vec![run], ..case.clone() };
        let Some(sigma) = separation(&imagined, found, search, one, other) else { continue };
        let worth = Worth::of(sigma, duration);
        if best.as_ref().is_none_or(|(known, _)| worth.beats(known)) {
            best = Some((worth, i));
        }
    }
    let (worth, i) = best.filter(|(worth, _)| worth.sigma >= USELESS)?;
    let manoeuvre = &settings.menu[i];
    let ids =
        |fit: &Fit| fit.set.iter().map(|c| search.candidates[*c].definition.id).collect::<Vec<_>>();
    Some(Next {
        manoeuvre: match worth.repeats {
            1 => manoeuvre.name.clone(),
            times => format!("{}, {times} times", manoeuvre.name),
        },
        separates: vec![ids(one), ids(other)],
        sigma: worth.sigma,
        commands: repeated(&manoeuvre.commands, worth.repeats),
    })
}

/// Commands one time after the other, as (t, speed, steering); each begins where the one before has ended.
fn repeated(commands: &[Command], times: u32) -> Vec<(f64, f64, f64)> {
    let period = match commands {
        [first, .., last] => last.t - first.t + STILL,
        _ => 0.0,
    };
    let once =
        |n: u32| commands.iter().map(move |c| (c.t + f64::from(n) * period, c.speed, c.steering));
    (0..times).flat_map(once).collect()
}

/// By how many standard deviations of the noise one set, driven, differs from the other fitted to it.
fn separation(
    case: &Case,
    found: &Found<'_>,
    search: &Search<'_>,
    one: &Fit,
    other: &Fit,
) -> Option<f64> {
    let mut ready = Ready::new(case);
    ready.runs.first_mut()?.start = Default::default();
    ready.imagine(&one.effects);
    let bench = Bench::new(&ready, found.nuisances, &Effects::NEUTRAL, &found.analysis.noise);
    let own = Search { bench: &bench, candidates: search.candidates };
    let projection = own.projection(&other.set, &bench.all())?;
    let fit = own.fit(&other.set, &other.at, &projection, 5);
    // What the priors of the coordinates cost says nothing of the manoeuvre.
    let prior = own.offsets(&fit).norm_squared();
    Some((fit.cost - prior).max(0.0).sqrt())
}

/// A run that was not driven, with the sensors that the case has, at their mean rates.
fn imagined(case: &Case, name: &str, commands: &[Command], duration: f64) -> Run {
    let model = &case.runs[0];
    let grid = |series: Option<(f64, f64)>, rows: usize| -> Vec<f64> {
        let Some((begin, end)) = series else { return Vec::new() };
        let period = (end - begin).max(1e-3) / crate::bins::to_f64(rows.max(2) - 1);
        let mut stamps = Vec::new();
        let mut t = 0.0;
        while t < duration {
            stamps.push(t);
            t += period;
        }
        stamps
    };
    fn filled<const N: usize>(t: Vec<f64>, model: &Series<N>) -> Series<N> {
        let row: [f64; N] =
            core::array::from_fn(|column| if model.has(column) { 0.0 } else { f64::NAN });
        let value = vec![row; t.len()];
        Series { t, value }
    }
    let wheels = model.wheels.series();
    let wheels = filled(grid(wheels.span(), wheels.t.len()), wheels);
    Run {
        name: name.to_owned(),
        repeat_of: None,
        start: None,
        commands: commands.to_vec(),
        wheels: if matches!(model.wheels, Wheels::Speed(_)) {
            Wheels::Speed(wheels)
        } else {
            Wheels::Rotation(wheels)
        },
        steering: filled(grid(model.steering.span(), model.steering.t.len()), &model.steering),
        gyro: filled(grid(model.gyro.span(), model.gyro.t.len()), &model.gyro),
        reference: filled(grid(model.reference.span(), model.reference.t.len()), &model.reference),
    }
}

impl crate::candidate::Candidate {
    /// Parameters with intervals, from coordinates and half intervals of these.
    fn intervals(&self, at: &[f64], half: &[f64]) -> Vec<(&'static str, Interval)> {
        let values = self.parameters(at);
        if self.definition.id == "floor_slope" {
            // Length and direction of a vector: what lies across its length turns it.
            let rate = values[1].1.max(1e-9);
            let width = half[0].max(half[1]);
            let turn = (width / rate).min(core::f64::consts::PI);
            let halves = [turn, width];
            return values
                .into_iter()
                .zip(halves)
                .map(|((name, value), half)| {
                    (name, Interval { value, low: value - half, high: value + half })
                })
                .collect();
        }
        let ends = |sign: f64| {
            let within = |((at, half), c): ((&f64, &f64), &Coordinate)| {
                (at + sign * half).clamp(c.low, c.high)
            };
            let moved: Vec<f64> = at.iter().zip(half).zip(&self.coordinates).map(within).collect();
            self.parameters(&moved)
        };
        let (low, high) = (ends(-1.0), ends(1.0));
        values
            .into_iter()
            .zip(low.into_iter().zip(high))
            .map(|((name, value), ((_, low), (_, high)))| {
                (
                    name,
                    Interval {
                        value,
                        low: low.min(high).min(value),
                        high: high.max(low).max(value),
                    },
                )
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_sure_and_short_is_driven_first_and_what_is_not_sure_is_repeated() {
        let (sure, longer) = (Worth::of(9.0, 20.0), Worth::of(30.0, 25.0));
        assert!(sure.beats(&longer) && !longer.beats(&sure));
        let twice = Worth::of(6.0, 9.0);
        assert_eq!((twice.repeats, twice.seconds), (2, 18.0));
        assert!(twice.beats(&sure) && twice.sigma > APART);
        let (weak, weaker) = (Worth::of(1.5, 60.0), Worth::of(1.0, 10.0));
        assert_eq!((weak.repeats, weak.sigma), (REPEATS, 3.0));
        assert!(weak.beats(&weaker) && sure.beats(&weak) && !weak.beats(&sure));
    }

    #[test]
    fn a_repetition_begins_where_the_one_before_has_ended() {
        let command = |t, speed| Command { t, speed, steering: 0.1 };
        let commands = [command(0.0, 0.0), command(2.0, 0.5), command(4.0, 0.0)];
        let twice = repeated(&commands, 2);
        let times: Vec<f64> = twice.iter().map(|row| row.0).collect();
        assert_eq!(times, [0.0, 2.0, 4.0, 4.5, 6.5, 8.5]);
        assert_eq!(twice[4], (6.5, 0.5, 0.1));
    }
}
