//! To which side the vehicle turns, by every source that tells; the minority is wrong.

use kerbside_geometry::{Vehicle, angle};

use super::grid::{Grid, chords, sums};
use super::{Findings, Problem};
use crate::noise::Noise;
use crate::run::Run;

/// Net or gross turn from which a run counts as turning \[rad\].
pub(crate) const TURNS: f64 = 0.7;
/// Turn by name that does not turn \[rad\].
const STRAIGHT: f64 = 0.2;
/// Stretch over which turns are compared, per wheelbase.
const STRETCH: f64 = 0.5;

/// A source of turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Rear,
    Front,
    Steering,
    Gyro,
    Yaw,
    Course,
}

impl Source {
    const fn name(self) -> &'static str {
        match self {
            Self::Rear => "rear wheels",
            Self::Front => "front wheels",
            Self::Steering => "steering",
            Self::Gyro => "gyro",
            Self::Yaw => "reference heading",
            Self::Course => "reference positions",
        }
    }

    const fn problem(self) -> Problem {
        match self {
            Self::Rear => Problem::SwappedSides { front: false },
            Self::Front => Problem::SwappedSides { front: true },
            Self::Steering => Problem::ReversedSteering,
            Self::Gyro => Problem::ReversedGyro,
            Self::Yaw => Problem::ReversedYaw,
            Self::Course => Problem::MirroredReference,
        }
    }
}

/// Gross turn of the run \[rad\]; notes sources that turn to the wrong side.
pub(crate) fn check(
    found: &mut Findings,
    run: &Run,
    grid: &Grid,
    vehicle: &Vehicle,
    noise: &Noise,
) -> f64 {
    let stretch = STRETCH * vehicle.wheelbase;
    let sensors = sensors(run, grid, stretch);
    let gross = |turns: &[f64]| turns.iter().map(|turn| turn.abs()).sum::<f64>();
    // The least that any source sees: a straight run's noise is not a turn.
    let turned = sensors.iter().map(|(_, turns)| gross(turns)).fold(f64::INFINITY, f64::min);
    let turned = if turned.is_finite() { turned } else { 0.0 };
    let name = run.manoeuvre.to_lowercase();
    let by_name = ["circle", "arc", "turn", "slalom"].iter().any(|word| name.contains(word));
    if by_name && turned < STRAIGHT {
        let evidence = format!(
            "called {}, it turns by {:.1} degrees in all",
            run.manoeuvre,
            angle::degrees(turned).abs()
        );
        found.add(Problem::NoTurning, evidence, false);
    }
    vote(found, run, grid, &sensors, (stretch, noise));
    turned
}

/// Turns over stretches of travel, by every source on board.
fn sensors(run: &Run, grid: &Grid, stretch: f64) -> Vec<(Source, Vec<f64>)> {
    let rolled = sums(&grid.rolled());
    let mut ends = vec![0];
    for index in 1..rolled.len() {
        if rolled[index] - rolled[ends[ends.len() - 1]] >= stretch {
            ends.push(index);
        }
    }
    let over = |turns: Vec<f64>| {
        let sums = sums(&turns);
        ends.windows(2).map(|pair| sums[pair[1]] - sums[pair[0]]).collect::<Vec<f64>>()
    };
    let gyro = run.yaw_rate.as_ref().map(|series| {
        let bias = rest(grid, series);
        let step = grid.t[1] - grid.t[0];
        grid.t.windows(2).map(|pair| (series.at(0.5 * (pair[0] + pair[1])) - bias) * step).collect()
    });
    [
        (Source::Rear, grid.rear_turn()),
        (Source::Front, grid.front_turn()),
        (Source::Steering, grid.steering_turn()),
        (Source::Gyro, gyro),
    ]
    .into_iter()
    .filter_map(|(source, turns)| Some((source, over(turns?))))
    .collect()
}

/// The gyro's mean while no wheel moves \[rad/s\]; 0 where there is no rest.
fn rest(grid: &Grid, gyro: &crate::run::Series) -> f64 {
    let resting = (0..grid.steps()).filter(|k| grid.distance[*k] == 0.0);
    let rates: Vec<f64> = resting.map(|k| gyro.at(grid.t[k])).collect();
    if rates.is_empty() {
        return 0.0;
    }
    #[allow(clippy::cast_precision_loss)] // steps
    let count = rates.len() as f64;
    rates.iter().sum::<f64>() / count
}

