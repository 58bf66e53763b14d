//! A run on an even grid of time, by the nominal vehicle: what evidence is taken from.

use kerbside_geometry::{Vehicle, angle, math};

use crate::ackermann::wheel_angle;
use crate::run::Run;

/// Steps of a grid at most, and the shortest step \[s\].
const STEPS: f64 = 600.0;
const SHORTEST: f64 = 0.05;

/// Increments over an even grid of time.
pub(crate) struct Grid {
    /// Stamps; one more than there are increments \[s\].
    pub(crate) t: Vec<f64>,
    /// Travel of each wheel by its nominal radius \[m\]; none where there is none.
    pub(crate) wheels: [Option<Vec<f64>>; 4],
    /// Travel of the rear-axle centre, or the nearest there is \[m\].
    pub(crate) distance: Vec<f64>,
    /// Mean travel of the axle that the distance is taken from \[m\].
    axle: Vec<f64>,
    /// Steering reading in the middle of each step \[rad\].
    pub(crate) steering: Option<Vec<f64>>,
    wheelbase: f64,
    tracks: (f64, f64),
}

impl Grid {
    /// None where the run's wheels share no time.
    pub(crate) fn new(run: &Run, vehicle: &Vehicle) -> Option<Self> {
        let (from, to) = run.span()?;
        let length = to - from;
        if length <= 0.0 {
            return None;
        }
        let step = (length / STEPS).max(SHORTEST);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // STEPS at most
        let count = (length / step).floor().max(1.0) as u32;
        let t: Vec<f64> =
            (0..=count).map(|k| from + length * f64::from(k) / f64::from(count)).collect();
        let used = run.wheels();
        let wheels = core::array::from_fn(|wheel| {
            let series = run.rotation[wheel].as_ref().filter(|_| used[wheel])?;
            let radius = vehicle.radius[wheel];
            let read: Vec<f64> = t.iter().map(|t| series.at(*t) * radius).collect();
            Some(read.windows(2).map(|pair| pair[1] - pair[0]).collect())
        });
        let steering = run.steering.as_ref().filter(|series| !series.is_empty());
        let steering = steering.map(|series| {
            t.windows(2)
                .map(|pair| {
                    let middle = 0.5 * (pair[0] + pair[1]);
                    series.mean(pair[0], pair[1]).unwrap_or_else(|| series.at(middle))
                })
                .collect()
        });
        let tracks = (vehicle.track_front, vehicle.track_rear);
        let mut grid = Self {
            t,
            wheels,
            distance: Vec::new(),
            axle: Vec::new(),
            steering,
            wheelbase: vehicle.wheelbase,
            tracks,
        };
        grid.set_distance([1.0; 4]);
        Some(grid)
    }

    pub(crate) fn steps(&self) -> usize {
        self.t.len() - 1
    }

    /// Travel of the reference point with each wheel's count taken times `signs`.
    pub(crate) fn set_distance(&mut self, signs: [f64; 4]) {
        let rear = self.wheels[2].is_some() || self.wheels[3].is_some();
        let axle = if rear { [2, 3] } else { [0, 1] };
        let steps = self.steps();
        self.axle = (0..steps)
            .map(|k| {
                let (mut sum, mut count) = (0.0, 0.0);
                for wheel in axle {
                    if let Some(travel) = &self.wheels[wheel] {
                        sum += signs[wheel] * travel[k];
                        count += 1.0;
                    }
                }
                sum / f64::max(count, 1.0)
            })
            .collect();
        let along = |k: usize| match &self.steering {
            Some(steering) if !rear => math::cos(steering[k]),
            _ => 1.0,
        };
        self.distance = (0..steps).map(|k| self.axle[k] * along(k)).collect();
    }

    /// Travel of a wheel, reverse counted like forward \[m\].
    pub(crate) fn travel(&self, wheel: usize) -> Option<f64> {
        Some(self.wheels[wheel].as_ref()?.iter().map(|step| step.abs()).sum())
    }

    /// Travel of the axle per step, whatever the direction \[m\].
    pub(crate) fn rolled(&self) -> Vec<f64> {
        self.axle.iter().map(|step| step.abs()).collect()
    }

    /// Turn per step by the rear wheels \[rad\].
    pub(crate) fn rear_turn(&self) -> Option<Vec<f64>> {
        let (left, right) = (self.wheels[2].as_ref()?, self.wheels[3].as_ref()?);
        let track = self.tracks.1;
        (track > 0.0).then(|| left.iter().zip(right).map(|(l, r)| (r - l) / track).collect())
    }

    /// Turn per step by the front wheels \[rad\]; without a sensor their angle is left out.
    pub(crate) fn front_turn(&self) -> Option<Vec<f64>> {
        let (left, right) = (self.wheels[0].as_ref()?, self.wheels[1].as_ref()?);
        let track = self.tracks.0;
        let turn = |k: usize| {
            // The mean of both angles: the wheels may be exchanged.
            let steering = self.steering.as_ref().map_or(0.0, |steering| steering[k]);
            let cos = |side| wheel_angle(steering, side, track, self.wheelbase).cos;
            let along = 0.5 * (cos(1.0) + cos(-1.0));
            (right[k] - left[k]) / (track * along.max(0.1))
        };
        (track > 0.0).then(|| (0..self.steps()).map(turn).collect())
    }

