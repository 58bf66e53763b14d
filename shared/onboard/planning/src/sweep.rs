//! Exact clearance of the footprint over a whole segment.
//!
//! Along a line the footprint sweeps a longer rectangle. Along an arc it turns about one centre,
//! so every corner of the car runs on a circle, and, seen from the car, so does every corner of
//! an obstacle. The distance of two convex outlines is that of a corner of one to an edge of the
//! other; over the turn it is least either at an end of the turn or where the corner's radius is
//! square to the edge or points at the other corner. All of these have closed forms: nothing is
//! sampled, and what is found holds for every pose in between.

use kerbside_geometry::{Footprint, Pose, convex_distance, math};

use crate::segment::Segment;
use crate::world::{Edge, Nearest, Obstacle, World};

/// What is clear by more than this needs no exact distance \[m\].
const ROUNDING: f64 = 1e-9;

/// The region a footprint covers along a segment.
#[allow(clippy::large_enum_variant)] // made, asked and dropped on the stack, thousands of times
pub(crate) enum Sweep {
    /// Along a line: a rectangle.
    Line([[f64; 2]; 4]),
    /// Along an arc.
    Turn(Turn),
}

impl Sweep {
    pub(crate) fn new(footprint: &Footprint, segment: &Segment) -> Self {
        if segment.curvature == 0.0 || segment.length == 0.0 {
            return Self::Line(stretched(footprint, segment));
        }
        Self::Turn(Turn::new(footprint, segment))
    }

    fn distance_to(&self, obstacle: &Obstacle) -> f64 {
        match self {
            Self::Line(outline) => convex_distance(outline, obstacle.polygon.corners()),
            Self::Turn(turn) => turn.distance_to(obstacle),
        }
    }

    fn depth(&self, world: &World) -> f64 {
        match self {
            Self::Line(outline) => world.bounds.depth(outline),
            Self::Turn(turn) => turn.depth(world),
        }
    }

    /// A lower bound, quickly had, of the distance to an obstacle \[m\].
    fn at_least(&self, obstacle: &Obstacle) -> f64 {
        match self {
            Self::Line(outline) => {
                let centre = middle(outline[0], outline[2]);
                obstacle.at_least(centre, length(minus(outline[0], centre)))
            }
            Self::Turn(turn) => obstacle.at_least(turn.disc, turn.disc_radius),
        }
    }

    /// A lower bound, quickly had, of the depth \[m\].
    fn depth_at_least(&self, world: &World) -> f64 {
        match self {
            Self::Line(_) => f64::NEG_INFINITY,
            Self::Turn(turn) => world.bounds.depth(&[turn.disc]) - turn.disc_radius,
        }
    }

    /// Whether all of the sweep is at least so far beyond the line of one of the obstacle's edges: most obstacles that
    /// are near are beside the car.
    fn is_beyond_a_side(&self, obstacle: &Obstacle, distance: f64) -> bool {
        obstacle.edges.iter().any(|edge| {
            let outward = [edge.along[1], -edge.along[0]];
            let enough = dot(edge.start, outward) + distance;
            match self {
                Self::Line(outline) => outline.iter().all(|corner| dot(*corner, outward) >= enough),
                Self::Turn(turn) => turn.is_beyond(outward, enough),
            }
        })
    }

    /// Least distance from everything solid along the segment \[m\], and from what; at most 0
    /// where the way touches something or leaves the bounds. It must not start inside an obstacle.
    pub(crate) fn clearance(&self, world: &World) -> (f64, Nearest) {
        let mut least = (self.depth(world), Nearest::Bounds);
        for (index, obstacle) in world.obstacles.iter().enumerate() {
            if self.at_least(obstacle) < least.0 {
                let distance = self.distance_to(obstacle);
                if distance < least.0 {
                    least = (distance, Nearest::Obstacle(index));
                }
            }
        }
        least
    }

    /// Whether the clearance is at least `needed` \[m\], where it is so at the segment's start.
    pub(crate) fn stays_clear(&self, world: &World, needed: f64) -> bool {
        let plainly = needed + ROUNDING;
        (self.depth_at_least(world) >= plainly || self.depth(world) >= needed)
            && world.obstacles.iter().all(|obstacle| {
                self.at_least(obstacle) >= plainly
                    || self.is_beyond_a_side(obstacle, plainly)
                    || self.stays_clear_of(obstacle, needed)
            })
    }

