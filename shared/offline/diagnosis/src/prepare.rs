//! A case made ready: bins, start poses, and the model's answer to any set of effects.

use kerbside_geometry::{Pose, Vehicle, math};
use kerbside_simulation::{Drive, Effects, Follow, Sample, Trajectory};

use crate::bins::{Binned, Channels, Shown, WIDTH, to_f64};
use crate::case::{Case, Run, Wheels};
use crate::path::{Path, Place, driven_share};

/// Step of the simulation \[s\].
const STEP: f64 = 0.04;
/// Travel below which a car has not moved, in wheel radii.
const STANDING: f64 = 0.05;

/// A run made ready.
#[derive(Debug)]
pub(crate) struct Prepared<'a> {
    pub run: &'a Run,
    pub binned: Binned,
    /// Pose of the body at t = 0.
    pub start: Pose,
    /// What was measured of motor and rack, where no commands were recorded.
    follow: Option<Followed>,
}

/// A case made ready.
#[derive(Debug)]
pub(crate) struct Ready<'a> {
    pub vehicle: &'a Vehicle,
    pub runs: Vec<Prepared<'a>>,
}

impl<'a> Ready<'a> {
    /// Cuts the runs into bins and finds where each began.
    pub(crate) fn new(case: &'a Case) -> Self {
        let vehicle = &case.vehicle;
        let marker = vehicle.reference.map_or(Pose::default(), |reference| reference.marker);
        let prepared = |run: &'a Run| {
            let follow = (!run.has_commands()).then(|| follow(run, vehicle));
            let binned = Binned::new(run, WIDTH, vehicle.radius, marker);
            Prepared { run, start: start(run, vehicle, &marker), binned, follow }
        };
        Self { vehicle, runs: case.runs.iter().map(prepared).collect() }
    }

    /// Lets every run have been measured as `effects` would show it, without noise.
    pub(crate) fn imagine(&mut self, effects: &Effects) {
        for run in 0..self.runs.len() {
            self.runs[run].binned.measured = self.predicted(run, effects);
        }
    }

    /// The trajectory of a run with `effects`.
    pub(crate) fn trajectory(&self, run: usize, effects: &Effects) -> Trajectory {
        let prepared = &self.runs[run];
        let mut trajectory = Trajectory::default();
        let until = prepared.binned.end() + 0.1;
        let (vehicle, start) = (self.vehicle, prepared.start);
        match &prepared.follow {
            None => {
                let commands = &prepared.run.commands;
                Drive { vehicle, effects: *effects, commands, start, step: STEP }
                    .trajectory(until, &mut trajectory);
            }
            Some(Followed { speeds, racks }) => {
                Follow { vehicle, effects: *effects, speeds, racks, start, step: STEP }
                    .trajectory(until, &mut trajectory);
            }
        }
        trajectory
    }

    /// What the sensors would show in each bin of a run.
    pub(crate) fn predicted(&self, run: usize, effects: &Effects) -> Vec<Channels> {
        let trajectory = self.trajectory(run, effects);
        self.runs[run].binned.channels(&mut Simulated { trajectory: &trajectory })
    }

    /// The path of a run about which errors are linear.
    pub(crate) fn path(&self, run: usize, effects: &Effects) -> Path {
        let trajectory = self.trajectory(run, effects);
        let prepared = &self.runs[run];
        let place = |bin: usize| {
            let state = trajectory.state(prepared.binned.time(bin));
            Place { pose: state.pose, steering: state.rack }
        };
        let places: Vec<Place> = (0..prepared.binned.len()).map(place).collect();
        let marker = self.vehicle.reference.map_or(Pose::default(), |reference| reference.marker);
        let point =
            if prepared.binned.has_yaw { Pose::default() } else { Pose { yaw: 0.0, ..marker } };
        Path::new(&places, point)
    }
}

/// A trajectory as a thing that shows.
struct Simulated<'a> {
    trajectory: &'a Trajectory,
}

