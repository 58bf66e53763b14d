//! Where the gap arises: each link is fed with what was measured before it, and what its output then still differs by
//! over two seconds is held against the noise floor and against what a car in good order may have.

use kerbside_geometry::math;
use kerbside_simulation::effects::Link;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::bench::Bench;
use crate::bins::{self, Channels, to_f64};
use crate::floor::drawn;
use crate::follow::Turn;
use crate::noise::Noise;
use crate::path::driven_share;
use crate::verdict::LinkGap;

/// Time over which a residual is judged \[s\].
pub(crate) const HORIZON: f64 = 2.0;
/// Standard deviations by which a car in good order may differ.
const GOOD_ORDER: f64 = 2.5;
/// Draws of the noise.
const DRAWS: usize = 24;
/// Draws of the bootstrap.
const BOOTSTRAP: usize = 200;
/// Windows in a block of the bootstrap.
const BLOCK: usize = 8;
/// Fewer blocks than these tell no interval.
const FEW: usize = 4;

/// A residual of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    DrivenTravel,
    Steering,
    GyroWheels,
    GyroReference,
    WheelYaw,
    FrontRear,
    GyroYaw,
    ReferenceYaw,
    Distance,
    Lateral,
}

impl Signal {
    pub(crate) const ALL: [Self; 10] = [
        Self::DrivenTravel,
        Self::Steering,
        Self::GyroWheels,
        Self::GyroReference,
        Self::WheelYaw,
        Self::FrontRear,
        Self::GyroYaw,
        Self::ReferenceYaw,
        Self::Distance,
        Self::Lateral,
    ];

    /// The link it speaks of.
    pub(crate) fn link(self) -> Link {
        match self {
            Self::DrivenTravel => Link::SpeedActuation,
            Self::Steering => Link::SteeringActuation,
            Self::GyroWheels | Self::GyroReference => Link::Sensing,
            Self::WheelYaw
            | Self::FrontRear
            | Self::GyroYaw
            | Self::ReferenceYaw
            | Self::Distance => Link::Ground,
            Self::Lateral => Link::Reference,
        }
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::DrivenTravel => ("travel of the driven wheels", "m"),
            Self::Steering => ("angle at the steering sensor", "rad"),
            Self::GyroWheels => ("turn by the gyro against that by the wheels", "rad"),
            Self::GyroReference => ("turn by the gyro against that of the reference", "rad"),
            Self::WheelYaw => ("turn by the wheels' difference", "rad"),
            Self::FrontRear => ("travel of the front wheels against the rear ones", "m"),
            Self::GyroYaw => ("turn by the gyro", "rad"),
            Self::ReferenceYaw => ("turn of the reference", "rad"),
            Self::Distance => ("distance by the reference", "m"),
            Self::Lateral => ("way to the side by the reference", "m"),
        }
    }
}

/// A signal's windows in one run: the bin in which each begins, and its value.
pub(crate) type Windows = Vec<(usize, f64)>;