    fn stays_clear_of(&self, obstacle: &Obstacle, needed: f64) -> bool {
        match self {
            Self::Line(_) => self.distance_to(obstacle) >= needed,
            Self::Turn(turn) => turn.stays_clear_of(obstacle, needed),
        }
    }
}

/// The footprint at the line's start, its far side moved on by the line's length.
fn stretched(footprint: &Footprint, segment: &Segment) -> [[f64; 2]; 4] {
    let (forward, back) = (segment.length.max(0.0), (-segment.length).max(0.0));
    let swept = Footprint {
        length: footprint.length + forward + back,
        rear_overhang: footprint.rear_overhang + back,
        ..*footprint
    };
    swept.corners_at(&segment.start)
}

/// A footprint turning about a centre.
pub(crate) struct Turn {
    centre: [f64; 2],
    start: [[f64; 2]; 4],
    end: [[f64; 2]; 4],
    /// The ways of the car's corners about the centre.
    corners: [Arc; 4],
    /// The car's edges in its own frame, about the centre.
    edges: [Edge; 4],
    /// Start pose's sine and cosine, and those of half the angle turned.
    heading: (f64, f64),
    half: (f64, f64),
    /// A disc that holds the whole sweep.
    disc: [f64; 2],
    disc_radius: f64,
}

impl Turn {
    fn new(footprint: &Footprint, segment: &Segment) -> Self {
        let half_turn = 0.5 * segment.length * segment.curvature;
        let heading = math::sin_cos(segment.start.yaw);
        let half = math::sin_cos(half_turn);
        let radius = 1.0 / segment.curvature;
        let Pose { x, y, .. } = segment.start;
        let centre = [x - heading.0 * radius, y + heading.1 * radius];
        let own = footprint.corners();
        let about = own.map(|corner| [corner[0], corner[1] - radius]);
        let start = about.map(|corner| plus(centre, rotate(corner, heading)));
        let middle_heading = double(heading, half);
        let end_heading = double(middle_heading, half);
        let half_cos = closing(half_turn, half.1);
        let arc = |corner| Arc::new(rotate(corner, middle_heading), half_cos);
        let (disc, disc_radius) = disc_around(&about, centre, middle_heading, half_turn);
        Self {
            centre,
            start,
            end: about.map(|corner| plus(centre, rotate(corner, end_heading))),
            corners: about.map(arc),
            edges: [0, 1, 2, 3].map(|i| Edge::between(about[i], about[(i + 1) % 4])),
            heading,
            half,
            disc,
            disc_radius,
        }
    }

    fn distance_to(&self, obstacle: &Obstacle) -> f64 {
        let solid = obstacle.polygon.corners();
        let ends = convex_distance(&self.start, solid).min(convex_distance(&self.end, solid));
        if ends == 0.0 {
            return 0.0;
        }
        ends.min(self.corners_past(obstacle)).min(self.edges_past(solid))
    }

    /// Whether every corner stays beyond `enough` in a direction of length 1: at both ends and, where it turns back
    /// there, in between.
    fn is_beyond(&self, direction: [f64; 2], enough: f64) -> bool {
        let centre = dot(self.centre, direction);
        let ends = self.start.iter().chain(&self.end);
        ends.copied().all(|corner| dot(corner, direction) >= enough)
            && self.corners.iter().all(|arc| {
                dot(arc.middle, direction) > -arc.half_cos || centre - arc.radius >= enough
            })
    }

    fn stays_clear_of(&self, obstacle: &Obstacle, needed: f64) -> bool {
        let solid = obstacle.polygon.corners();
        convex_distance(&self.end, solid) >= needed
            && self.corners_past(obstacle) >= needed
            && self.edges_past(solid) >= needed
    }

    /// The car's corners running past the obstacle's edges and corners.
    fn corners_past(&self, obstacle: &Obstacle) -> f64 {
        let mut least = f64::INFINITY;
        for edge in &obstacle.edges {
            let edge = Edge { start: minus(edge.start, self.centre), ..*edge };
            for arc in &self.corners {
                least = least.min(arc.past_point(edge.start)).min(arc.past_edge(&edge));
            }
        }
        least
    }

