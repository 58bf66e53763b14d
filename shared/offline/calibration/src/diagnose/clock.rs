//! A reference whose stamps are of another clock: its motion is the wheels' of another time.

use kerbside_geometry::{Vehicle, angle, math};

use nalgebra::{Matrix2, Vector2};

use super::grid::{Grid, sums};
use super::{Findings, Problem};
use crate::noise::Noise;
use crate::run::{ReferencePose, Run};

/// Offsets that are looked for, and their step \[s\].
const FARTHEST: f64 = 3.0;
const STEP: f64 = 0.02;
/// Offsets below this are the sensors' own \[s\]; so are those within so many deviations of a lag that is stated.
const LEAST: f64 = 0.05;
const STATED: f64 = 2.0;
/// Time over which motion is compared \[s\].
const WINDOW: f64 = 1.0;
/// Readings without which nothing is said, and how far apart they may be \[s\].
const FEWEST: usize = 20;
const SPARSEST: f64 = 0.5;
/// How much better than at offset 0 the motions must agree, in units of what is left per reading; and the share of
/// what does not agree at offset 0 that may be left: a nominal vehicle that is wrong disagrees at any offset.
const BETTER: f64 = 30.0;
const LEFT: f64 = 0.5;

/// Motion between two readings of the reference.
struct Stretch {
    from: f64,
    to: f64,
    length: f64,
    turn: Option<f64>,
}

/// Notes an offset between the reference's clock and the wheels', found by correlating speed and turn.
pub(crate) fn check(
    found: &mut Findings,
    run: &Run,
    grid: &Grid,
    vehicle: &Vehicle,
    noise: &Noise,
) {
    let readings = &run.reference;
    let (Some(first), Some(last)) = (readings.first(), readings.last()) else { return };
    #[allow(clippy::cast_precision_loss)] // readings
    let apart = (last.t - first.t) / readings.len().max(2) as f64;
    if readings.len() < FEWEST || apart > SPARSEST {
        return;
    }
    let stretches = stretches(readings);
    let (distance, turn) = (sums(&grid.distance), sums(&grid.turn()));
    // Chords are told from noise by the wheelbase's scale, turns by the heading's noise.
    let lever = 0.5 * vehicle.wheelbase;
    let misfit = |offset: f64| misfit(grid, &stretches, (&distance, &turn), offset, lever);
    #[allow(clippy::cast_possible_truncation)] // some hundreds
    let steps = (FARTHEST / STEP) as i32;
    let offsets = (-steps..=steps).map(|step| f64::from(step) * STEP);
    let all: Vec<(f64, f64)> = offsets.map(|offset| (offset, misfit(offset))).collect();
    let Some(best) = all.iter().min_by(|a, b| a.1.total_cmp(&b.1)).copied() else { return };
    #[allow(clippy::cast_precision_loss)] // readings
    let per_reading =
        best.1 / stretches.len() as f64 + 2.0 * noise.position * noise.position * apart / WINDOW;
    let now = misfit(0.0);
    let better = (now - best.1) / per_reading;
    let least = LEAST.max(STATED * noise.reference_lag);
    if best.0.abs() >= least && better > BETTER && best.1 < LEFT * now {
        let evidence = format!(
            "its motion is the wheels' of {:.2} s {}",
            best.0.abs(),
            if best.0 > 0.0 { "before" } else { "later" }
        );
        found.forbid(Problem::OtherClock, evidence);
    }
}

fn stretches(readings: &[ReferencePose]) -> Vec<Stretch> {
    let mut list = Vec::new();
    let mut end = 0;
    for first in readings {
        while end < readings.len() && readings[end].t - first.t < WINDOW {
            end += 1;
        }
        let Some(last) = readings.get(end) else { break };
        list.push(Stretch {
            from: first.t,
            to: last.t,
            length: math::hypot(last.x - first.x, last.y - first.y),
            turn: first.yaw.zip(last.yaw).map(|(from, to)| angle::wrap(to - from)),
        });
    }
    list
}

/// Sum of squares by which the reference's motion misses the wheels' of `offset` \[s\] earlier \[m^2\]. Distance and turn
/// are each free in the wheels' distance and turn: radii, tracks and steering zero of the nominal vehicle may be wrong.
fn misfit(
    grid: &Grid,
    stretches: &[Stretch],
    (distance, turn): (&[f64], &[f64]),
    offset: f64,
    lever: f64,
) -> f64 {
    let between =
        |sums: &[f64], s: &Stretch| grid.at(sums, s.to - offset) - grid.at(sums, s.from - offset);
    let mut chord = Plane::default();
    let mut heading = Plane::default();
    for stretch in stretches {
        let (gone, turned) = (between(distance, stretch), between(turn, stretch));
        let straight = gone * math::sinc(0.5 * turned);
        chord.add([straight, turned * lever], stretch.length.copysign(gone));
        if let Some(read) = stretch.turn {
            heading.add([gone, turned * lever], read * lever);
        }
    }
    chord.left() + heading.left()
}

/// Least squares of y = a x1 + b x2.
#[derive(Default)]
struct Plane {
    xx: Matrix2<f64>,
    xy: Vector2<f64>,
    yy: f64,
}

impl Plane {
    fn add(&mut self, x: [f64; 2], y: f64) {
        let x = Vector2::from(x);
        self.xx += x * x.transpose();
        self.xy += x * y;
        self.yy += y * y;
    }

    /// Sum of squares that is left.
    fn left(&self) -> f64 {
        // A regressor that is never there takes nothing.
        let faint = Matrix2::identity() * (1e-9 * self.xx.trace() + f64::MIN_POSITIVE);
        let solved = (self.xx + faint).cholesky().map(|inverse| inverse.solve(&self.xy));
        self.yy - solved.map_or(0.0, |solved| solved.dot(&self.xy))
    }
}
