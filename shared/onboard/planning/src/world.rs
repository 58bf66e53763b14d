//! The space a footprint has to stay clear in.

use kerbside_geometry::{Bounds, ConvexPolygon, convex_distance};

/// What a footprint is nearest to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nearest {
    /// A side of the bounds.
    Bounds,
    /// The obstacle of that index in the request.
    Obstacle(usize),
}

impl core::fmt::Display for Nearest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Bounds => f.write_str("the bounds"),
            Self::Obstacle(index) => write!(f, "obstacle {index}"),
        }
    }
}

/// An edge with what the sweeps need of it over and over.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub(crate) start: [f64; 2],
    pub(crate) along: [f64; 2],
    pub(crate) length: f64,
}

impl Edge {
    pub(crate) fn between(start: [f64; 2], end: [f64; 2]) -> Self {
        let (x, y) = (end[0] - start[0], end[1] - start[1]);
        let length = (x * x + y * y).sqrt();
        Self { start, along: [x / length, y / length], length }
    }
}

/// A convex obstacle.
#[derive(Clone, Debug)]
pub(crate) struct Obstacle {
    pub(crate) polygon: ConvexPolygon,
    pub(crate) edges: Vec<Edge>,
    hull: Bounds,
}

impl Obstacle {
    pub(crate) fn new(polygon: ConvexPolygon) -> Self {
        let corners = polygon.corners();
        let nexts = corners.iter().cycle().skip(1);
        let edges = corners.iter().zip(nexts).map(|(a, b)| Edge::between(*a, *b)).collect();
        let hull = corners.iter().fold(Bounds { min: corners[0], max: corners[0] }, |hull, p| {
            let min = [hull.min[0].min(p[0]), hull.min[1].min(p[1])];
            let max = [hull.max[0].max(p[0]), hull.max[1].max(p[1])];
            Bounds { min, max }
        });
        Self { polygon, edges, hull }
    }

    /// A lower bound, quickly had, of the distance from the disc \[m\].
    pub(crate) fn at_least(&self, centre: [f64; 2], radius: f64) -> f64 {
        let x = (self.hull.min[0] - centre[0]).max(centre[0] - self.hull.max[0]).max(0.0);
        let y = (self.hull.min[1] - centre[1]).max(centre[1] - self.hull.max[1]).max(0.0);
        (x * x + y * y).sqrt() - radius
    }
}

/// Bounds to stay inside of and obstacles to stay outside of.
#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) bounds: Bounds,
    pub(crate) obstacles: Vec<Obstacle>,
}

impl World {
    /// Least distance of a convex outline from everything solid \[m\], and from what; negative
    /// beyond the bounds, 0 inside an obstacle.
    pub(crate) fn clearance(&self, outline: &[[f64; 2]]) -> (f64, Nearest) {
        let mut least = (self.bounds.depth(outline), Nearest::Bounds);
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            let distance = convex_distance(outline, obstacle.polygon.corners());
            if distance < least.0 {
                least = (distance, Nearest::Obstacle(index));
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quick_bound_is_a_bound() {
        let corners = vec![[0.0, 0.0], [2.0, 0.0], [1.0, 1.5]];
        let obstacle = Obstacle::new(ConvexPolygon::new(corners).unwrap());
        for step in 0..40 {
            let (x, y) = (-3.0 + 0.2 * f64::from(step), 2.0 - 0.1 * f64::from(step));
            let disc = [[x - 0.1, y - 0.1], [x + 0.1, y - 0.1], [x + 0.1, y + 0.1]];
            let exact = convex_distance(&disc, obstacle.polygon.corners());
            assert!(obstacle.at_least([x, y], 0.15) <= exact);
        }
        assert!((obstacle.at_least([5.0, 0.5], 1.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_nearest_is_named() {
        let left = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let world = World {
            bounds: Bounds { min: [-1.0, -1.0], max: [9.0, 2.0] },
            obstacles: vec![Obstacle::new(ConvexPolygon::new(left).unwrap())],
        };
        let box_at = |x: f64, y: f64| [[x, y], [x + 1.0, y], [x + 1.0, y + 0.5], [x, y + 0.5]];
        assert_eq!(world.clearance(&box_at(1.25, 0.2)), (0.25, Nearest::Obstacle(0)));
        assert_eq!(world.clearance(&box_at(0.5, 0.2)), (0.0, Nearest::Obstacle(0)));
        assert_eq!(world.clearance(&box_at(5.0, 1.25)), (0.25, Nearest::Bounds));
        assert_eq!(world.clearance(&box_at(5.0, 1.75)), (-0.25, Nearest::Bounds));
    }
}