    /// The obstacle's corners running, seen from the car, past the car's edges.
    fn edges_past(&self, solid: &[[f64; 2]]) -> f64 {
        let (sin, cos) = self.heading;
        let half_cos = self.corners[0].half_cos;
        let mut least = f64::INFINITY;
        for corner in solid {
            let own = rotate(minus(*corner, self.centre), (-sin, cos));
            let arc = Arc::new(rotate(own, (-self.half.0, self.half.1)), half_cos);
            for edge in &self.edges {
                least = least.min(arc.past_edge(edge));
            }
        }
        least
    }

    /// Distance of the sweep from the bounds' sides, from inside.
    fn depth(&self, world: &World) -> f64 {
        let ends = world.bounds.depth(&self.start).min(world.bounds.depth(&self.end));
        let mut least = ends;
        for arc in &self.corners {
            for axis in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
                if dot(axis, arc.middle) >= arc.half_cos {
                    let extreme = [0, 1].map(|i| self.centre[i] + arc.radius * axis[i]);
                    least = least.min(world.bounds.depth(&[extreme]));
                }
            }
        }
        least
    }
}

/// A disc around the sweep: about the body's middle half-way, reaching as far as a corner moves.
fn disc_around(
    about: &[[f64; 2]; 4],
    centre: [f64; 2],
    half_way: (f64, f64),
    half_turn: f64,
) -> ([f64; 2], f64) {
    let body = middle(about[0], about[2]);
    let reach = length(minus(about[0], body));
    let moved = half_turn.abs() * length(body);
    (plus(centre, rotate(body, half_way)), reach + moved)
}

/// The way of a point about the origin: a circle's part.
struct Arc {
    /// Direction of its middle.
    middle: [f64; 2],
    radius: f64,
    /// Cosine of half its angle: a direction is on the arc where its product with the middle's is
    /// no less.
    half_cos: f64,
}

impl Arc {
    /// The arc with `middle` half-way.
    fn new(middle: [f64; 2], half_cos: f64) -> Self {
        let radius = length(middle);
        let scale = if radius > 0.0 { 1.0 / radius } else { 0.0 };
        Self { middle: [middle[0] * scale, middle[1] * scale], radius, half_cos }
    }

    /// Distance where it passes in front of a point; infinite where it does not.
    fn past_point(&self, point: [f64; 2]) -> f64 {
        let distance = length(point);
        if dot(point, self.middle) >= self.half_cos * distance {
            (distance - self.radius).abs()
        } else {
            f64::INFINITY
        }
    }

    /// Distance where its radius is square to an edge, 0 where it crosses; else infinite.
    fn past_edge(&self, edge: &Edge) -> f64 {
        let normal = [edge.along[1], -edge.along[0]];
        let offset = dot(edge.start, normal);
        let foot = -dot(edge.start, edge.along);
        if offset.abs() < self.radius {
            return self.across(edge, normal, offset, foot);
        }
        let towards = if offset < 0.0 { -1.0 } else { 1.0 };
        let faces = towards * dot(normal, self.middle) >= self.half_cos;
        if faces && (0.0..=edge.length).contains(&foot) {
            offset.abs() - self.radius
        } else {
            f64::INFINITY
        }
    }

    fn across(&self, edge: &Edge, normal: [f64; 2], offset: f64, foot: f64) -> f64 {
        let chord = (self.radius * self.radius - offset * offset).sqrt();
        for side in [-chord, chord] {
            if (0.0..=edge.length).contains(&(foot + side)) {
                let hit = [0, 1].map(|i| offset * normal[i] + side * edge.along[i]);
                if dot(hit, self.middle) >= self.half_cos * self.radius {
                    return 0.0;
                }
            }
        }
        f64::INFINITY
    }
}

/// The cosine that closes an arc of twice `half_turn`; a full turn holds every direction.
fn closing(half_turn: f64, half_cos: f64) -> f64 {
    if half_turn.abs() >= core::f64::consts::PI { -1.0 } else { half_cos }
}

/// Sine and cosine of a sum of angles.
fn double(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.1 + a.1 * b.0, a.1 * b.1 - a.0 * b.0)
}