/// What one run's residuals make of every signal.
pub(crate) fn windows(bench: &Bench<'_>, run: usize, residuals: &[Channels]) -> Vec<Windows> {
    let forced = forced(bench, run, residuals);
    let width = bench.coefficients[run].width;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let span = (HORIZON / width).round() as usize;
    let share = driven_share(bench.ready.vehicle);
    let vehicle = bench.ready.vehicle;
    let speeds = bench.ready.runs[run].binned.speeds;
    let read = |wheel: usize| residuals.iter().any(|row| row[wheel].is_finite());
    let driven: Vec<usize> = (0..4).filter(|w| share[*w] > 0.0 && read(*w)).collect();
    let travel = |rows: &[Channels], from: usize, wheel: usize| {
        change(rows, from, span, wheel, speeds, width)
    };
    let mean = |rows: &[Channels], from: usize, wheels: &[usize]| {
        let sum: f64 = wheels.iter().map(|wheel| travel(rows, from, *wheel)).sum();
        sum / to_f64(wheels.len())
    };
    let yaw = |rows: &[Channels], from: usize| {
        let axles = [([0, 1], vehicle.track_front), ([2, 3], vehicle.track_rear)];
        // The rear axle shows the turn as it is, the front one at small angles; the rear one where there is one.
        let axle = axles
            .iter()
            .rev()
            .find(|(wheels, track)| *track > 0.0 && wheels.iter().all(|w| read(*w)));
        axle.map_or(f64::NAN, |([left, right], track)| {
            (travel(rows, from, *right) - travel(rows, from, *left)) / track
        })
    };
    let average = |rows: &[Channels], from: usize, channel: usize| {
        let values = rows[from..from + span].iter().map(|row| row[channel]);
        values.sum::<f64>() / to_f64(span)
    };
    let turned = |rows: &[Channels], from: usize| average(rows, from, bins::GYRO) * HORIZON;
    let delta = |rows: &[Channels], from: usize, channel: usize| {
        rows[from + span][channel] - rows[from][channel]
    };
    let count = residuals.len().saturating_sub(span);
    let value = |signal: Signal, from: usize| match signal {
        Signal::DrivenTravel => mean(residuals, from, &driven),
        Signal::Steering => average(residuals, from, bins::STEERING),
        Signal::GyroWheels => turned(residuals, from) - yaw(residuals, from),
        Signal::GyroReference => {
            delta(residuals, from, bins::REFERENCE + 2) - turned(residuals, from)
        }
        Signal::WheelYaw => yaw(&forced, from),
        Signal::FrontRear => {
            let pick = |axle: [usize; 2]| axle.into_iter().filter(|w| read(*w)).collect::<Vec<_>>();
            mean(&forced, from, &pick([0, 1])) - mean(&forced, from, &pick([2, 3]))
        }
        Signal::GyroYaw => turned(&forced, from),
        Signal::ReferenceYaw => delta(&forced, from, bins::REFERENCE + 2),
        Signal::Distance => local(bench, run, &forced, from, span).0,
        Signal::Lateral => local(bench, run, &forced, from, span).1,
    };
    let of = |signal: Signal| {
        (0..count).map(|from| (from, value(signal, from))).filter(|(_, v)| v.is_finite()).collect()
    };
    Signal::ALL.into_iter().map(of).collect()
}

fn change(
    rows: &[Channels],
    from: usize,
    span: usize,
    wheel: usize,
    speeds: bool,
    width: f64,
) -> f64 {
    if speeds {
        rows[from..from + span].iter().map(|row| row[wheel] * width).sum()
    } else {
        rows[from + span][wheel] - rows[from][wheel]
    }
}

/// Where the reference's error went over a window, in the frame of its begin and with its own yaw error taken along.
fn local(bench: &Bench<'_>, run: usize, rows: &[Channels], from: usize, span: usize) -> (f64, f64) {
    let path = &bench.paths[run];
    let pose = |k: usize| &path.pose[k];
    let (a, b) = (&rows[from], &rows[from + span]);
    let turn = pose(from + span).yaw - pose(from).yaw;
    let (sin, cos) = math::sin_cos(turn);
    let (x, y) = (b[bins::REFERENCE], b[bins::REFERENCE + 1]);
    let (x, y) = (cos * x - sin * y, sin * x + cos * y);
    let (s0, c0) = math::sin_cos(pose(from).yaw);
    let (dx, dy) = (pose(from + span).x - pose(from).x, pose(from + span).y - pose(from).y);
    let (along, across) = (c0 * dx + s0 * dy, -s0 * dx + c0 * dy);
    // The mean yaw error over the window, where there is one: what bends the way is told by the turn.
    let yaw: Vec<f64> = rows[from..=from + span]
        .iter()
        .map(|row| row[bins::REFERENCE + 2])
        .filter(|v| v.is_finite())
        .collect();
    let yaw = if yaw.is_empty() { 0.0 } else { yaw.iter().sum::<f64>() / to_f64(yaw.len()) };
    (x - a[bins::REFERENCE] + yaw * across, y - a[bins::REFERENCE + 1] - yaw * along)
}

/// The residuals that are left when the ground is fed with the measured motion of driven wheels and rack.
fn forced(bench: &Bench<'_>, run: usize, residuals: &[Channels]) -> Vec<Channels> {
    let coefficients = &bench.coefficients[run];
    let vehicle = bench.ready.vehicle;
    let share = driven_share(vehicle);
    let speeds = coefficients.speeds;
    let driven: Vec<usize> = (0..4)
        .filter(|w| share[*w] > 0.0 && residuals.iter().any(|row| row[*w].is_finite()))
        .collect();
    let mut left = residuals.to_vec();
    let rack: Vec<f64> = hold(residuals.iter().map(|row| row[bins::STEERING]));
    if residuals.iter().any(|row| row[bins::STEERING].is_finite()) {
        subtract(&mut left, &coefficients.response(4, &rack));
    }
    if !driven.is_empty() {
        let mean =
            |row: &Channels| driven.iter().map(|w| row[*w]).sum::<f64>() / to_f64(driven.len());
        let now: Vec<f64> = hold(left.iter().map(mean));
        let mut size = vec![0.0; left.len()];
        for k in 1..left.len() {
            let step = &bench.paths[run].steps[k - 1];
            let moved = if speeds { now[k] * coefficients.width } else { now[k] - now[k - 1] };
            let slow = 0.02 * vehicle.limits.speed * coefficients.width;
            size[k] = moved * step.distance / (step.distance * step.distance + slow * slow);
        }
        subtract(&mut left, &coefficients.response(0, &size));
    }
    left
}

