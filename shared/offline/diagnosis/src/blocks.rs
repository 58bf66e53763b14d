//! Recordings as they come, cut into pieces that can stand as runs: a single long log, one with gaps, one whose
//! stamps begin anywhere. Runs that are as asked for stay as they are.

use crate::bins::to_f64;
use crate::case::{Case, Run, Wheels};
use crate::follow::spots;
use crate::outliers::drop_outliers;
use crate::path::driven_share;
use crate::prepare::LEAD;
use kerbside_simulation::Command;

/// Runs that are asked for.
pub(crate) const ENOUGH: usize = 6;
/// With fewer runs one longer than this is cut \[s\].
const LONG: f64 = 30.0;
/// With enough runs one longer than this is cut \[s\].
const VERY_LONG: f64 = 240.0;
/// Blocks that are aimed at.
const BLOCKS: f64 = 12.0;
/// Shortest and longest block \[s\].
const BLOCK: (f64, f64) = (8.0, 25.0);
/// Longest time without a wheel's reading within a piece \[s\].
const GAP: f64 = 1.0;
/// A speed of so many times the vehicle's limit is a step of clock or counter.
const IMPOSSIBLE: f64 = 2.5;
/// Shortest piece that is kept where there are others \[s\].
const SHORTEST: f64 = 3.0;
/// Stamps that begin farther than this from 0 are counted from the first \[s\].
const ELSEWHERE: f64 = 60.0;
/// Standard deviations of its stated noise within which a row never stands out.
const SURELY: f64 = 6.0;
/// Commands that are kept from before a block \[s\]: those that its first motion comes from, and what they follow.
const BEFORE: f64 = 2.0 * LEAD;
/// All that is looked at \[s\]: more would say no more, and take longer.
const MOST: f64 = 600.0;
/// All that mistakes are looked for in \[s\].
const EXCERPT: f64 = 240.0;

/// A case whose runs can stand as they are.
#[derive(Debug)]
pub(crate) struct Cut {
    pub case: Case,
    /// Of which recorded run each is a piece.
    pub drives: Vec<usize>,
    /// What was done, a sentence each.
    pub notices: Vec<String>,
}

/// Cuts what needs cutting.
pub(crate) fn cut(case: &Case) -> Cut {
    let mut notices = Vec::new();
    let runs: Vec<Run> = case
        .runs
        .iter()
        .map(|run| plausible(from_zero(run, &mut notices), case, &mut notices))
        .collect();
    let mut pieces: Vec<(usize, f64, f64)> = Vec::new();
    for (drive, run) in runs.iter().enumerate() {
        let whole = without_spots(unbroken(run, case, &mut notices), run, case, &mut notices);
        let kept = whole.iter().filter(|(begin, end)| end - begin >= SHORTEST || whole.len() == 1);
        pieces.extend(kept.map(|(begin, end)| (drive, *begin, *end)));
    }
    let total: f64 = pieces.iter().map(|(_, begin, end)| end - begin).sum();
    let few = case.runs.len() < ENOUGH;
    let (longest, length) = if few {
        (LONG, (total / BLOCKS).clamp(BLOCK.0, BLOCK.1))
    } else {
        (VERY_LONG, if total > MOST { BLOCK.1 } else { 0.5 * VERY_LONG })
    };
    let blocks: Vec<(usize, f64, f64)> = pieces
        .into_iter()
        .flat_map(|(drive, begin, end)| {
            let longer = end - begin > longest || total > MOST;
            let count = if longer { ((end - begin) / length).round().max(1.0) } else { 1.0 };
            let edge = move |k: f64| begin + (end - begin) * k / count;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // few and positive
            (0..count as usize).map(move |k| (drive, edge(to_f64(k)), edge(to_f64(k + 1))))
        })
        .collect();
    if blocks.len() > runs.len() {
        let drives = if runs.len() == 1 { "drive" } else { "drives" };
        notices.push(format!(
            "{} blocks of {} {drives} serve as runs, and count for fewer",
            blocks.len(),
            runs.len()
        ));
    }
    let blocks = spread(blocks, MOST, &mut notices);
    let (mut cut, mut drives) = (Vec::new(), Vec::new());
    for (drive, begin, end) in blocks {
        let run = &runs[drive];
        let (first, last) = run.span();
        let whole = begin <= first && end >= last;
        cut.push(if whole { run.clone() } else { block(run, begin, end) });
        drives.push(drive);
    }
    Cut { case: Case { runs: cut, ..case.clone() }, drives, notices }
}

