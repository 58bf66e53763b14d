//! A case made ready: bins, start poses, and the model's answer to any set of effects.

use kerbside_geometry::{Pose, Vehicle, math};
use kerbside_simulation::{Command, Drive, Effects, Follow, InMotion, Trajectory};

use crate::bins::{Binned, Channels, Shown, WIDTH, to_f64};
use crate::case::{Case, Run, Wheels};
use crate::follow::{Followed, Turn, follow};
use crate::path::{Path, Place};

/// Step of the simulation \[s\].
const STEP: f64 = 0.04;
/// Share of the measured motion's size by which commands may lead elsewhere.
const ASTRAY: f64 = 0.35;
/// Commands older than this act already \[s\].
const EARLIER: f64 = 1.0;
/// Where commands are known for longer than this before a run, its first motion comes from them \[s\].
pub(crate) const LEAD: f64 = 4.0;
/// Travel below which a car has not moved, in wheel radii.
const STANDING: f64 = 0.05;

/// A run made ready.
#[derive(Debug)]
pub(crate) struct Prepared<'a> {
    pub run: &'a Run,
    pub binned: Binned,
    /// Pose of the body at t = 0.
    pub start: Pose,
    /// What was measured of motor and rack.
    measured: Followed,
    /// How it moved at t = 0.
    motion: InMotion,
    /// The commands, from before t = 0 on where it was under way; none where none were recorded.
    commands: Option<Vec<Command>>,
    /// Whether commands lead so far from what was measured that errors are linear about the measured path alone.
    astray: bool,
}

/// A case made ready.
#[derive(Debug)]
pub(crate) struct Ready<'a> {
    pub vehicle: &'a Vehicle,
    pub runs: Vec<Prepared<'a>>,
    /// Of which recorded drive each run is a piece.
    pub drives: Vec<usize>,
}

