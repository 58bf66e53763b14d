//! Noise of the sensors, disturbances of the drive, and differences from run to run: what no model takes away.

use crate::colour::Process;
use crate::normal::Normal;
use crate::sensors::Coloured;

/// Disturbances are drawn so often and are linear in between \[s\].
const GRID: f64 = 0.02;
/// Streams of a run's seed; the sensors have others.
const SLIP: u64 = 20;

/// All of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor {
    /// Slip of the driven wheels, as a share.
    pub slip: Coloured,
    /// Angle of the front wheels beside the rack's \[rad\].
    pub angle: Coloured,
    /// Side velocity as a share of the speed.
    pub side: Coloured,
    /// White error of a wheel speed \[m/s\].
    pub wheel_speed: f64,
    /// White error of the steering sensor \[rad\].
    pub steering: f64,
    /// Beside it \[rad\].
    pub steering_coloured: Coloured,
    /// White error of the gyro \[rad/s\].
    pub gyro: f64,
    /// Beside it \[rad/s\].
    pub gyro_coloured: Coloured,
    /// White error of the reference's position along each axis \[m\].
    pub position: f64,
    /// Beside it \[m\].
    pub position_coloured: Coloured,
    /// White error of the reference's heading \[rad\].
    pub yaw: f64,
    /// Beside it \[rad\].
    pub yaw_coloured: Coloured,
}

/// The disturbances of one drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Disturbance {
    /// Slip, angle and side at multiples of the grid's step; none where nothing disturbs.
    samples: Vec<[f64; 3]>,
}

impl Disturbance {
    /// Nothing disturbs.
    pub const NONE: Self = Self { samples: Vec::new() };

    /// Those that `seed` draws for a drive of `duration` \[s\].
    #[must_use]
    pub fn drawn(floor: &Floor, duration: f64, seed: u64) -> Self {
        let mut processes = [floor.slip, floor.angle, floor.side].map(Process::new);
        let mut normals = [SLIP, SLIP + 1, SLIP + 2].map(|stream| Normal::new(seed, stream));
        let times = (0_u32..).map(|k| f64::from(k) * GRID);
        let sample = |time: f64| core::array::from_fn(|i| processes[i].at(time, &mut normals[i]));
        let samples = times.take_while(|time| *time < duration + 2.0 * GRID).map(sample).collect();
        Self { samples }
    }

    /// Slip of the driven wheels as a share, angle of the front wheels \[rad\] and side velocity as a share of the speed, at
    /// `time` \[s\].
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub fn at(&self, time: f64) -> [f64; 3] {
        let place = (time / GRID).max(0.0);
        let first = place.floor() as usize;
        let (Some(a), Some(b)) = (self.samples.get(first), self.samples.get(first + 1)) else {
            return [0.0; 3];
        };
        let share = place - place.floor();
        core::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
    }
}
