//! What a way from the start to a node costs at least, so that what cannot become better than the best plan known is
//! not looked at.
//!
//! Three bounds add up. No way is shorter than the distance, than the arc of the turn, or than what it takes to get
//! as far sideways with both headings given: along a way of length `L` with curvatures of at most `k` the heading
//! leaves that of one end by no more than `k s` and that of the other by no more than `k (L - s)`, whatever the
//! directions of travel, and what is gained sideways is the integral of its sine. Driving it in one go takes least
//! time, since each piece begins and ends at rest. And the steering goes from straight ahead to the next piece's
//! curvature: by way of another one where no line and arc of that curvature lead there.

use core::f64::consts::{FRAC_PI_2, PI};

use kerbside_geometry::{Pose, angle, math};

use crate::pace::Pace;

/// Rounding of lengths, in radii of the sharpest turn.
const ROUNDING: f64 = 1e-6;

/// Lower bounds of what lies between the start and a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    pace: Pace,
    start: Pose,
    heading: (f64, f64),
    curvature: f64,
    /// The least that a further change of the steering takes \[s\], ...
    change: f64,
    /// ... and a further piece \[s\].
    piece: f64,
}

/// A pose as seen from the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    offset: [f64; 2],
    heading: (f64, f64),
    /// The shortest way there is no shorter \[m\].
    length: f64,
}

impl Bound {
    /// Of ways from `start` with curvatures of at most `curvature`.
    pub(crate) fn new(pace: Pace, start: Pose, curvature: f64) -> Self {
        let heading = math::sin_cos(start.yaw);
        let (change, piece) = (pace.steer_least(), pace.drive_time(0.0));
        Self { pace, start, heading, curvature, change, piece }
    }

    pub(crate) fn place(&self, pose: &Pose) -> Place {
        let offset = [pose.x - self.start.x, pose.y - self.start.y];
        let heading = math::sin_cos(pose.yaw);
        let turn = angle::wrap(pose.yaw - self.start.yaw).abs();
        let straight = dot(offset, offset).sqrt().max(turn / self.curvature);
        let length = if turn > FRAC_PI_2 {
            straight
        } else {
            let sideways = across(offset, self.heading).abs().max(across(offset, heading).abs());
            straight.max(self.length_sideways(sideways * self.curvature, turn))
        };
        Place { offset, heading, length }
    }

    /// The shortest way that gets so far sideways \[radii\] with a turn of at most a quarter \[m\].
    fn length_sideways(&self, sideways: f64, turn: f64) -> f64 {
        // What is gained by turning away as far as one may, and back: 1 + cos(turn) - 2 cos(farthest).
        let cosine = 0.5 * (1.0 + math::cos(turn) - (sideways - ROUNDING).max(0.0));
        let radii = if cosine > 0.0 {
            2.0 * math::acos(cosine.min(1.0)) - turn
        } else {
            PI - turn - 2.0 * cosine
        };
        radii / self.curvature
    }

    /// Least time to a place from which the way goes on with curvature `next`, to which the steering takes `first`
    /// \[s\].
    pub(crate) fn time(&self, place: &Place, next: f64, first: f64) -> f64 {
        let drive = if place.length > 0.0 { self.pace.drive_time(place.length) } else { 0.0 };
        let detour = if self.leads_to(place, next) { 0.0 } else { self.detour(next) };
        drive + first + detour
    }

    /// The same, of ways whose last piece before the place has that curvature.
    pub(crate) fn time_before(&self, place: &Place, last: f64, first: f64) -> f64 {
        let further = if self.leads_to(place, last) { 0.0 } else { self.piece };
        self.time(place, last, first) + further
    }

    /// Least time that the steering takes longer by way of a further curvature \[s\].
    fn detour(&self, next: f64) -> f64 {
        if next == 0.0 { 2.0 * self.change } else { self.change }
    }

    /// Whether the line through the start is that through the place, or touches its circle of that curvature: nothing
    /// else gets there without a further curvature.
    fn leads_to(&self, place: &Place, curvature: f64) -> bool {
        let (sin, cos) = place.heading;
        let rounding = ROUNDING / self.curvature;
        if curvature == 0.0 {
            let turn = across([cos, sin], self.heading).abs();
            return turn < ROUNDING && across(place.offset, place.heading).abs() < rounding;
        }
        let radius = 1.0 / curvature;
        let centre = [place.offset[0] - sin * radius, place.offset[1] + cos * radius];
        (across(centre, self.heading) - radius).abs() < rounding
    }
}

/// How far to the left of a heading.
fn across(offset: [f64; 2], (sin, cos): (f64, f64)) -> f64 {
    cos * offset[1] - sin * offset[0]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PlannerSettings;
    use crate::cost::Cost;
    use crate::segment::{Piece, Segment};
    use kerbside_geometry::Vehicle;
    use proptest::prelude::*;

    fn cost(pieces: &[Piece], next: &Piece, cost: &Cost) -> f64 {
        let first = cost.first(pieces.first().unwrap_or(next));
        let each: f64 = pieces.iter().map(|piece| cost.piece(piece, false)).sum();
        let chained = pieces.iter().chain([next]).collect::<Vec<_>>();
        let joints: f64 = chained.windows(2).map(|pair| cost.joint(pair[0], pair[1])).sum();
        first + each + joints
    }

    fn pieces() -> impl Strategy<Value = Vec<(f64, f64)>> {
        let bend = prop_oneof![Just(0.0), Just(1.0), Just(-1.0), Just(0.5), -1.0..1.0];
        prop::collection::vec((-1.5..1.5, bend), 0..5)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

        #[test]
        fn no_way_costs_less_than_the_bound(
            (x, y, yaw) in (-2.0..2.0, -2.0..2.0, -7.0..7.0),
            way in pieces(),
            next in prop_oneof![Just(0.0), Just(1.0), Just(-1.0), Just(0.5), Just(-0.5)],
            same in any::<bool>(),
        ) {
            let vehicle = Vehicle::paper_car();
            let pace = Pace::new(&vehicle, &PlannerSettings::default(), 0.2);
            let limit = 1.06;
            let costs = Cost::new(pace, vehicle.wheelbase, limit);
            let start = Pose::new(x, y, yaw);
            let mut pieces: Vec<Piece> =
                way.iter().map(|(length, share)| Piece::new(*length, share * limit)).collect();
            let next = Piece::new(0.4, next * limit);
            // Now and then the way ends on the arc that goes on.
            if same && let Some(last) = pieces.last_mut() {
                last.curvature = next.curvature;
            }
            let end = pieces.iter().fold(start, |pose, piece| Segment::new(pose, *piece).end());
            let bound = Bound::new(pace, start, limit);
            let place = bound.place(&end);
            let length: f64 = pieces.iter().map(|piece| piece.length.abs()).sum();
            prop_assert!(place.length <= length + 1e-9, "{} above {}", place.length, length);
            let found = cost(&pieces, &next, &costs);
            let least = bound.time(&place, next.curvature, costs.first(&next));
            prop_assert!(least <= found + 1e-9, "{} above {}", least, found);
            // With that arc before it as a piece of the way.
            let least = bound.time_before(&place, next.curvature, costs.first(&next));
            let more = cost(&pieces, &next, &costs) + costs.piece(&next, false);
            prop_assert!(least <= more + 1e-9, "{} above {}", least, more);
        }
    }
}
