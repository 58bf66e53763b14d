//! What can be driven: a library of manoeuvres as commands by time, scaled to a vehicle's limits.
//!
//! Nothing here knows how a vehicle responds. Each [`Manoeuvre`] has a name, stands still for [`STILL`] at its start so
//! that sensors and start pose can be read, and lasts as long as it is asked to.

mod all;
mod piece;

use kerbside_geometry::Vehicle;

use piece::Piece;

pub use all::NAMES;

/// Standing at the start of each manoeuvre \[s\].
pub const STILL: f64 = 1.0;

/// What is asked of the actuators from a time on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// Since the start \[s\].
    pub time: f64,
    /// Of the rear-axle centre, negative in reverse \[m/s\].
    pub speed: f64,
    /// Road-wheel angle, left positive \[rad\].
    pub steering: f64,
}

/// How a manoeuvre is driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Fastest speed, as a share of the vehicle's limit, above 0 to 1.
    pub speed: f64,
    /// Largest angle, as a share of the vehicle's limit, above 0 to 1.
    pub steering: f64,
    /// Whether left and right are exchanged.
    pub mirrored: bool,
}

impl Style {
    /// Nine tenths of what the vehicle can.
    pub const BRISK: Self = Self { speed: 0.9, steering: 0.9, mirrored: false };
}

/// Commands by time.
#[derive(Clone, Debug, PartialEq)]
pub struct Manoeuvre {
    /// Its name: one of [`NAMES`].
    pub name: &'static str,
    /// The word for it that a run's description uses: straight, circle, slalom, steps, parking, shuttle.
    pub kind: &'static str,
    /// \[s\].
    pub duration: f64,
    /// Ends of the pieces \[s\], and the pieces.
    pieces: Vec<(f64, Piece)>,
}

impl Manoeuvre {
    /// The manoeuvre called `name`, driven by `vehicle` in `style` for `duration` \[s\]; none of an unknown name.
    #[must_use]
    pub fn new(name: &str, vehicle: &Vehicle, style: Style, duration: f64) -> Option<Self> {
        let (name, kind, shares) = all::pieces(name)?;
        let (limits, side) = (&vehicle.limits, if style.mirrored { -1.0 } else { 1.0 });
        let whole: f64 = shares.iter().map(|piece| piece.duration).sum();
        let time = (duration - STILL).max(0.0);
        let mut end = STILL;
        let scaled = |piece: Piece| {
            let seconds = time * piece.duration / whole;
            end += seconds;
            let scaled = Piece {
                duration: seconds,
                speed: style.speed * limits.speed * piece.speed,
                steering: side * style.steering * limits.steering * piece.steering,
                shape: piece.shape,
            };
            (end, scaled)
        };
        let pieces = shares.into_iter().map(scaled).collect();
        Some(Self { name, kind, duration, pieces })
    }

    /// Every manoeuvre.
    #[must_use]
    pub fn all(vehicle: &Vehicle, style: Style, duration: f64) -> Vec<Self> {
        NAMES.iter().filter_map(|name| Self::new(name, vehicle, style, duration)).collect()
    }

    /// What is asked at `time` \[s\].
    #[must_use]
    pub fn at(&self, time: f64) -> Asked {
        let standing = Asked { time, ..Asked::default() };
        if time < STILL {
            return standing;
        }
        let at = self.pieces.partition_point(|piece| piece.0 <= time);
        let before = at.checked_sub(1).and_then(|before| self.pieces.get(before));
        let Some((end, piece)) = self.pieces.get(at) else {
            return standing;
        };
        let share = 1.0 - (end - time) / piece.duration;
        let (speed, steering) = piece.at(share, before.map_or((0.0, 0.0), |before| before.1.end()));
        Asked { time, speed, steering }
    }

    /// Commands at `rate` \[Hz\], as a sender without jitter sends them.
    #[must_use]
    pub fn commands(&self, rate: f64) -> Vec<Asked> {
        let times = (0_u32..).map(|k| f64::from(k) / rate).take_while(|time| *time < self.duration);
        times.map(|time| self.at(time)).collect()
    }
}

#[cfg(test)]
mod tests;