    /// Turn per step by the steering sensor \[rad\].
    pub(crate) fn steering_turn(&self) -> Option<Vec<f64>> {
        let steering = self.steering.as_ref()?;
        let turn = |k: usize| {
            let rear = self.wheels[2].is_some() || self.wheels[3].is_some();
            let share = if rear { math::tan(steering[k]) } else { math::sin(steering[k]) };
            self.axle[k] * share / self.wheelbase
        };
        Some((0..self.steps()).map(turn).collect())
    }

    /// Whether wheels or sensor tell how the vehicle turns.
    pub(crate) fn tells_turn(&self) -> bool {
        self.rear_turn().or_else(|| self.front_turn()).or_else(|| self.steering_turn()).is_some()
    }

    /// Turn per step by the best of the wheels and the sensor; 0 where none tells.
    pub(crate) fn turn(&self) -> Vec<f64> {
        self.rear_turn()
            .or_else(|| self.front_turn())
            .or_else(|| self.steering_turn())
            .unwrap_or_else(|| vec![0.0; self.steps()])
    }

    /// Number of the step that `t` \[s\] is in, and how far into it, 0 to 1.
    fn place(&self, t: f64) -> (usize, f64) {
        let step = self.t[1] - self.t[0];
        let place = ((t - self.t[0]) / step).clamp(0.0, self.steps() as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let index = (place.floor() as usize).min(self.steps() - 1);
        (index, place - index as f64)
    }

    /// Sum of per-step `values` from the beginning to `t` \[s\]; `sums` are their running sums.
    pub(crate) fn at(&self, sums: &[f64], t: f64) -> f64 {
        let (index, share) = self.place(t);
        sums[index] + share * (sums[index + 1] - sums[index])
    }
}

/// Running sums, from 0, one more than there are values.
pub(crate) fn sums(values: &[f64]) -> Vec<f64> {
    let mut sums = Vec::with_capacity(values.len() + 1);
    let mut sum = 0.0;
    sums.push(sum);
    for value in values {
        sum += value;
        sums.push(sum);
    }
    sums
}

/// A stretch between two readings of the reference, as the reference and the wheels see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chord {
    pub(crate) from: f64,
    pub(crate) to: f64,
    /// Between the reference's positions \[m\], and its direction \[rad\].
    pub(crate) length: f64,
    pub(crate) course: f64,
    /// Headings at both ends, as read \[rad\].
    pub(crate) yaws: Option<(f64, f64)>,
    /// Signed travel by the wheels \[m\], and the same without signs.
    pub(crate) distance: f64,
    pub(crate) rolled: f64,
    /// Turn by the wheels \[rad\].
    pub(crate) turn: f64,
    /// Between the headings farthest to the left and to the right on the way \[rad\].
    pub(crate) swing: f64,
}

impl Chord {
    /// Length of the chord by the wheels \[m\].
    pub(crate) fn by_wheels(&self) -> f64 {
        (self.distance * math::sinc(0.5 * self.turn)).abs()
    }

    /// Whether it goes in one direction, and never points farther apart than some third of a turn.
    pub(crate) fn is_plain(&self) -> bool {
        self.distance.abs() > 0.95 * self.rolled && self.swing < 2.0
    }
}

/// Cuts the run at readings of the reference that are `least` \[m\] of travel apart.
pub(crate) fn chords(run: &Run, grid: &Grid, least: f64) -> Vec<Chord> {
    let distance = sums(&grid.distance);
    let turn = sums(&grid.turn());
    let rolled = sums(&grid.rolled());
    let (from, to) = (grid.t[0], grid.t[grid.t.len() - 1]);
    let readings = run.reference.iter().filter(|r| (from - 0.1..=to + 0.1).contains(&r.t));
    let mut chords = Vec::new();
    let mut begin: Option<&crate::run::ReferencePose> = None;
    for reading in readings {
        let Some(first) = begin else {
            begin = Some(reading);
            continue;
        };
        let between = |sums: &[f64]| grid.at(sums, reading.t) - grid.at(sums, first.t);
        if between(&rolled) < least {
            continue;
        }
        let (dx, dy) = (reading.x - first.x, reading.y - first.y);
        chords.push(Chord {
            from: first.t,
            to: reading.t,
            length: math::hypot(dx, dy),
            course: math::atan2(dy, dx),
            yaws: first.yaw.zip(reading.yaw),
            distance: between(&distance),
            rolled: between(&rolled),
            turn: between(&turn),
            swing: swing(&turn[grid.place(first.t).0..=grid.place(reading.t).0 + 1]),
        });
        begin = Some(reading);
    }
    chords
}

/// From the least to the largest.
fn swing(headings: &[f64]) -> f64 {
    let largest = headings.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = headings.iter().copied().fold(f64::INFINITY, f64::min);
    largest - least
}

/// Mean direction of angles \[rad\].
pub(crate) fn mean_direction(angles: &[f64]) -> f64 {
    let (mut along, mut across) = (0.0, 0.0);
    for angle in angles {
        let (sin, cos) = math::sin_cos(*angle);
        along += cos;
        across += sin;
    }
    angle::wrap(math::atan2(across, along))
}