fn rotate(p: [f64; 2], (sin, cos): (f64, f64)) -> [f64; 2] {
    [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]]
}

fn plus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn middle(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn length(a: [f64; 2]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::World;
    use kerbside_geometry::{Bounds, ConvexPolygon};
    use proptest::prelude::*;

    const CAR: Footprint = Footprint { length: 0.75, width: 0.37, rear_overhang: 0.13 };

    fn world(corners: Vec<[f64; 2]>) -> World {
        World {
            bounds: Bounds { min: [-3.0, -3.0], max: [3.0, 3.0] },
            obstacles: vec![Obstacle::new(ConvexPolygon::new(corners).unwrap())],
        }
    }

    /// The least clearance at many poses, and how much a corner moves between two of them.
    fn sampled(world: &World, segment: &Segment, steps: u32) -> (f64, f64) {
        let least = (0..=steps).map(|i| {
            let pose = segment.pose_at(segment.length * f64::from(i) / f64::from(steps));
            world.clearance(&CAR.corners_at(&pose)).0
        });
        let motion = segment.length.abs() * (1.0 + segment.curvature.abs() * CAR.reach());
        (least.fold(f64::INFINITY, f64::min), motion / f64::from(steps))
    }

    fn many() -> ProptestConfig {
        ProptestConfig { cases: 1500, max_global_rejects: 15_000, ..ProptestConfig::default() }
    }

    proptest! {
        #![proptest_config(many())]

        #[test]
        fn the_closed_form_is_the_least_over_dense_samples(
            (x, y, yaw) in (-1.5..1.5, -1.5..1.5, -7.0..7.0),
            (length, curvature) in (-4.0..4.0, prop_oneof![Just(0.0), -1.4..1.4]),
            (px, py, spin) in (-1.5..1.5, -1.5..1.5, 0.0..6.0),
            (long, wide) in (0.02..1.5, 0.02..0.8),
        ) {
            let block = Footprint { length: long, width: wide, rear_overhang: 0.3 * long };
            let world = world(block.corners_at(&Pose::new(px, py, spin)).to_vec());
            let segment = Segment { start: Pose::new(x, y, yaw), length, curvature };
            prop_assume!(world.clearance(&CAR.corners_at(&segment.start)).0 > 0.0);
            let (exact, _) = Sweep::new(&CAR, &segment).clearance(&world);
            let (sample, step) = sampled(&world, &segment, 400);
            prop_assert!(exact <= sample.max(0.0) + 1e-9, "{} above {}", exact, sample);
            // Between samples a corner comes at most half a step nearer.
            prop_assert!(exact >= sample - 0.51 * step - 1e-9, "{} below {}", exact, sample);
        }

        #[test]
        fn yes_and_no_agree_with_the_distance(
            (x, y, yaw) in (-1.5..1.5, -1.5..1.5, -7.0..7.0),
            (length, curvature, needed) in (-2.0..2.0, -1.4..1.4, 0.001..0.2),
        ) {
            let world = world(vec![[0.0, 0.0], [0.6, -0.2], [0.4, 0.5]]);
            let segment = Segment { start: Pose::new(x, y, yaw), length, curvature };
            prop_assume!(world.clearance(&CAR.corners_at(&segment.start)).0 >= needed);
            let sweep = Sweep::new(&CAR, &segment);
            let clear = sweep.stays_clear(&world, needed);
            prop_assert_eq!(clear, sweep.clearance(&world).0 >= needed);
        }
    }

    #[test]
    fn a_corner_that_swings_out_between_free_ends_is_seen() {
        // The front left corner touches its highest point in the middle of the turn.
        let segment = Segment { start: Pose::new(0.0, 0.0, 1.0), length: 1.4, curvature: -1.0 };
        let turn = Sweep::new(&CAR, &segment);
        let centre_y = -math::cos(1.0);
        let top = centre_y + math::hypot(1.185, 0.62);
        let post = vec![[-2.0, top + 0.01], [2.0, top + 0.01], [0.0, top + 0.5]];
        let (found, nearest) = turn.clearance(&world(post));
        assert!((found - 0.01).abs() < 1e-12 && nearest == Nearest::Obstacle(0), "{found}");
    }
}