/// Some of a case's runs, spread evenly: what is wrong with all of them shows in these.
pub(crate) fn excerpt(case: &Case) -> Case {
    let spans = case.runs.iter().enumerate().map(|(i, run)| (i, run.span().0, run.span().1));
    let kept = spread(spans.collect(), EXCERPT, &mut Vec::new());
    Case { runs: kept.into_iter().map(|(i, ..)| case.runs[i].clone()).collect(), ..case.clone() }
}

/// As many of the pieces, spread evenly, as last `most` seconds together.
fn spread(
    pieces: Vec<(usize, f64, f64)>,
    most: f64,
    notices: &mut Vec<String>,
) -> Vec<(usize, f64, f64)> {
    let total: f64 = pieces.iter().map(|(_, begin, end)| end - begin).sum();
    if total <= most {
        return pieces;
    }
    let (all, share) = (pieces.len(), most / total);
    let kept: Vec<_> = pieces
        .into_iter()
        .enumerate()
        .filter(|(k, _)| (to_f64(k + 1) * share).floor() > (to_f64(*k) * share).floor())
        .map(|(_, piece)| piece)
        .collect();
    notices.push(format!(
        "{:.0} minutes were recorded: {} of {all} blocks, spread evenly, are looked at",
        total / 60.0,
        kept.len()
    ));
    kept
}

/// A run whose stamps begin near 0.
fn from_zero(recorded: &Run, notices: &mut Vec<String>) -> Run {
    let (first, _) = recorded.span();
    if !first.is_finite() || first.abs() <= ELSEWHERE {
        return recorded.clone();
    }
    notices.push(format!(
        "{}: stamps begin at {first:.1} s and are counted from there",
        recorded.name
    ));
    let mut run = block(recorded, first, f64::INFINITY);
    run.name.clone_from(&recorded.name);
    run.repeat_of.clone_from(&recorded.repeat_of);
    run
}

/// A run without rows that stand out from their neighbours.
fn plausible(mut run: Run, case: &Case, notices: &mut Vec<String>) -> Run {
    let limits = &case.vehicle.limits;
    let period = |span: Option<(f64, f64)>, rows: usize| {
        span.map_or(0.0, |(begin, end)| (end - begin) / to_f64(rows.max(2) - 1))
    };
    let mut tell = |name: &str, dropped: usize, all: usize| {
        if dropped > 0 {
            notices.push(format!(
                "{}: {dropped} of {all} rows of {name} stand out from their neighbours and are left out",
                run.name
            ));
        }
    };
    let rows = run.reference.t.len();
    let dt = period(run.reference.span(), rows);
    let (position, yaw) =
        case.vehicle.reference.map_or((0.0, 0.0), |r| (r.position_noise, r.yaw_noise));
    let position = SURELY * position + limits.acceleration * dt * dt;
    let turn = limits.speed * limits.steering_rate / case.vehicle.wheelbase * dt * dt;
    let yaw = SURELY * yaw + turn;
    let columns = [(0, position), (1, position), (2, yaw)];
    tell("reference.csv", drop_outliers(&mut run.reference, &columns), rows);
    let rows = run.gyro.t.len();
    let dt = period(run.gyro.span(), rows);
    let noise = case.vehicle.gyro.map_or(0.0, |gyro| gyro.noise);
    let turn = limits.speed * limits.steering_rate / case.vehicle.wheelbase * dt;
    tell("imu.csv", drop_outliers(&mut run.gyro, &[(0, SURELY * noise + turn)]), rows);
    run
}