/// Missing values stay as the last one was.
fn hold(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last = 0.0;
    values
        .map(|value| {
            if value.is_finite() {
                last = value;
            }
            last
        })
        .collect()
}

fn subtract(rows: &mut [Channels], response: &[Channels]) {
    for (row, response) in rows.iter_mut().zip(response) {
        for (value, response) in row.iter_mut().zip(response) {
            *value -= response;
        }
    }
}

/// The floor of every signal in one run, mean square: what noise alone makes of it.
fn floors(bench: &Bench<'_>, noise: &Noise, run: usize) -> Vec<(f64, usize)> {
    let mut random = Pcg64Mcg::seed_from_u64(17 + run as u64);
    let mut sums = vec![(0.0, 0); Signal::ALL.len()];
    for _ in 0..DRAWS {
        let drawn = drawn(bench, noise, run, &mut random);
        for (sum, windows) in sums.iter_mut().zip(windows(bench, run, &drawn)) {
            sum.0 += windows.iter().map(|(_, value)| value * value).sum::<f64>();
            sum.1 += windows.len();
        }
    }
    sums
}

/// The chain of links for what `residuals` (by run) leave, worst signal of each link.
pub(crate) fn chain(bench: &Bench<'_>, noise: &Noise, residuals: &[Vec<Channels>]) -> Vec<LinkGap> {
    let runs = bench.all();
    let measured: Vec<Vec<Windows>> =
        runs.iter().map(|run| windows(bench, *run, &residuals[*run])).collect();
    let floors: Vec<Vec<(f64, usize)>> =
        runs.iter().map(|run| floors(bench, noise, *run)).collect();
    let allowed: Vec<Vec<Vec<Windows>>> = runs
        .iter()
        .map(|run| {
            bench.raw_columns(*run).iter().map(|column| windows(bench, *run, column)).collect()
        })
        .collect();
    let repeats = repeats(bench);
    let gaps: Vec<(Signal, LinkGap)> = Signal::ALL
        .into_iter()
        .enumerate()
        .filter(|(_, signal)| !is_input(bench, *signal))
        .filter_map(|(i, signal)| {
            let own: Vec<&Windows> = measured.iter().map(|run| &run[i]).collect();
            let floor = pooled(floors.iter().map(|run| run[i]));
            let floor = with_repeats(floor, &repeats, |run| &measured[run][i]);
            let allowance: f64 = (0..bench.raw_columns(0).len())
                .map(|column| {
                    let square = |w: &Windows| (w.iter().map(|(_, v)| v * v).sum::<f64>(), w.len());
                    pooled(allowed.iter().map(|run| square(&run[column][i])))
                })
                .filter(|square| square.is_finite())
                .sum();
            let allowance = GOOD_ORDER * GOOD_ORDER * allowance;
            gap(signal, &own, floor, allowance).map(|gap| (signal, gap))
        })
        .collect();
    Link::ALL.into_iter().map(|link| worst(link, &gaps)).collect()
}

/// Whether a signal is what the model was driven by in every run.
fn is_input(bench: &Bench<'_>, signal: Signal) -> bool {
    bench.all().iter().all(|run| {
        matches!(
            (bench.ready.followed_turn(*run), signal),
            (Some(_), Signal::DrivenTravel | Signal::Steering)
                | (Some(Turn::Wheels), Signal::WheelYaw)
                | (Some(Turn::Gyro), Signal::GyroYaw)
                | (Some(Turn::Reference), Signal::ReferenceYaw)
        )
    })
}

/// Windows that do not overlap, as many as which the modelled floor counts.
const MODELLED: f64 = 24.0;

