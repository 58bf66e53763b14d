//! What no listed effect may be: an input of the chain that depends on something in a way nobody wrote down. Each is a
//! small set of shapes, linear in their sizes, and competes with the listed effects as a rival: this is what `unknown`
//! rests on.

use core::f64::consts::TAU;

use kerbside_geometry::math;
use kerbside_simulation::effects::Link;

use crate::bins::{self, Binned, CHANNELS, Channels};
use crate::noise::Coefficients;
use crate::path::Path;

/// Where a shape enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Entry {
    /// Speed of the motor, as a share.
    Speed,
    /// Angle of the rack \[rad\].
    Rack,
    /// Slip of the driven wheels, as a share.
    Slip,
    /// Curvature, times the wheelbase.
    Curvature,
    /// Side velocity, as a share.
    Side,
    /// Rotation of one wheel, as a share.
    Wheel(usize),
    /// Reading of the steering sensor \[rad\].
    SteeringSensor,
    /// Reading of the gyro \[rad/s\].
    Gyro,
    /// Position of the reference \[m\].
    Position,
    /// Yaw of the reference \[rad\].
    Yaw,
}

/// What it depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axis {
    /// Time since the run's start.
    Time,
    /// Forwards or in reverse.
    Direction,
    /// Speed.
    Speed,
    /// Speeding up or slowing down.
    Acceleration,
    /// Curvature, with its sign.
    Curvature,
    /// Steering to the left or to the right.
    SteeringRate,
    /// Heading in the reference frame.
    Heading,
    /// Place in the reference frame.
    Place,
    /// The same, four times as closely or so.
    Spot,
    /// Angle of the wheel.
    Turn,
    /// Nothing but time, round and round; each run begins anywhere in it.
    Oscillation {
        /// How often \[mHz\].
        millihertz: u32,
    },
}

impl Entry {
    /// All that a car with these channels can show.
    #[must_use]
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self::Speed, Self::Rack, Self::Slip, Self::Curvature, Self::Side];
        all.extend((0..4).map(Self::Wheel));
        all.extend([Self::SteeringSensor, Self::Gyro, Self::Position, Self::Yaw]);
        all
    }

    /// The link it belongs to.
    #[must_use]
    pub(crate) fn link(self) -> Link {
        match self {
            Self::Speed => Link::SpeedActuation,
            Self::Rack => Link::SteeringActuation,
            Self::Slip | Self::Curvature | Self::Side | Self::Wheel(_) => Link::Ground,
            Self::SteeringSensor | Self::Gyro => Link::Sensing,
            Self::Position | Self::Yaw => Link::Reference,
        }
    }

    /// A large size of it: one standard deviation of what is thought possible.
    fn scale(self, limits: (f64, f64)) -> f64 {
        match self {
            Self::Speed | Self::Slip | Self::Side | Self::Wheel(_) => 0.05,
            Self::Rack | Self::Curvature | Self::SteeringSensor | Self::Yaw => 0.03,
            Self::Gyro => 0.03 * limits.0 / limits.1,
            Self::Position => 0.08 * limits.1,
        }
    }

    /// In words.
    #[must_use]
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Speed => "the speed that the motor makes of a command",
            Self::Rack => "the angle that the rack makes of a command",
            Self::Slip => "the way that the body makes of the driven wheels' turning",
            Self::Curvature => "the curvature that the body makes of the wheels' angle",
            Self::Side => "the body's velocity to the side",
            Self::Wheel(0) => "the turning of the front left wheel",
            Self::Wheel(1) => "the turning of the front right wheel",
            Self::Wheel(2) => "the turning of the rear left wheel",
            Self::Wheel(_) => "the turning of the rear right wheel",
            Self::SteeringSensor => "the reading of the steering sensor",
            Self::Gyro => "the reading of the gyro",
            Self::Position => "the position that the reference shows",
            Self::Yaw => "the yaw that the reference shows",
        }
    }
}

impl Axis {
    /// All of them, but for oscillations: their frequencies are in the runs.
    pub(crate) const ALL: [Self; 10] = [
        Self::Time,
        Self::Direction,
        Self::Speed,
        Self::Acceleration,
        Self::Curvature,
        Self::SteeringRate,
        Self::Heading,
        Self::Place,
        Self::Spot,
        Self::Turn,
    ];

    /// In words.
    #[must_use]
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Oscillation { .. } => "the time, which swings,",
            Self::Time => "the time since the start of the run",
            Self::Direction => "whether the car goes forwards or in reverse",
            Self::Speed => "the speed",
            Self::Acceleration => "whether the car speeds up or slows down",
            Self::Curvature => "the curvature of the path",
            Self::SteeringRate => "which way the steering turns",
            Self::Heading => "the heading",
            Self::Place | Self::Spot => "the place",
            Self::Turn => "the angle of the wheel",
        }
    }
}

