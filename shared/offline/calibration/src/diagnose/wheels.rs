//! Wheels that stand still, count backwards, or roll a multiple of the others.

use kerbside_geometry::{Vehicle, WHEELS, math};

use super::grid::{Grid, sums};
use super::{Findings, Problem};
use crate::noise::Noise;
use crate::run::Run;

/// A run shorter than this many wheelbases says nothing.
const SHORTEST: f64 = 2.0;
/// Nor does one of fewer counts.
const FEWEST_COUNTS: f64 = 200.0;
/// A wheel stands still if it rolls less than this share of the others over this many wheelbases.
const STUCK: f64 = 0.005;
const STRETCH: f64 = 1.0;
/// A wheel rolls no faster than so many times the vehicle's largest speed, give or take so many wheelbases.
const FASTEST: f64 = 3.0;
const SLACK: f64 = 0.1;
/// A vehicle that gets no farther than this share of its wheels' travel turns on the spot.
const SPINS: f64 = 0.2;
/// A wheel's travel over the typical one's, beyond which no curve explains it, at least.
const MULTIPLE: f64 = 1.67;

/// Leaves the grid's distance with every wheel's sign set right.
pub(crate) fn check(
    found: &mut Findings,
    run: &Run,
    grid: &mut Grid,
    vehicle: &Vehicle,
    noise: &Noise,
) {
    let travels: Vec<(usize, f64)> =
        (0..4).filter_map(|wheel| Some((wheel, grid.travel(wheel)?))).collect();
    let typical = typical(&travels);
    let quantum = noise.quantum.iter().copied().fold(0.0, f64::max);
    let least = (SHORTEST * vehicle.wheelbase).max(FEWEST_COUNTS * quantum);
    if typical < least {
        let evidence = format!("its wheels roll {typical:.2} m; {least:.2} m are the least");
        found.forbid(Problem::TooShort, evidence);
        return;
    }
    let multiple = multiple(vehicle);
    for (wheel, travel) in &travels {
        if !stuck(found, grid, *wheel, vehicle) {
            let ratio = travel / typical;
            if !(1.0 / multiple..=multiple).contains(&ratio) {
                let evidence = format!("{ratio:.2} times what the others roll");
                found.forbid(Problem::WheelScale(WHEELS[*wheel]), evidence);
            }
        }
    }
    if !spins(run, typical) {
        signs(found, grid, &travels);
    }
}

/// Increments that no vehicle of this speed rolls.
pub(crate) fn check_jumps(found: &mut Findings, run: &Run, vehicle: &Vehicle, noise: &Noise) {
    for wheel in WHEELS {
        let Some(series) = &run.rotation[wheel.index()] else { continue };
        let radius = vehicle.radius[wheel.index()];
        let slack = 10.0 * noise.quantum[wheel.index()] + SLACK * vehicle.wheelbase;
        let leaps = |from: usize, to: usize| {
            let step = (series.value[to] - series.value[from]).abs() * radius;
            step > FASTEST * vehicle.limits.speed * (series.t[to] - series.t[from]) + slack
        };
        // A row whose stamp alone is late leaps by itself, but not together with its neighbours.
        let last = series.len().saturating_sub(1);
        let jump = |k: &usize| leaps(*k - 1, *k) && leaps(k.saturating_sub(2), last.min(*k + 1));
        if let Some(k) = (1..series.len()).find(jump) {
            let evidence = format!(
                "by {:.2} m between {} s and {} s",
                (series.value[k] - series.value[k - 1]) * radius,
                series.t[k - 1],
                series.t[k]
            );
            found.forbid(Problem::Jump(wheel), evidence);
        }
    }
}

/// Ratio of travels that no curve of the vehicle explains: infinite where it turns about one of its wheels.
fn multiple(vehicle: &Vehicle) -> f64 {
    let radius = vehicle.wheelbase / math::tan(vehicle.limits.steering.min(1.57));
    let half = 0.5 * vehicle.track_rear;
    if radius <= half {
        return f64::INFINITY;
    }
    MULTIPLE.max(1.2 * (radius + half) / (radius - half))
}