/// Runs that repeat another one, and by how many bins it came earlier.
fn repeats(bench: &Bench<'_>) -> Vec<(usize, usize, isize)> {
    let runs = &bench.ready.runs;
    let begins = |run: usize| {
        let first = runs[run].run.commands.iter().find(|command| command.speed != 0.0);
        first.map_or(0.0, |command| command.t)
    };
    let mut pairs = Vec::new();
    for (run, prepared) in runs.iter().enumerate() {
        let Some(name) = &prepared.run.repeat_of else { continue };
        let other = runs.iter().position(|other| other.run.name == *name);
        if let Some(other) = other.filter(|other| *other != run) {
            let bins = (begins(run) - begins(other)) / prepared.binned.width;
            #[allow(clippy::cast_possible_truncation)] // Few.
            pairs.push((run, other, bins.round() as isize));
        }
    }
    pairs
}

/// A floor with what runs that repeat each other differ by: half their mean squared difference, in which all that
/// repeats cancels.
fn with_repeats<'w>(
    modelled: f64,
    pairs: &[(usize, usize, isize)],
    windows: impl Fn(usize) -> &'w Windows,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (run, other, bins) in pairs {
        let theirs = windows(*other);
        for (from, value) in windows(*run) {
            let from = from.checked_add_signed(-bins);
            let same = from.and_then(|from| theirs.binary_search_by_key(&from, |w| w.0).ok());
            if let Some(same) = same {
                sum += 0.5 * (value - theirs[same].1).powi(2);
                count += 1.0;
            }
        }
    }
    if count == 0.0 {
        return modelled;
    }
    // Windows overlap.
    let independent = count * bins::WIDTH / HORIZON;
    (MODELLED * modelled + independent * sum / count) / (MODELLED + independent)
}

fn pooled(parts: impl Iterator<Item = (f64, usize)>) -> f64 {
    let (sum, count) = parts.fold((0.0, 0), |all, part| (all.0 + part.0, all.1 + part.1));
    sum / to_f64(count)
}

fn gap(signal: Signal, own: &[&Windows], floor: f64, allowance: f64) -> Option<LinkGap> {
    let squares: Vec<f64> =
        own.iter().flat_map(|run| run.iter().map(|(_, value)| value * value)).collect();
    if squares.is_empty() || !floor.is_finite() {
        return None;
    }
    let mean = squares.iter().sum::<f64>() / to_f64(squares.len());
    let excess = |mean: f64| (mean - floor - allowance).max(0.0).sqrt();
    // Of a short run each window is a block: a single block would have an interval without width.
    let size = if squares.len() < FEW * BLOCK { 1 } else { BLOCK };
    let blocks: Vec<Vec<f64>> = own
        .iter()
        .flat_map(|run| {
            run.chunks(size).map(|block| block.iter().map(|(_, v)| v * v).collect::<Vec<f64>>())
        })
        .collect();
    let (low, high) = bootstrap(&blocks, excess);
    let (words, unit) = signal.words();
    Some(LinkGap {
        link: signal.link(),
        signal: words,
        unit,
        gap: mean.sqrt(),
        floor: floor.sqrt(),
        allowance: allowance.sqrt(),
        excess: excess(mean),
        low: low.min(excess(mean)),
        high: high.max(excess(mean)),
        measured: true,
    })
}

fn bootstrap(blocks: &[Vec<f64>], excess: impl Fn(f64) -> f64) -> (f64, f64) {
    use rand::RngExt;
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let mut drawn: Vec<f64> = (0..BOOTSTRAP)
        .map(|_| {
            let picks = (0..blocks.len()).map(|_| &blocks[random.random_range(0..blocks.len())]);
            let (sum, count) =
                picks.fold((0.0, 0), |all, b| (all.0 + b.iter().sum::<f64>(), all.1 + b.len()));
            excess(sum / to_f64(count.max(1)))
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    (drawn[BOOTSTRAP / 20], drawn[BOOTSTRAP - 1 - BOOTSTRAP / 20])
}

/// How far a gap is above what noise and allowance explain.
pub(crate) fn strength(gap: &LinkGap) -> f64 {
    gap.excess / (gap.floor * gap.floor + gap.allowance * gap.allowance).sqrt().max(1e-12)
}

fn worst(link: Link, gaps: &[(Signal, LinkGap)]) -> LinkGap {
    let of = gaps.iter().filter(|(signal, _)| signal.link() == link).map(|(_, gap)| gap);
    let nothing = LinkGap {
        link,
        signal: "not measured",
        unit: "",
        gap: 0.0,
        floor: 0.0,
        allowance: 0.0,
        excess: 0.0,
        low: 0.0,
        high: 0.0,
        measured: false,
    };
    of.max_by(|a, b| strength(a).total_cmp(&strength(b))).cloned().unwrap_or(nothing)
}