/// Spans of a run \[s\] between gaps and impossible steps of its wheels.
fn unbroken(run: &Run, case: &Case, notices: &mut Vec<String>) -> Vec<(f64, f64)> {
    let (first, last) = run.span();
    let series = run.wheels.series();
    let limit = IMPOSSIBLE * case.vehicle.limits.speed.max(1e-3);
    let mut spans = Vec::new();
    let mut begin = first;
    let mut broken = |begin: &mut f64, before: f64, after: f64, why: &str| {
        notices.push(format!("{}: cut at {before:.1} s: {why}", run.name));
        spans.push((*begin, before));
        *begin = after;
    };
    let share = driven_share(&case.vehicle);
    let used: Vec<usize> = (0..4).filter(|w| series.has(*w)).collect();
    let driven: Vec<usize> = used.iter().copied().filter(|w| share[*w] > 0.0).collect();
    let used = if driven.is_empty() { used } else { driven };
    let mut earlier: Option<(f64, [f64; 4])> = None;
    for (t, row) in series.t.iter().zip(&series.value) {
        if used.iter().any(|wheel| !row[*wheel].is_finite()) {
            continue;
        }
        if let Some((before, from)) = earlier {
            let speed = |wheel: &usize| match &run.wheels {
                Wheels::Rotation(_) => {
                    (row[*wheel] - from[*wheel]).abs() * case.vehicle.radius[*wheel]
                        / (t - before).max(0.02)
                }
                Wheels::Speed(_) => 0.0,
            };
            if t - before > GAP && !run.has_commands() {
                let why = format!("no wheel was read for {:.1} s", t - before);
                broken(&mut begin, before, *t, &why);
            } else if used.iter().any(|wheel| speed(wheel) > limit) {
                let why = "the wheels' counters step farther than the vehicle can go";
                broken(&mut begin, before, *t, why);
            }
        }
        earlier = Some((*t, *row));
    }
    spans.push((begin, last));
    spans
}

/// The same without turns on the spot, where what was measured drives the model.
fn without_spots(
    spans: Vec<(f64, f64)>,
    run: &Run,
    case: &Case,
    notices: &mut Vec<String>,
) -> Vec<(f64, f64)> {
    let spots = if run.has_commands() { Vec::new() } else { spots(run, &case.vehicle) };
    if spots.is_empty() {
        return spans;
    }
    notices.push(format!(
        "{}: {} left out: the model of a steered axle does not reach so far",
        run.name,
        if spots.len() == 1 {
            "a turn on the spot is".to_owned()
        } else {
            format!("{} turns on the spot are", spots.len())
        }
    ));
    let mut left = spans;
    for (from, to) in spots {
        let parts = |(begin, end): (f64, f64)| [(begin, end.min(from)), (begin.max(to), end)];
        left = left.into_iter().flat_map(parts).filter(|(begin, end)| end > begin).collect();
    }
    left.retain(|(begin, end)| end - begin >= SHORTEST);
    left
}

/// Rotations counted from the first reading of each wheel.
fn from_nothing(wheels: &mut crate::case::Series<4>) {
    for wheel in 0..4 {
        let first = wheels.value.iter().map(|row| row[wheel]).find(|turn| turn.is_finite());
        if let Some(first) = first {
            wheels.value.iter_mut().for_each(|row| row[wheel] -= first);
        }
    }
}

/// The piece of a run between two stamps \[s\], its own stamps counted from its begin.
fn block(run: &Run, begin: f64, end: f64) -> Run {
    // What is stamped at the end of the last block belongs to it.
    let end = if end >= run.span().1 { f64::INFINITY } else { end };
    fn piece<const N: usize>(
        series: &crate::case::Series<N>,
        begin: f64,
        end: f64,
    ) -> crate::case::Series<N> {
        let mut series = series.between(begin, end);
        series.t.iter_mut().for_each(|t| *t -= begin);
        series
    }
    let mut wheels = piece(run.wheels.series(), begin, end);
    if matches!(run.wheels, Wheels::Rotation(_)) {
        from_nothing(&mut wheels);
    }
    let acts = run.commands.partition_point(|command| command.t < begin - BEFORE);
    let until = run.commands.partition_point(|command| command.t < end);
    // The one before holds until then.
    let commands = run.commands[acts.saturating_sub(1)..until]
        .iter()
        .map(|command| Command { t: command.t - begin, ..*command });
    Run {
        name: format!("{} from {begin:.0} s", run.name),
        repeat_of: None,
        start: run.start.filter(|_| begin <= 0.0),
        commands: commands.collect(),
        wheels: match &run.wheels {
            Wheels::Rotation(_) => Wheels::Rotation(wheels),
            Wheels::Speed(_) => Wheels::Speed(wheels),
        },
        steering: piece(&run.steering, begin, end),
        gyro: piece(&run.gyro, begin, end),
        reference: piece(&run.reference, begin, end),
    }
}
