//! What one reading brought, kept for as long as it may have to be gone through again.

use kerbside_messages::Nanos;

use super::axles::Axle;

/// The steering sensor's part of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Steered {
    /// Cosine and sine of the angle that the reading's way is taken to have had.
    pub(crate) direction: (f64, f64),
    /// Variance of that angle, times how much of its error it has in common with the way before
    /// \[rad^2\].
    pub(crate) variance: f64,
}

/// The gyro's part of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Turned {
    /// Turn since the previous motion \[rad\], its variance and the time \[s\].
    pub(crate) turn: f64,
    pub(crate) variance: f64,
    pub(crate) time: f64,
}

/// One reading in which a wheel turned.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Record {
    /// Time in which the wheels turned so far \[ns\].
    pub(crate) start: Nanos,
    pub(crate) end: Nanos,
    /// Travel of each wheel's counter \[m\].
    pub(crate) travel: [f64; 4],
    /// Which wheels tell their travel, and which are read for the first time.
    pub(crate) read: [bool; 4],
    pub(crate) begun: [bool; 4],
    /// Which of them at the same moments as the others.
    pub(crate) aligned: [bool; 4],
    /// Which of them contradict the others.
    pub(crate) excluded: [bool; 4],
    /// The axle that slips, if one does.
    pub(crate) slipping: Option<Axle>,
    pub(crate) steered: Option<Steered>,
    pub(crate) turned: Option<Turned>,
    /// The path between the ends is not known but by its largest curvature \[1/m\].
    pub(crate) gap: Option<f64>,
    /// Sums up to this record, of what the axles say.
    pub(crate) axles: AxleSums,
}

impl Record {
    /// Whether the rear wheels alone tell the motion, whatever the path was.
    pub(crate) fn rear_tells(&self) -> bool {
        [2, 3].into_iter().all(|wheel| self.believed(wheel) && self.aligned[wheel])
    }

    /// Which wheels are read and believed.
    pub(crate) fn believed(&self, wheel: usize) -> bool {
        let slips = self.slipping.is_some_and(|axle| axle.wheels()[wheel]);
        self.read[wheel] && !self.excluded[wheel] && !slips
    }
}

/// Sums since the history began, for differences over a window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AxleSums {
    /// Way rolled \[m\].
    pub(crate) way: f64,
    /// Distance and turn that the rear says beyond the front \[m, rad\].
    pub(crate) distance: f64,
    pub(crate) turn: f64,
    /// Turn that each axle's difference says beyond its own mean and the steering angle: front,
    /// rear \[rad\].
    pub(crate) beyond_steering: [f64; 2],
    /// Distance by axle: front, rear \[m\].
    pub(crate) rolled: [f64; 2],
    /// Way across the body that the front wheels' directions have, squared, times way \[m\].
    pub(crate) across: f64,
    /// Records in which not both axles told.
    pub(crate) lacking: u32,
}