impl<'a> Ready<'a> {
    /// Cuts the runs into bins and finds where each began.
    pub(crate) fn new(case: &'a Case) -> Self {
        let vehicle = &case.vehicle;
        let marker = vehicle.reference.map_or(Pose::default(), |reference| reference.marker);
        let prepared = |run: &'a Run| {
            let measured = follow(run, vehicle);
            let motion = measured.motion(vehicle);
            let binned = Binned::new(run, WIDTH, vehicle.radius, marker);
            let start = start(run, vehicle, &marker, &measured);
            let commands = run.has_commands().then(|| under_way(run, &motion));
            Prepared { run, start, binned, measured, motion, commands, astray: false }
        };
        let runs: Vec<Prepared<'a>> = case.runs.iter().map(prepared).collect();
        let mut ready = Self { vehicle, drives: (0..runs.len()).collect(), runs };
        for run in 0..ready.runs.len() {
            ready.runs[run].astray = ready.leads_astray(run);
        }
        ready
    }

    /// Whether commands lead far from what was measured.
    fn leads_astray(&self, run: usize) -> bool {
        let prepared = &self.runs[run];
        if prepared.commands.is_none() || prepared.measured.turn == Turn::Nothing {
            return false;
        }
        let by_commands = self.trajectory(run, &Effects::NEUTRAL);
        let as_measured = self.as_measured(run);
        let (mut off, mut all) = ((0.0, 0.0), (1e-12, 1e-12));
        for bin in 0..prepared.binned.len() {
            let t = prepared.binned.time(bin);
            let (c, m) = (by_commands.state(t), as_measured.state(t));
            off.0 += (c.motor_speed - m.motor_speed).powi(2);
            off.1 += (c.yaw_rate - m.yaw_rate).powi(2);
            all.0 += m.motor_speed * m.motor_speed;
            all.1 += m.yaw_rate * m.yaw_rate;
        }
        let far = ASTRAY * ASTRAY;
        off.0 > far * all.0 || off.1 > 4.0 * far * all.1 && off.1 > 0.01 * all.0
    }

    /// What told the turn of a run that follows what was measured; none of one that follows commands.
    pub(crate) fn followed_turn(&self, run: usize) -> Option<Turn> {
        let prepared = &self.runs[run];
        prepared.commands.is_none().then_some(prepared.measured.turn)
    }

    fn as_measured(&self, run: usize) -> Trajectory {
        let prepared = &self.runs[run];
        let mut trajectory = Trajectory::default();
        let (vehicle, start) = (self.vehicle, prepared.start);
        let Followed { speeds, racks, .. } = &prepared.measured;
        Follow { vehicle, effects: Effects::NEUTRAL, speeds, racks, start, step: STEP }
            .trajectory(prepared.binned.end() + 0.1, &mut trajectory);
        trajectory
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
        match &prepared.commands {
            Some(commands) => {
                let motion = led(vehicle, effects, commands).unwrap_or(prepared.motion);
                let drive = Drive { vehicle, effects: *effects, commands, start, step: STEP };
                drive.trajectory_from(&motion, until, &mut trajectory);
            }
            None => {
                let Followed { speeds, racks, .. } = &prepared.measured;
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
        let prepared = &self.runs[run];
        let trajectory =
            if prepared.astray { self.as_measured(run) } else { self.trajectory(run, effects) };
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
/// reference it headed so that the first way as the wheels tell it lies on the measured one, else where it went first.
fn start(run: &Run, vehicle: &Vehicle, marker: &Pose, measured: &Followed) -> Pose {
    if let Some(start) = run.start {
        return start;
    }
    let motion = &measured.motion(vehicle);
    let stood = stood_until(run, vehicle);
    let rows = run.reference.between(f64::NEG_INFINITY, stood);
    let rows = if motion.speed != 0.0 {
        at_once(run, motion)
    } else if rows.is_empty() {
        first_rows(run)
    } else {
        rows
    };
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
    let heading =
        laid_on(run, vehicle, measured).unwrap_or_else(|| first_heading(run, vehicle, (x, y)));
    let (sin, cos) = math::sin_cos(heading);
    Pose::new(x - cos * marker.x + sin * marker.y, y - sin * marker.x - cos * marker.y, heading)
}

/// The first row of a car that is under way, brought back to t = 0.
fn at_once(run: &Run, motion: &InMotion) -> crate::case::Series<3> {
    let mut rows = first_rows(run);
    rows.t.truncate(1);
    rows.value.truncate(1);
    for (t, row) in rows.t.iter().zip(&mut rows.value) {
        let (sin, cos) = if row[2].is_finite() { math::sin_cos(row[2]) } else { (0.0, 0.0) };
        row[0] -= t * motion.speed * cos;
        row[1] -= t * motion.speed * sin;
    }
    rows
}

/// How a car moves at t = 0 that has followed its commands for longer than [`LEAD`], from the first of them on. What was
/// measured there is noisier, and would hide the actuators' effects at each begin of a block.
fn led(vehicle: &Vehicle, effects: &Effects, commands: &[Command]) -> Option<InMotion> {
    let first = commands.first().filter(|first| first.t <= -LEAD)?;
    let before = commands.iter().take_while(|command| command.t <= 0.0);
    let earlier: Vec<Command> =
        before.map(|command| Command { t: command.t - first.t, ..*command }).collect();
    let mut trajectory = Trajectory::default();
    let (start, step) = (Pose::default(), STEP);
    let drive = Drive { vehicle, effects: *effects, commands: &earlier, start, step };
    let held = InMotion { speed: first.speed, rack: first.steering };
    drive.trajectory_from(&held, -first.t, &mut trajectory);
    let now = trajectory.state(-first.t);
    Some(InMotion { speed: now.motor_speed, rack: now.rack })
}

/// Commands of a run; one that is under way at t = 0 held its motion until the first of them acts.
fn under_way(run: &Run, motion: &InMotion) -> Vec<Command> {
    let mut commands = run.commands.clone();
    let moves = motion.speed != 0.0;
    if let Some(first) = commands.first().filter(|first| moves && first.t > -EARLIER) {
        let t = first.t - EARLIER;
        commands.insert(0, Command { t, speed: motion.speed, steering: motion.rack });
    }
    commands
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

/// Way over which the measured path is laid on the one that the wheels tell, and least way that tells a heading, in
/// wheelbases.
const LAID: (f64, f64) = (6.0, 1.0);

/// Heading at t = 0 that lays the marker's way as the wheels tell it on its measured one (least squares over all rotations:
/// Kabsch 1976, in the plane); none where the wheels tell no turn or too little was driven. A marker far from the rear axle
/// does not go where the car heads.
fn laid_on(run: &Run, vehicle: &Vehicle, measured: &Followed) -> Option<f64> {
    if measured.turn == Turn::Nothing {
        return None;
    }
    let (_, end) = run.reference.span()?;
    let mut trajectory = Trajectory::default();
    let Followed { speeds, racks, .. } = measured;
    let (effects, start) = (Effects::NEUTRAL, Pose::default());
    Follow { vehicle, effects, speeds, racks, start, step: STEP }
        .trajectory(end.max(0.0) + 0.1, &mut trajectory);
    let mut pairs: Vec<[f64; 4]> = Vec::new();
    let (mut way, mut last) = (0.0, None::<(f64, f64)>);
    for (t, row) in run.reference.t.iter().zip(&run.reference.value) {
        if *t < 0.0 || !(row[0].is_finite() && row[1].is_finite()) {
            continue;
        }
        let told = trajectory.reference(*t);
        way += last.map_or(0.0, |(x, y)| math::hypot(told.x - x, told.y - y));
        last = Some((told.x, told.y));
        pairs.push([told.x, told.y, row[0], row[1]]);
        if way > LAID.0 * vehicle.wheelbase {
            break;
        }
    }
    if way < LAID.1 * vehicle.wheelbase {
        return None;
    }
    let count = to_f64(pairs.len());
    let mean: [f64; 4] = core::array::from_fn(|c| pairs.iter().map(|p| p[c]).sum::<f64>() / count);
    let (mut along, mut across) = (0.0, 0.0);
    for pair in &pairs {
        let [a, b, c, d]: [f64; 4] = core::array::from_fn(|k| pair[k] - mean[k]);
        along += a * c + b * d;
        across += a * d - b * c;
    }
    let heading = math::atan2(across, along);
    heading.is_finite().then_some(heading)
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
