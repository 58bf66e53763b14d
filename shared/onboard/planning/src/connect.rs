//! Ways from pose to pose in closed form: few arcs and lines, in any directions of travel.
//!
//! Lengths are signed all through: a length that comes out negative is driven in reverse, so that
//! one formula holds for a curve without and with a change of direction (the words of Reeds and
//! Shepp, Optimal paths for a car that goes both forwards and backwards, 1990, that have at most
//! three pieces and a line in them, here with any radii; and pairs of arcs of free radius).

use kerbside_geometry::{Pose, angle, math};

use crate::segment::Piece;

/// A straight or nearly straight way is no arc below this share of the greatest curvature.
const STRAIGHT: f64 = 1e-4;
/// Pieces shorter than this are rounding \[m\].
const NOTHING: f64 = 1e-10;

/// Up to three pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Link {
    pieces: [Piece; 3],
    count: usize,
}

impl Link {
    fn new(pieces: &[Piece]) -> Self {
        let mut link = Self { pieces: [Piece::new(0.0, 0.0); 3], count: 0 };
        for piece in pieces.iter().filter(|piece| piece.length.abs() > NOTHING) {
            link.pieces[link.count] = *piece;
            link.count += 1;
        }
        link
    }

    pub(crate) fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.count]
    }
}

/// Appends to `links` ways from one pose to the other with curvatures of at most `limit` \[1/m\],
/// every one exact.
pub(crate) fn links(from: &Pose, to: &Pose, limit: f64, links: &mut Vec<Link>) {
    let ends = Ends::new(from, to);
    ends.one_bend(limit, links);
    for first in [limit, -limit] {
        for last in [limit, -limit] {
            ends.two_bends(first, last, links);
        }
    }
    ends.two_gentle_bends(limit, links);
}

/// Start, end, and what all the ways need of them.
struct Ends {
    from: Pose,
    to: Pose,
    from_left: [f64; 2],
    to_left: [f64; 2],
    offset: [f64; 2],
    turn: f64,
}

impl Ends {
    fn new(from: &Pose, to: &Pose) -> Self {
        let left = |pose: &Pose| {
            let (sin, cos) = math::sin_cos(pose.yaw);
            [-sin, cos]
        };
        Self {
            from: *from,
            to: *to,
            from_left: left(from),
            to_left: left(to),
            offset: [to.x - from.x, to.y - from.y],
            turn: angle::wrap(to.yaw - from.yaw),
        }
    }

    /// An arc between the lines on which the two poses lie. From the lines' intersection both
    /// ends of the arc are as far as `tan(turn / 2) / curvature`.
    fn one_bend(&self, limit: f64, links: &mut Vec<Link>) {
        let half = math::tan(0.5 * self.turn);
        let sine = math::sin(self.turn);
        if sine.abs() < 1e-9 {
            return;
        }
        let (heading, other) = ([self.from_left[1], -self.from_left[0]], self.to_left);
        let ahead = dot(self.offset, other) / dot(heading, other);
        let beyond = dot(self.offset, self.from_left) / sine;
        for tangent in [ahead, beyond, half / limit, -half / limit] {
            let curvature = half / tangent;
            if curvature.abs() > limit * (1.0 + 1e-13) || curvature.abs() < STRAIGHT * limit {
                continue;
            }
            links.push(Link::new(&[
                Piece::new(ahead - tangent, 0.0),
                Piece::new(self.turn / curvature, curvature),
                Piece::new(beyond - tangent, 0.0),
            ]));
        }
    }

    /// Arc, line, arc. In the line's frame the centres are its length apart along it and
    /// `1 / last - 1 / first` across it.
    fn two_bends(&self, first: f64, last: f64, links: &mut Vec<Link>) {
        let centres = self.between_centres(1.0 / first, 1.0 / last);
        let across = 1.0 / last - 1.0 / first;
        let square = dot(centres, centres) - across * across;
        if square < 0.0 {
            return;
        }
        for line in [square.sqrt(), -square.sqrt()] {
            let heading = math::atan2(centres[1], centres[0]) - math::atan2(across, line);
            links.push(self.bends(first, line, last, heading));
        }
    }