/// Where the runs went, so that shapes mean the same in all of them.
#[derive(Clone, Debug)]
pub(crate) struct Extent {
    /// Box of all places \[m\]: least x, y, greatest x, y.
    pub place: [f64; 4],
    /// Longest run \[s\].
    pub duration: f64,
    /// Greatest speed \[m/s\].
    pub speed: f64,
    /// Greatest curvature \[1/m\].
    pub curvature: f64,
    /// Wheelbase \[m\].
    pub wheelbase: f64,
    /// Nominal radii \[m\].
    pub radius: [f64; 4],
    /// Middles of spots along the paths, and how far apart they lie \[m\].
    pub spots: (Vec<(f64, f64)>, f64),
}

impl Extent {
    /// Of all runs.
    #[must_use]
    pub(crate) fn new(paths: &[&Path], width: f64, wheelbase: f64, radius: [f64; 4]) -> Self {
        let mut extent = Self {
            place: [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY],
            duration: width,
            speed: 1e-3,
            curvature: 1e-3 / wheelbase,
            wheelbase,
            radius,
            spots: (Vec::new(), wheelbase),
        };
        for path in paths {
            for pose in &path.pose {
                let [x0, y0, x1, y1] = extent.place;
                extent.place = [x0.min(pose.x), y0.min(pose.y), x1.max(pose.x), y1.max(pose.y)];
            }
            extent.duration = extent.duration.max(bins::to_f64(path.pose.len()) * width);
            for step in &path.steps {
                extent.speed = extent.speed.max(step.distance.abs() / width);
                extent.curvature = extent.curvature.max(math::tan(step.steering).abs() / wheelbase);
            }
        }
        extent.spots = spots(paths, extent.place, wheelbase);
        extent
    }
}

/// Squares that the paths enter, as small as can be without being more than [`SPOTS`].
fn spots(paths: &[&Path], place: [f64; 4], wheelbase: f64) -> (Vec<(f64, f64)>, f64) {
    let [x0, y0, x1, y1] = place;
    let side = (x1 - x0).max(y1 - y0).max(wheelbase);
    let entered = |pitch: f64| {
        let middle =
            |value: f64, from: f64| from + pitch * (((value - from) / pitch).floor() + 0.5);
        let poses = paths.iter().flat_map(|path| &path.pose);
        let mut all: Vec<(f64, f64)> =
            poses.map(|pose| (middle(pose.x, x0), middle(pose.y, y0))).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        all.dedup();
        all
    };
    let mut pitch = (0.5 * wheelbase).max(side / CLOSEST);
    loop {
        let all = entered(pitch);
        if all.len() <= SPOTS || pitch >= side {
            return (all, pitch);
        }
        pitch *= 1.15;
    }
}

/// Number of shapes along each side of the map.
const GRID: usize = 4;
/// Spots along the paths at most, and along a side of the map.
const SPOTS: usize = 40;
const CLOSEST: f64 = 16.0;

/// Size of each shape in each bin: `[shape][bin]`.
#[must_use]
pub(crate) fn shapes(
    axis: Axis,
    entry: Entry,
    path: &Path,
    extent: &Extent,
    width: f64,
) -> Vec<Vec<f64>> {
    let bins = path.pose.len();
    let step = |k: usize| path.steps[k.saturating_sub(1).min(path.steps.len() - 1)];
    let speed = |k: usize| step(k).distance / width;
    let curvature = |k: usize| math::tan(step(k).steering) / extent.wheelbase;
    let over = |shape: &dyn Fn(usize) -> f64| (0..bins).map(shape).collect::<Vec<f64>>();
    let moving = |k: usize| speed(k).abs() / (speed(k).abs() + 0.02 * extent.speed);
    match axis {
        Axis::Time => vec![over(&|k| bins::to_f64(k) * width / extent.duration)],
        Axis::Direction => vec![over(&|k| speed(k).signum() * moving(k))],
        Axis::Speed => vec![
            over(&|k| speed(k).abs() / extent.speed),
            over(&|k| (speed(k) / extent.speed).powi(2)),
        ],
        Axis::Acceleration => {
            let rate = |k: usize| {
                if k == 0 || k + 1 >= bins { 0.0 } else { speed(k + 1).abs() - speed(k).abs() }
            };
            let scale = 0.2 * extent.speed;
            vec![over(&|k| (rate(k) / scale).clamp(-1.0, 1.0))]
        }
        Axis::Curvature => vec![
            over(&|k| curvature(k) / extent.curvature),
            over(&|k| (curvature(k) / extent.curvature).powi(2)),
            over(&|k| (curvature(k) / extent.curvature).powi(3)),
        ],
        Axis::SteeringRate => {
            let rate = |k: usize| {
                if k == 0 || k + 1 >= bins { 0.0 } else { step(k + 1).steering - step(k).steering }
            };
            vec![over(&|k| (rate(k) / 0.02).clamp(-1.0, 1.0))]
        }
        Axis::Heading => {
            vec![over(&|k| math::cos(path.pose[k].yaw)), over(&|k| math::sin(path.pose[k].yaw))]
        }
        Axis::Place => places(path, extent),
        Axis::Spot => {
            let (middles, pitch) = &extent.spots;
            middles.iter().map(|middle| bump(path, *middle, *pitch)).collect()
        }
        Axis::Oscillation { millihertz } => {
            let phase = |k: usize| TAU * 1e-3 * f64::from(millihertz) * width * bins::to_f64(k);
            vec![over(&|k| math::cos(phase(k))), over(&|k| math::sin(phase(k)))]
        }
        Axis::Turn => turns(entry, path, extent),
    }
}

