//! A reference in other units, or whose heading is turned against its positions.

use core::f64::consts::{PI, TAU};

use kerbside_geometry::{Vehicle, angle};

use super::grid::{Grid, chords, mean_direction, sums};
use super::{Findings, Problem};
use crate::noise::Noise;
use crate::run::Run;

/// Reference over wheels, beyond which no calibration explains it.
const SCALE: f64 = 1.25;
/// A steering reading beyond this is not in radians \[rad\].
const LARGEST_STEERING: f64 = 1.75;
/// Heading against course from which it is not a matter of mounting \[rad\].
const TURNED: f64 = 0.26;

/// Units of other people's trackers.
const UNITS: [(&str, f64); 5] = [
    ("millimetres", 1000.0),
    ("centimetres", 100.0),
    ("inches", 39.37),
    ("feet", 3.281),
    ("kilometres", 0.001),
];

/// Positions that are not in metres; heading and steering that are not in radians.
pub(crate) fn check_units(
    found: &mut Findings,
    run: &Run,
    grid: &Grid,
    vehicle: &Vehicle,
    noise: &Noise,
) {
    let largest = |values: &[f64]| values.iter().map(|value| value.abs()).fold(0.0, f64::max);
    if let Some(steering) = &run.steering
        && largest(&steering.value) > LARGEST_STEERING
    {
        let evidence =
            format!("it reads up to {:.1}: degrees instead of radians?", largest(&steering.value));
        found.forbid(Problem::SteeringUnit, evidence);
    }
    if !grid.tells_turn() {
        // Nothing on board to hold a heading or a way against.
        return;
    }
    let yaws: Vec<f64> = run.reference.iter().filter_map(|reading| reading.yaw).collect();
    let spread = yaws.iter().copied().fold(f64::NEG_INFINITY, f64::max)
        - yaws.iter().copied().fold(f64::INFINITY, f64::min);
    let turned = largest(&sums(&grid.turn()));
    if spread > 1.5 * turned + TAU + 1.0 {
        let evidence = format!(
            "it spans {spread:.1} while the wheels turn by {turned:.1} rad: degrees instead of radians?"
        );
        found.forbid(Problem::YawUnit, evidence);
    }
    check_scale(found, run, grid, vehicle, noise);
}

fn check_scale(found: &mut Findings, run: &Run, grid: &Grid, vehicle: &Vehicle, noise: &Noise) {
    let (mut read, mut rolled, mut count) = (0.0, 0.0, 0.0);
    let least = vehicle.wheelbase.max(10.0 * noise.position);
    for chord in chords(run, grid, least).iter().filter(|chord| chord.is_plain()) {
        read += chord.length;
        rolled += chord.by_wheels();
        count += 1.0;
    }
    let chance = 6.0 * (2.0 * f64::max(count, 1.0)).sqrt() * noise.position;
    if rolled < vehicle.wheelbase || (read - rolled).abs() < chance {
        return;
    }
    let ratio = read / rolled;
    if (1.0 / SCALE..=SCALE).contains(&ratio) {
        return;
    }
    let unit = UNITS.iter().find(|(_, factor)| (0.8..1.25).contains(&(ratio / factor)));
    let guess = unit.map_or(String::new(), |(name, _)| format!(": {name}?"));
    let evidence =
        format!("it goes {read:.3} where the wheels roll {rolled:.3} m, {ratio:.3} times{guess}");
    found.forbid(Problem::PositionUnit, evidence);
}

/// Heading against course over ground.
pub(crate) fn check_frame(
    found: &mut Findings,
    run: &Run,
    grid: &Grid,
    noise: &Noise,
    vehicle: &Vehicle,
) {
    let least = vehicle.wheelbase.max(10.0 * noise.position);
    let mut offsets = Vec::new();
    for chord in chords(run, grid, least).iter().filter(|chord| chord.is_plain()) {
        let Some((from, to)) = chord.yaws else { continue };
        // Along an arc the chord's direction is the mean of the headings at its ends.
        let heading = from + 0.5 * angle::wrap(to - from);
        let backwards = if chord.distance < 0.0 { PI } else { 0.0 };
        if chord.length > 0.5 * least && (angle::wrap(to - from) - chord.turn).abs() < 1.0 {
            offsets.push(angle::wrap(heading + backwards - chord.course));
        }
    }
    if offsets.is_empty() {
        return;
    }
    #[allow(clippy::cast_precision_loss)] // chords
    let count = offsets.len() as f64;
    let single = noise.yaw + 2.0 * noise.position / least;
    let offset = mean_direction(&offsets);
    if offset.abs() > TURNED.max(5.0 * single / count.sqrt()) {
        let evidence = format!(
            "it points {:.0} degrees to the side of the way, over {} stretches",
            angle::degrees(offset),
            offsets.len()
        );
        found.forbid(Problem::TurnedYaw, evidence);
    }
}