    /// Two arcs of equal and opposite curvature, as gentle as they can be: the line between them
    /// has no length, so the centres are two radii apart, which is a quadratic in the radius.
    fn two_gentle_bends(&self, limit: f64, links: &mut Vec<Link>) {
        let sum = [0, 1].map(|i| self.to_left[i] + self.from_left[i]);
        // |offset - radius * sum|^2 = 4 radius^2
        let (a, b, c) = (dot(sum, sum) - 4.0, dot(self.offset, sum), dot(self.offset, self.offset));
        for inverse in inverse_roots(a, b, c) {
            let curvature = inverse;
            if curvature.abs() > limit || curvature.abs() < STRAIGHT * limit {
                continue;
            }
            let centres = self.between_centres(1.0 / curvature, -1.0 / curvature);
            let heading = math::atan2(centres[1], centres[0]) - math::atan2(-2.0 / curvature, 0.0);
            links.push(self.bends(curvature, 0.0, -curvature, heading));
        }
    }

    fn between_centres(&self, first: f64, last: f64) -> [f64; 2] {
        [0, 1].map(|i| self.offset[i] + self.to_left[i] * last - self.from_left[i] * first)
    }

    fn bends(&self, first: f64, line: f64, last: f64, heading: f64) -> Link {
        Link::new(&[
            Piece::new(angle::wrap(heading - self.from.yaw) / first, first),
            Piece::new(line, 0.0),
            Piece::new(angle::wrap(self.to.yaw - heading) / last, last),
        ])
    }
}

/// The inverses of the roots of `a x^2 - 2 b x + c = 0`.
fn inverse_roots(a: f64, b: f64, c: f64) -> impl Iterator<Item = f64> {
    // With y = 1/x: c y^2 - 2 b y + a = 0, without trouble where a is 0.
    let root = (b * b - a * c).max(0.0).sqrt();
    [(b + root) / c, (b - root) / c].into_iter().filter(|inverse| inverse.is_finite())
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::chain;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_link_ends_where_it_should_within_the_limit(
            from in (-2.0..2.0, -2.0..2.0, -7.0..7.0),
            to in (-2.0..2.0, -2.0..2.0, -7.0..7.0),
            limit in 0.2..2.0,
        ) {
            let from = Pose::new(from.0, from.1, from.2);
            let to = Pose::new(to.0, to.1, to.2);
            // Nearly parallel lines meet kilometres away, where rounding is as large.
            prop_assume!(math::sin(to.yaw - from.yaw).abs() > 1e-2);
            let mut found = Vec::new();
            links(&from, &to, limit, &mut found);
            prop_assert!(found.len() >= 4, "only {}", found.len());
            for link in &found {
                let end = chain(from, link.pieces()).last().unwrap().end();
                // Where circles touch, a length is the root of what is zero but for rounding.
                prop_assert!(end.distance(&to) < 1e-7, "{:?} ends at {:?}", link, end);
                prop_assert!(angle::wrap(end.yaw - to.yaw).abs() < 1e-9);
                for piece in link.pieces() {
                    prop_assert!(piece.curvature.abs() <= limit * (1.0 + 1e-12));
                }
            }
        }
    }

    fn shapes(to: Pose, limit: f64) -> Vec<usize> {
        let mut found = Vec::new();
        links(&Pose::default(), &to, limit, &mut found);
        found.iter().map(|link| link.pieces().len()).collect()
    }

    #[test]
    fn simple_ways_are_found_as_such() {
        assert!(shapes(Pose::new(2.0, 0.0, 0.0), 1.0).contains(&1), "a line");
        assert!(shapes(Pose::new(2.0, 1.0, 0.0), 1.0).contains(&2), "an S of two arcs");
        let quarter = Pose::default().advance(3.0, 1.5);
        assert!(shapes(quarter, 1.0).iter().any(|count| *count <= 2), "an arc");
    }

    #[test]
    fn a_way_to_where_one_is_has_no_pieces() {
        assert!(shapes(Pose::default(), 1.0).contains(&0));
    }
}