/// The angle of a wheel, round and round.
fn turns(entry: Entry, path: &Path, extent: &Extent) -> Vec<Vec<f64>> {
    let wheel = if let Entry::Wheel(wheel) = entry { wheel } else { 2 };
    let rolled =
        |k: usize| if k > 0 { path.steps[k - 1].distance / extent.radius[wheel] } else { 0.0 };
    let mut turn = 0.0;
    let turns: Vec<f64> = (0..path.pose.len())
        .map(|k| {
            turn += rolled(k);
            turn
        })
        .collect();
    // Faster than the bins can show it is nothing that they show.
    let per_bin = |k: usize| path.steps[k.saturating_sub(1).min(path.steps.len() - 1)].distance;
    let shown = |k: usize| (1.0 - (per_bin(k) / extent.radius[wheel] / 3.0).powi(2)).max(0.0);
    let over = |of: fn(f64) -> f64| -> Vec<f64> {
        turns.iter().enumerate().map(|(k, turn)| shown(k) * of(*turn)).collect()
    };
    vec![over(math::cos), over(math::sin)]
}

/// Bumps on a grid over all places.
fn places(path: &Path, extent: &Extent) -> Vec<Vec<f64>> {
    let [x0, y0, x1, y1] = extent.place;
    let side = (x1 - x0).max(y1 - y0).max(extent.wheelbase);
    let pitch = side / bins::to_f64(GRID);
    let mut shapes = Vec::new();
    for i in 0..GRID {
        for j in 0..GRID {
            let (x, y) =
                (x0 + pitch * (bins::to_f64(i) + 0.5), y0 + pitch * (bins::to_f64(j) + 0.5));
            shapes.push(bump(path, (x, y), pitch));
        }
    }
    shapes
}

/// How near the path is to a place, on the scale of `pitch` \[m\].
fn bump(path: &Path, (x, y): (f64, f64), pitch: f64) -> Vec<f64> {
    let square = |pose: &kerbside_geometry::Pose| {
        ((pose.x - x).powi(2) + (pose.y - y).powi(2)) / (0.6 * pitch).powi(2)
    };
    path.pose.iter().map(|pose| math::exp(-0.5 * square(pose))).collect()
}

/// What the shapes of an entry along an axis make of all channels, each of one standard deviation.
#[must_use]
pub(crate) fn columns(
    entry: Entry,
    axis: Axis,
    run: (&Binned, &Path, &Coefficients),
    extent: &Extent,
) -> Vec<Vec<Channels>> {
    let (binned, path, coefficients) = run;
    let shapes = shapes(axis, entry, path, extent, binned.width);
    let mut columns: Vec<Vec<Channels>> =
        shapes.iter().map(|shape| response(entry, shape, path, coefficients, 0.0)).collect();
    if entry == Entry::Position {
        let quarter = core::f64::consts::FRAC_PI_2;
        columns
            .extend(shapes.iter().map(|shape| response(entry, shape, path, coefficients, quarter)));
    }
    let scale = entry.scale((extent.speed, extent.wheelbase));
    for (row, measured) in
        columns.iter_mut().flat_map(|column| column.iter_mut().zip(&binned.measured))
    {
        for (value, measured) in row.iter_mut().zip(measured) {
            *value = if measured.is_finite() { *value * scale } else { f64::NAN };
        }
    }
    columns
}

/// What a shape of size 1 makes of all channels; a position moves along `direction` of the reference frame.
fn response(
    entry: Entry,
    shape: &[f64],
    path: &Path,
    coefficients: &Coefficients,
    direction: f64,
) -> Vec<Channels> {
    let only = |channel: usize| {
        let put = move |value: &f64| {
            let mut row = [0.0; CHANNELS];
            row[channel] = *value;
            row
        };
        shape.iter().map(put).collect()
    };
    match entry {
        Entry::Speed => coefficients.response(0, shape),
        Entry::Slip => coefficients.response(1, shape),
        Entry::Curvature => coefficients.response(2, shape),
        Entry::Side => coefficients.response(3, shape),
        Entry::Rack => coefficients.response(4, shape),
        Entry::Wheel(wheel) => coefficients.response(5 + wheel, shape),
        Entry::SteeringSensor => only(bins::STEERING),
        Entry::Gyro => only(bins::GYRO),
        Entry::Yaw => only(bins::REFERENCE + 2),
        Entry::Position => {
            let put = |(value, pose): (&f64, &kerbside_geometry::Pose)| {
                let mut row = [0.0; CHANNELS];
                row[bins::REFERENCE] = value * math::cos(direction - pose.yaw);
                row[bins::REFERENCE + 1] = value * math::sin(direction - pose.yaw);
                row
            };
            shape.iter().zip(&path.pose).map(put).collect()
        }
    }
}