impl Shown for Simulated<'_> {
    fn rotation(&mut self, t: f64) -> [f64; 4] {
        self.trajectory.rotation(t)
    }

    fn wheel_speed(&mut self, t: f64) -> [f64; 4] {
        self.trajectory.wheel_speed(t)
    }

    fn steering(&mut self, t: f64) -> f64 {
        self.trajectory.steering(t)
    }

    fn yaw_rate(&mut self, t: f64) -> f64 {
        self.trajectory.yaw_rate(t)
    }

    fn reference(&mut self, t: f64) -> Pose {
        self.trajectory.reference(t)
    }
}

/// Where the body was at t = 0: as run.toml says, or as the reference showed while the car stood; without a yaw in the
/// reference it headed where it went first.
fn start(run: &Run, vehicle: &Vehicle, marker: &Pose) -> Pose {
    if let Some(start) = run.start {
        return start;
    }
    let stood = stood_until(run, vehicle);
    let rows = run.reference.between(f64::NEG_INFINITY, stood);
    let rows = if rows.is_empty() { first_rows(run) } else { rows };
    let mean = |column: usize| {
        let values: Vec<f64> =
            rows.value.iter().map(|row| row[column]).filter(|v| v.is_finite()).collect();
        values.iter().sum::<f64>() / to_f64(values.len())
    };
    let (x, y) = (mean(0), mean(1));
    if !(x.is_finite() && y.is_finite()) {
        return Pose::default();
    }
    let yaw = mean(2);
    if yaw.is_finite() {
        return Pose::new(x, y, yaw).compose(&marker.inverse());
    }
    let heading = first_heading(run, vehicle, (x, y));
    let (sin, cos) = math::sin_cos(heading);
    Pose::new(x - cos * marker.x + sin * marker.y, y - sin * marker.x - cos * marker.y, heading)
}

fn first_rows(run: &Run) -> crate::case::Series<3> {
    let Some((first, _)) = run.reference.span() else { return crate::case::Series::default() };
    run.reference.between(f64::NEG_INFINITY, first + 0.25)
}

/// When the wheels began to move \[s\]; the first stamp where they moved from the start.
fn stood_until(run: &Run, vehicle: &Vehicle) -> f64 {
    let series = run.wheels.series();
    let first = series.value.first().copied().unwrap_or_default();
    for (k, row) in series.value.iter().enumerate() {
        let moved = (0..4).any(|wheel| match &run.wheels {
            Wheels::Rotation(_) => (row[wheel] - first[wheel]).abs() > STANDING,
            Wheels::Speed(_) => row[wheel].abs() > STANDING * vehicle.radius[wheel],
        });
        if moved {
            return series.t[k.saturating_sub(1)];
        }
    }
    series.span().map_or(0.0, |span| span.1)
}

/// Heading of a car whose reference shows no yaw: the direction of its first way, turned about in reverse.
fn first_heading(run: &Run, vehicle: &Vehicle, begin: (f64, f64)) -> f64 {
    let far = 0.3 * vehicle.wheelbase;
    let away = run
        .reference
        .value
        .iter()
        .position(|row| math::hypot(row[0] - begin.0, row[1] - begin.1) > far);
    let Some(row) = away else { return 0.0 };
    let [x, y, _] = run.reference.value[row];
    let direction = math::atan2(y - begin.1, x - begin.0);
    let series = run.wheels.series();
    let at = series
        .t
        .partition_point(|t| *t < run.reference.t[row])
        .min(series.t.len().saturating_sub(1));
    let ahead: f64 = match &run.wheels {
        Wheels::Rotation(_) => {
            let first = series.value.first().copied().unwrap_or_default();
            (0..4).map(|w| series.value[at][w] - first[w]).filter(|v| v.is_finite()).sum()
        }
        Wheels::Speed(_) => series.value[at].iter().filter(|v| v.is_finite()).sum(),
    };
    if ahead < 0.0 { direction + core::f64::consts::PI } else { direction }
}

/// Motor and rack as measured.
#[derive(Debug)]
struct Followed {
    speeds: Vec<Sample>,
    racks: Vec<Sample>,
}

