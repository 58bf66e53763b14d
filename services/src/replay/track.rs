//! What is kept of a drive's odometry.

use bytemuck::bytes_of;
use kerbside_geometry::Pose;
use kerbside_messages::{EstimatorState, Header, Message, Nanos, Odometry};
use kerbside_recordings::drift::EstimatedPose;
use sha2::{Digest, Sha256};

/// The SHA-256 of some odometry over what is the same however it was computed: of each sample, in order, stamp,
/// sequence and payload. Left out is what belongs to the sending: epoch, time of sending, check sum.
#[derive(Clone, Debug, Default)]
pub struct Digester(Sha256);

impl Digester {
    /// Takes in the next sample.
    pub fn take(&mut self, odometry: &Odometry) {
        let header = odometry.header();
        self.0.update(header.stamp.to_le_bytes());
        self.0.update(header.sequence.to_le_bytes());
        self.0.update(&bytes_of(odometry)[size_of::<Header>()..]);
    }

    /// The digest in hexadecimal.
    #[must_use]
    pub fn text(self) -> String {
        self.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// A stretch over which readings are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// Stamp of the last estimate before.
    pub from: Nanos,
    /// Stamp of the first with wheels after.
    pub to: Nanos,
}

/// A drive's odometry, as far as somebody asks for it afterwards.
#[derive(Clone, Debug, Default)]
pub struct Track {
    digester: Digester,
    /// Poses with their stamps.
    pub poses: Vec<EstimatedPose>,
    /// Speed and steering angle with each pose \[m/s, rad\].
    pub motions: Vec<[f64; 2]>,
    /// Stretches without readings.
    pub gaps: Vec<Stretch>,
    /// When the pose was lost for the first time.
    pub lost: Option<Nanos>,
    /// The newest sample.
    pub newest: Option<Odometry>,
}

impl Track {
    /// An empty one with room for so many samples.
    #[must_use]
    pub fn with_capacity(samples: usize) -> Self {
        Self {
            poses: Vec::with_capacity(samples),
            motions: Vec::with_capacity(samples),
            ..Self::default()
        }
    }

    /// Takes in the next sample.
    pub fn push(&mut self, odometry: &Odometry) {
        self.digester.take(odometry);
        let stamp = odometry.header.stamp;
        let pose = Pose::new(odometry.x, odometry.y, odometry.yaw);
        self.take_gap(odometry);
        self.poses.push(EstimatedPose { stamp, pose, distance: odometry.distance });
        self.motions.push([odometry.speed, odometry.steering]);
        if odometry.state == EstimatorState::Lost.code() {
            self.lost.get_or_insert(stamp);
        }
        self.newest = Some(*odometry);
    }

    fn take_gap(&mut self, odometry: &Odometry) {
        let Some(before) = self.newest.filter(|_| odometry.gap == 1) else { return };
        let (from, to) = (before.header.stamp, odometry.header.stamp);
        match self.gaps.last_mut() {
            Some(gap) if before.gap == 1 && gap.to == from => gap.to = to,
            _ => self.gaps.push(Stretch { from, to }),
        }
    }

    /// Samples taken in.
    #[must_use]
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether nothing was taken in.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// The digest of all samples, in hexadecimal.
    #[must_use]
    pub fn sha256(&self) -> String {
        self.digester.clone().text()
    }

    /// Distance rolled in either direction \[m\].
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.newest.map_or(0.0, |odometry| odometry.distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn odometry(sequence: u64, gap: u8) -> Odometry {
        let mut odometry = Odometry { gap, x: 0.5, ..Odometry::default() };
        (odometry.header.stamp, odometry.header.sequence) = (10 * sequence, sequence);
        odometry
    }

    fn digest_of(odometry: &Odometry) -> String {
        let mut digester = Digester::default();
        digester.take(odometry);
        digester.text()
    }

    #[test]
    fn the_digest_sees_content_and_place_but_not_the_sending() {
        let one = odometry(3, 0);
        let mut same = one;
        same.header.epoch = 77;
        (same.header.sent, same.header.check_sum) = (5, 9);
        assert_eq!(digest_of(&same), digest_of(&one));
        let mut others = [one; 4];
        others[0].header.stamp += 1;
        others[1].header.sequence += 1;
        others[2].yaw = -0.0;
        others[3].covariance[8] = f64::EPSILON;
        assert!(others.iter().all(|other| digest_of(other) != digest_of(&one)));
    }

    #[test]
    fn a_gap_lasts_until_wheels_come_again() {
        let mut track = Track::default();
        for (sequence, gap) in [(1, 0), (2, 1), (3, 1), (4, 0), (5, 1)] {
            track.push(&odometry(sequence, gap));
        }
        assert_eq!(track.gaps, [Stretch { from: 10, to: 30 }, Stretch { from: 40, to: 50 }]);
        assert_eq!(track.len(), 5);
    }
}