/// 1 where two sources turn to the same side, -1 to contrary sides, 0 where they do not tell.
fn side(a: &[f64], b: &[f64]) -> f64 {
    let gross = |turns: &[f64]| turns.iter().map(|turn| turn.abs()).sum::<f64>();
    let sum = |of: fn(f64, f64) -> f64| {
        a.iter().zip(b).map(|(a, b)| of(*a, *b) * of(*a, *b)).sum::<f64>()
    };
    if gross(a).min(gross(b)) < 0.5 * TURNS {
        return 0.0;
    }
    let (same, contrary) = (sum(|a, b| a - b), sum(|a, b| a + b));
    if same > 4.0 * contrary {
        -1.0
    } else if contrary > 4.0 * same {
        1.0
    } else {
        0.0
    }
}

/// The same for turns that are known up to whole turns: `pairs` of a reference's and the wheels' turn, and the
/// deviation of the reference's.
fn side_of_reference(pairs: &[(f64, f64)], deviation: f64) -> f64 {
    let misfit = |sign: f64| {
        let of =
            |(read, rolled): &(f64, f64)| 1.0 - kerbside_geometry::math::cos(read - sign * rolled);
        pairs.iter().map(of).sum::<f64>()
    };
    let (same, contrary) = (misfit(1.0), misfit(-1.0));
    #[allow(clippy::cast_precision_loss)] // chords
    let floor = 0.1 + 6.0 * deviation * deviation * pairs.len() as f64;
    if same > 3.0 * contrary && same - contrary > floor {
        -1.0
    } else if contrary > 3.0 * same && contrary - same > floor {
        1.0
    } else {
        0.0
    }
}

/// Finds the sources that turn to the other side than most.
fn vote(
    found: &mut Findings,
    run: &Run,
    grid: &Grid,
    sensors: &[(Source, Vec<f64>)],
    (stretch, noise): (f64, &Noise),
) {
    // Each source's side against the first that tells the wheels' turn on the grid.
    let Some((_, first)) = sensors.first() else { return };
    let mut sides: Vec<(Source, f64)> =
        sensors.iter().map(|(source, turns)| (*source, side(first, turns))).collect();
    sides.extend(reference_sides(run, grid, stretch, noise));
    sides.retain(|(_, side)| *side != 0.0);
    let of = |wanted: f64| -> Vec<Source> {
        sides.iter().filter(|(_, side)| *side == wanted).map(|(source, _)| *source).collect()
    };
    let (with, against) = (of(1.0), of(-1.0));
    if against.is_empty() || with.is_empty() {
        return;
    }
    let names = |sources: &[Source]| {
        sources.iter().map(|source| source.name()).collect::<Vec<_>>().join(", ")
    };
    let evidence = format!("{} against {}", names(&against), names(&with));
    if with.len() == against.len() {
        found.forbid(Problem::ContraryTurns, evidence);
        return;
    }
    let few = if with.len() < against.len() { with } else { against };
    let mirrored = few.contains(&Source::Yaw) && few.contains(&Source::Course);
    for source in few {
        // Heading and positions both: one frame, one finding.
        if !(mirrored && source == Source::Yaw) {
            found.forbid(source.problem(), evidence.clone());
        }
    }
}

/// Sides of the reference's heading and course, against the turn that the grid's wheels see.
fn reference_sides(run: &Run, grid: &Grid, stretch: f64, noise: &Noise) -> Vec<(Source, f64)> {
    let least = stretch.max(10.0 * noise.position);
    let all = chords(run, grid, least);
    let mut yaws = Vec::new();
    // Short chords of noisy headings are laid together until they turn enough.
    let (mut read, mut rolled) = (0.0, 0.0);
    for chord in &all {
        let Some((from, to)) = chord.yaws else { continue };
        read += to - from;
        rolled += chord.turn;
        if rolled.abs() > 0.3 {
            yaws.push((read, rolled));
            (read, rolled) = (0.0, 0.0);
        }
    }
    let turns = sums(&grid.turn());
    let mut courses = Vec::new();
    for pair in all.windows(2).filter(|pair| pair[0].is_plain() && pair[1].is_plain()) {
        if pair[0].distance * pair[1].distance > 0.0 {
            let middle = |chord: &super::grid::Chord| 0.5 * (chord.from + chord.to);
            let rolled = grid.at(&turns, middle(&pair[1])) - grid.at(&turns, middle(&pair[0]));
            courses.push((pair[1].course - pair[0].course, rolled));
        }
    }
    let course_deviation = 2.0 * noise.position / least;
    let mut sides = vec![(Source::Yaw, side_of_reference(&yaws, noise.yaw))];
    sides.push((Source::Course, side_of_reference(&courses, course_deviation)));
    sides
}