/// Upper median.
fn typical(travels: &[(usize, f64)]) -> f64 {
    let mut sorted: Vec<f64> = travels.iter().map(|(_, travel)| *travel).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Whether the wheel stands still over a stretch that the others roll.
fn stuck(found: &mut Findings, grid: &Grid, wheel: usize, vehicle: &Vehicle) -> bool {
    let Some(own) = &grid.wheels[wheel] else { return false };
    let others: Vec<&Vec<f64>> =
        (0..4).filter(|other| *other != wheel).filter_map(|w| grid.wheels[w].as_ref()).collect();
    if others.is_empty() {
        return false;
    }
    let rolled = |k: usize| others.iter().map(|other| other[k].abs()).fold(0.0, f64::max);
    let common = sums(&(0..grid.steps()).map(rolled).collect::<Vec<_>>());
    let own = sums(&own.iter().map(|step| step.abs()).collect::<Vec<_>>());
    let stretch = STRETCH * vehicle.wheelbase;
    let mut begin = 0;
    for end in 1..common.len() {
        while common[end] - common[begin + 1] >= stretch {
            begin += 1;
        }
        let length = common[end] - common[begin];
        if length >= stretch && own[end] - own[begin] < STUCK * length {
            let evidence = format!(
                "from {:.1} s to {:.1} s it rolls {:.4} m while others roll {length:.2} m",
                grid.t[begin],
                grid.t[end],
                own[end] - own[begin]
            );
            found.forbid(Problem::StuckWheel(WHEELS[wheel]), evidence);
            return true;
        }
    }
    false
}

/// Whether the vehicle turns on the spot: its wheels roll and the reference stays.
fn spins(run: &Run, rolled: f64) -> bool {
    let Some(first) = run.reference.first() else { return false };
    let away = run.reference.iter().map(|r| math::hypot(r.x - first.x, r.y - first.y));
    let turned = run.reference.iter().filter_map(|r| Some((r.yaw? - first.yaw?).abs()));
    away.fold(0.0, f64::max) < SPINS * rolled && turned.fold(0.0, f64::max) > 1.0
}

/// Wheels that go against the majority count backwards.
fn signs(found: &mut Findings, grid: &mut Grid, travels: &[(usize, f64)]) {
    let Some((first, _)) = travels.first() else { return };
    let mut signs = [1.0; 4];
    let (mut with, mut against) = (Vec::new(), Vec::new());
    for (wheel, _) in travels {
        if agreement(grid, *first, *wheel) < -0.5 {
            signs[*wheel] = -1.0;
            against.push(*wheel);
        } else {
            with.push(*wheel);
        }
    }
    if against.is_empty() {
        return;
    }
    let names = |wheels: &[usize]| {
        wheels.iter().map(|wheel| WHEELS[*wheel].name()).collect::<Vec<_>>().join(" and ")
    };
    if with.len() == against.len() {
        let evidence = format!("{} against {}", names(&with), names(&against));
        found.forbid(Problem::ContraryWheels, evidence);
        return;
    }
    let (few, many) =
        if with.len() < against.len() { (&with, &against) } else { (&against, &with) };
    if few.contains(first) {
        signs = signs.map(|sign| -sign);
    }
    for wheel in few {
        let evidence = format!(
            "it goes back where {} go forward, correlation {:.2}",
            names(many),
            agreement(grid, many[0], *wheel)
        );
        found.forbid(Problem::ReversedWheel(WHEELS[*wheel]), evidence);
    }
    grid.set_distance(signs);
}

/// Correlation of two wheels' steps about 0.
fn agreement(grid: &Grid, a: usize, b: usize) -> f64 {
    let (Some(a), Some(b)) = (&grid.wheels[a], &grid.wheels[b]) else { return 0.0 };
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let size = (product(a, a) * product(b, b)).sqrt();
    if size > 0.0 { product(a, b) / size } else { 0.0 }
}