/// The driven wheels that were read (or all that were) and the steering sensor; without one the rack stands straight.
fn follow(run: &Run, vehicle: &Vehicle) -> Followed {
    let series = run.wheels.series();
    let share = driven_share(vehicle);
    let read = |wheel: usize| series.has(wheel);
    let driven: Vec<usize> = (0..4).filter(|wheel| share[*wheel] > 0.0 && read(*wheel)).collect();
    let used =
        if driven.is_empty() { (0..4).filter(|wheel| read(*wheel)).collect() } else { driven };
    let (count, radius) = (to_f64(used.len()), vehicle.driven_radius());
    let mut speeds = Vec::with_capacity(series.t.len());
    let mut last: Option<(f64, f64)> = None;
    for (t, value) in series.t.iter().zip(&series.value) {
        if used.iter().any(|wheel| !value[*wheel].is_finite()) {
            continue;
        }
        if matches!(run.wheels, Wheels::Speed(_)) {
            let turn: f64 = used.iter().map(|wheel| value[*wheel] / vehicle.radius[*wheel]).sum();
            speeds.push(Sample { t: *t, value: radius * turn / count });
            continue;
        }
        let turned: f64 = used.iter().map(|wheel| value[*wheel]).sum();
        if let Some((before, from)) = last {
            speeds.push(Sample {
                t: 0.5 * (t + before),
                value: radius * (turned - from) / count / (t - before),
            });
        }
        last = Some((*t, turned));
    }
    let angle =
        |reading: f64| vehicle.steering_sensor.map_or(reading, |sensor| sensor.angle(reading));
    let rows =
        run.steering.t.iter().zip(&run.steering.value).filter(|(_, value)| value[0].is_finite());
    let racks: Vec<Sample> =
        rows.map(|(t, value)| Sample { t: *t, value: angle(value[0]) }).collect();
    let racks = if racks.is_empty() { turning(run, vehicle) } else { racks };
    Followed { speeds, racks }
}

/// Time over which two wheels' ways are compared \[s\].
const COMPARED: f64 = 0.2;
/// Largest angle that two wheels' ways are taken for \[rad\].
const LARGEST: f64 = 1.35;

/// Without a steering sensor: the angle at which the two wheels of the rear axle would roll as far as they did; of the
/// front one where the rear one was not read (at small angles the same). Straight where no axle was read on both sides.
fn turning(run: &Run, vehicle: &Vehicle) -> Vec<Sample> {
    let series = run.wheels.series();
    let axles = [([2, 3], vehicle.track_rear), ([0, 1], vehicle.track_front)];
    let read = |wheels: &[usize; 2]| wheels.iter().all(|wheel| series.has(*wheel));
    let Some(([left, right], track)) =
        axles.iter().find(|(wheels, track)| *track > 0.0 && read(wheels))
    else {
        return Vec::new();
    };
    let reports = matches!(run.wheels, Wheels::Speed(_));
    let way = |row: &[f64; 4], wheel: usize| {
        row[wheel] * if reports { 1.0 } else { vehicle.radius[wheel] }
    };
    let mut racks = Vec::new();
    let mut from: Option<(f64, [f64; 2])> = None;
    for (t, row) in series.t.iter().zip(&series.value) {
        let ways = [way(row, *left), way(row, *right)];
        if ways.iter().any(|way| !way.is_finite()) {
            continue;
        }
        let (at, [l, r]) = match from {
            _ if reports => (*t, ways),
            None => {
                from = Some((*t, ways));
                continue;
            }
            Some((before, _)) if t - before < COMPARED => continue,
            Some((before, earlier)) => {
                from = Some((*t, ways));
                (0.5 * (t + before), [ways[0] - earlier[0], ways[1] - earlier[1]])
            }
        };
        let mean = 0.5 * (l + r);
        // A car that stands keeps its wheels where they were.
        if mean.abs() > 1e-3 * vehicle.radius[*left] {
            let value =
                math::atan(vehicle.wheelbase * (r - l) / (track * mean)).clamp(-LARGEST, LARGEST);
            racks.push(Sample { t: at, value });
        }
    }
    racks
}
