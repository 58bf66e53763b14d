//! The pieces a path is made of.

use kerbside_geometry::Pose;

/// Length and curvature of an arc or a line, without a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Piece {
    /// Signed like the direction of travel \[m\].
    pub(crate) length: f64,
    /// Positive to the left, whatever the direction of travel \[1/m\].
    pub(crate) curvature: f64,
}

impl Piece {
    pub(crate) const fn new(length: f64, curvature: f64) -> Self {
        Self { length, curvature }
    }

    pub(crate) fn gear(&self) -> i8 {
        if self.length < 0.0 { -1 } else { 1 }
    }

    /// Whether the car may go from one to the other without stopping.
    pub(crate) fn continues(&self, next: &Self) -> bool {
        self.gear() == next.gear() && (self.curvature - next.curvature).abs() < 1e-9
    }

    /// Where it starts when it ends at `end`.
    pub(crate) fn start_before(&self, end: &Pose) -> Pose {
        end.advance(-self.length, -self.length * self.curvature)
    }
}

/// An arc or a line, driven with the steering at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Pose at its beginning.
    pub start: Pose,
    /// Distance driven \[m\]; negative in reverse.
    pub length: f64,
    /// Curvature of the rear-axle centre's path \[1/m\]: positive with the wheels to the left,
    /// whatever the direction of travel.
    pub curvature: f64,
}

impl Segment {
    pub(crate) fn new(start: Pose, piece: Piece) -> Self {
        Self { start, length: piece.length, curvature: piece.curvature }
    }

    /// Pose after `distance` \[m\] from its beginning, signed like the length; yaw is not wrapped.
    #[must_use]
    pub fn pose_at(&self, distance: f64) -> Pose {
        self.start.advance(distance, distance * self.curvature)
    }

    /// Pose at its end.
    #[must_use]
    pub fn end(&self) -> Pose {
        self.pose_at(self.length)
    }

    /// Direction of travel: 1 forward, -1 reverse.
    #[must_use]
    pub fn gear(&self) -> i8 {
        self.piece().gear()
    }

    pub(crate) fn piece(&self) -> Piece {
        Piece::new(self.length, self.curvature)
    }
}

/// The pieces one after the other from `start`, those that continue each other made one.
pub(crate) fn chain(start: Pose, pieces: &[Piece]) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::with_capacity(pieces.len());
    let mut pose = start;
    for piece in pieces {
        match segments.last_mut() {
            Some(last) if last.piece().continues(piece) => last.length += piece.length,
            _ => segments.push(Segment::new(pose, *piece)),
        }
        pose = segments.last().map_or(pose, Segment::end);
    }
    segments
}

/// Changes of the travel direction along the pieces.
pub(crate) fn gear_changes(gears: impl Iterator<Item = i8>) -> u32 {
    let mut previous = 0;
    let mut changes = 0;
    for gear in gears {
        changes += u32::from(previous != 0 && gear != previous);
        previous = gear;
    }
    changes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_that_continue_each_other_become_one() {
        let pieces = [(0.3, 0.5), (0.2, 0.5), (-0.2, 0.5), (-0.4, 0.0), (-0.1, 0.0)];
        let pieces = pieces.map(|(length, curvature)| Piece::new(length, curvature));
        let segments = chain(Pose::new(1.0, 2.0, 3.0), &pieces);
        let lengths: Vec<f64> = segments.iter().map(|segment| segment.length).collect();
        assert_eq!(lengths, [0.5, -0.2, -0.5]);
        assert_eq!(gear_changes(segments.iter().map(Segment::gear)), 1);
        for pair in segments.windows(2) {
            assert_eq!(pair[0].end(), pair[1].start);
        }
    }

    #[test]
    fn a_piece_starts_where_it_must_to_end_there() {
        let end = Pose::new(0.4, -0.2, 1.0);
        for piece in [Piece::new(0.7, -1.0), Piece::new(-0.5, 0.8), Piece::new(0.2, 0.0)] {
            let again = Segment::new(piece.start_before(&end), piece).end();
            assert!(again.distance(&end) < 1e-15 && (again.yaw - end.yaw).abs() < 1e-15);
        }
    }
}
