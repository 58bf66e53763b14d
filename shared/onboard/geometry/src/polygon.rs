//! Convex polygons, the distance between them, and the rectangle a vehicle has to stay in.

use crate::math;

/// Corners closer than this share of the polygon's extent are one corner; areas and dents below
/// it are rounding.
const RELATIVE: f64 = 1e-12;

/// Why a list of corners is no convex polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PolygonError {
    /// Two corners make a line, one a point.
    TooFewCorners {
        /// How many there are.
        found: usize,
    },
    /// A coordinate that is no number.
    NotFinite {
        /// Index of the corner.
        corner: usize,
    },
    /// A corner that was there before.
    Repeated {
        /// Index of the later one.
        corner: usize,
    },
    /// All corners on one line.
    Flat,
    /// Clockwise order.
    Clockwise,
    /// A dent, or edges that cross.
    NotConvex {
        /// Index of a corner that lies outside of an edge.
        corner: usize,
    },
}

impl core::fmt::Display for PolygonError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooFewCorners { found } => write!(f, "{found} corners, at least 3 are needed"),
            Self::NotFinite { corner } => write!(f, "corner {corner} is not finite"),
            Self::Repeated { corner } => write!(f, "corner {corner} repeats an earlier one"),
            Self::Flat => f.write_str("all corners are on one line"),
            Self::Clockwise => f.write_str("corners are in clockwise order"),
            Self::NotConvex { corner } => write!(f, "not convex at corner {corner}"),
        }
    }
}

impl core::error::Error for PolygonError {}

/// A convex polygon with an area; its corners run counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexPolygon {
    corners: Vec<[f64; 2]>,
}

impl ConvexPolygon {
    /// The polygon of these corners \[m\], counter-clockwise; corners on a straight edge are fine.
    ///
    /// # Errors
    /// What keeps them from being a convex polygon.
    pub fn new(corners: Vec<[f64; 2]>) -> Result<Self, PolygonError> {
        if corners.len() < 3 {
            return Err(PolygonError::TooFewCorners { found: corners.len() });
        }
        if let Some(corner) = corners.iter().position(|p| !(p[0].is_finite() && p[1].is_finite())) {
            return Err(PolygonError::NotFinite { corner });
        }
        let extent = extent(&corners);
        check_repeats(&corners, RELATIVE * extent)?;
        check_area(&corners, RELATIVE * extent * extent)?;
        check_convexity(&corners, RELATIVE * extent)?;
        Ok(Self { corners })
    }

    /// Corners known to be convex, counter-clockwise and apart.
    pub(crate) fn trusted(corners: &[[f64; 2]]) -> Self {
        Self { corners: corners.to_vec() }
    }

    /// Its corners, counter-clockwise \[m\].
    #[must_use]
    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners
    }

    /// Whether the point is inside or on the edge.
    #[must_use]
    pub fn contains(&self, point: [f64; 2]) -> bool {
        edges(&self.corners).all(|(a, b)| cross(minus(b, a), minus(point, a)) >= 0.0)
    }

    /// Least distance to another polygon \[m\]; 0 where they touch or overlap.
    #[must_use]
    pub fn distance(&self, other: &Self) -> f64 {
        convex_distance(&self.corners, &other.corners)
    }
}

fn extent(corners: &[[f64; 2]]) -> f64 {
    let first = corners[0];
    corners.iter().fold(0.0, |far: f64, p| far.max(length(minus(*p, first))))
}

fn check_repeats(corners: &[[f64; 2]], tolerance: f64) -> Result<(), PolygonError> {
    for (corner, point) in corners.iter().enumerate() {
        if corners[..corner].iter().any(|other| length(minus(*point, *other)) <= tolerance) {
            return Err(PolygonError::Repeated { corner });
        }
    }
    Ok(())
}

/// By the shoelace formula, twice the area.
fn check_area(corners: &[[f64; 2]], tolerance: f64) -> Result<(), PolygonError> {
    let first = corners[0];
    let area: f64 = edges(corners).map(|(a, b)| cross(minus(a, first), minus(b, first))).sum();
    if area.abs() <= tolerance {
        Err(PolygonError::Flat)
    } else if area < 0.0 {
        Err(PolygonError::Clockwise)
    } else {
        Ok(())
    }
}

/// Every corner on the inner side of every edge; a star, whose corners all turn left, fails too.
fn check_convexity(corners: &[[f64; 2]], tolerance: f64) -> Result<(), PolygonError> {
    for (a, b) in edges(corners) {
        let edge = minus(b, a);
        let floor = -tolerance * length(edge);
        if let Some(corner) = corners.iter().position(|p| cross(edge, minus(*p, a)) < floor) {
            return Err(PolygonError::NotConvex { corner });
        }
    }
    Ok(())
}

/// Least distance between two convex polygons \[m\] given by their corners in counter-clockwise
/// order, which is not checked; 0 where they touch or overlap.
///
/// Disjoint convex polygons are separated along one of their edges, and a corner of one is among
/// the nearest pair of points (Ericson, Real-Time Collision Detection, sections 5.2.1 and 5.1.9).
#[must_use]
pub fn convex_distance(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    if !separated(a, b) && !separated(b, a) {
        return 0.0;
    }
    corners_to_edges(a, b).min(corners_to_edges(b, a)).sqrt()
}

/// Whether one of `a`'s edges has all of `b` on its outer side.
fn separated(a: &[[f64; 2]], b: &[[f64; 2]]) -> bool {
    edges(a).any(|(start, end)| {
        let edge = minus(end, start);
        b.iter().all(|p| cross(edge, minus(*p, start)) < 0.0)
    })
}

/// Least squared distance of the corners from the other outline's edges \[m^2\].
fn corners_to_edges(corners: &[[f64; 2]], other: &[[f64; 2]]) -> f64 {
    let mut least = f64::INFINITY;
    for (start, end) in edges(other) {
        let along = minus(end, start);
        let per_square = 1.0 / dot(along, along);
        for corner in corners {
            let offset = minus(*corner, start);
            let share = (dot(offset, along) * per_square).clamp(0.0, 1.0);
            let rest = [offset[0] - share * along[0], offset[1] - share * along[1]];
            least = least.min(dot(rest, rest));
        }
    }
    least
}

/// A rectangle along the axes, to be inside of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least x, y \[m\].
    pub min: [f64; 2],
    /// Greatest x, y \[m\].
    pub max: [f64; 2],
}

impl Bounds {
    /// Least distance of the points from the rectangle's sides, from inside \[m\]; negative for
    /// points outside, by how far the worst of them is beyond a side.
    #[must_use]
    pub fn depth(&self, points: &[[f64; 2]]) -> f64 {
        points.iter().fold(f64::INFINITY, |least, p| {
            let x = (p[0] - self.min[0]).min(self.max[0] - p[0]);
            let y = (p[1] - self.min[1]).min(self.max[1] - p[1]);
            least.min(x).min(y)
        })
    }
}

/// The edges of a closed line of corners.
fn edges(corners: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    let last = corners.len().wrapping_sub(1);
    (0..corners.len()).map(move |i| (corners[i], corners[if i == last { 0 } else { i + 1 }]))
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn length(a: [f64; 2]) -> f64 {
    math::hypot(a[0], a[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pose;

    fn rectangle(width: f64, height: f64, pose: Pose) -> ConvexPolygon {
        let (w, h) = (0.5 * width, 0.5 * height);
        let corners = [(-w, -h), (w, -h), (w, h), (-w, h)];
        let place = |(x, y)| {
            let (x, y) = pose.transform(x, y);
            [x, y]
        };
        ConvexPolygon::new(corners.map(place).to_vec()).unwrap()
    }

    /// Least distance over many pairs of points on the two outlines.
    fn sampled(a: &ConvexPolygon, b: &ConvexPolygon, steps: u32) -> f64 {
        let outline = |polygon: &ConvexPolygon| -> Vec<[f64; 2]> {
            edges(polygon.corners())
                .flat_map(|(p, q)| {
                    (0..steps).map(move |i| {
                        let share = f64::from(i) / f64::from(steps);
                        [p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]
                    })
                })
                .collect()
        };
        let (first, second) = (outline(a), outline(b));
        let pairs = first.iter().flat_map(|p| second.iter().map(move |q| length(minus(*p, *q))));
        pairs.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn distances_of_known_pairs() {
        let unit = rectangle(1.0, 1.0, Pose::default());
        for (pose, expected) in [
            (Pose::new(3.0, 0.2, 0.0), 2.0),
            (Pose::new(4.0, 5.0, 0.0), 5.0),
            (Pose::new(0.5 + 0.5 * 2.0_f64.sqrt() + 0.25, 0.0, 0.25 * core::f64::consts::PI), 0.25),
            (Pose::new(1.0, 0.0, 0.0), 0.0),
            (Pose::new(0.1, 0.1, 0.3), 0.0),
            (Pose::new(0.0, 0.9, 0.0), 0.0),
        ] {
            let other = rectangle(1.0, 1.0, pose);
            assert!((unit.distance(&other) - expected).abs() < 1e-12, "{pose:?}");
        }
    }

    #[test]
    fn distance_is_the_least_over_sampled_outlines() {
        let fixed = ConvexPolygon::new(vec![[0.0, 0.0], [2.0, -0.5], [2.5, 1.0], [0.5, 2.0]]);
        let fixed = fixed.unwrap();
        let mut apart = 0;
        for step in 0..120_i32 {
            let k = f64::from(step);
            let pose = Pose::new(3.0 * math::sin(k), 3.0 * math::cos(1.7 * k), 0.37 * k);
            let other = rectangle(1.2, 0.4, pose);
            let (exact, sample) = (fixed.distance(&other), sampled(&fixed, &other, 60));
            assert_eq!(exact, other.distance(&fixed), "not symmetric at {pose:?}");
            if exact > 0.0 {
                apart += 1;
                assert!(exact <= sample + 1e-12 && sample < exact + 0.06, "{exact} {sample}");
            } else {
                let crosses = sample < 0.06;
                let within = other.corners().iter().all(|p| fixed.contains(*p));
                assert!(crosses || within, "{pose:?}");
            }
        }
        assert!((20..120).contains(&apart));
    }

    #[test]
    fn what_is_no_convex_polygon_is_refused_by_its_cause() {
        let refused = |corners: &[[f64; 2]]| ConvexPolygon::new(corners.to_vec()).unwrap_err();
        let (o, x, y, xy) = ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]);
        assert_eq!(refused(&[o, x]), PolygonError::TooFewCorners { found: 2 });
        assert_eq!(refused(&[o, x, [f64::NAN, 1.0]]), PolygonError::NotFinite { corner: 2 });
        assert_eq!(refused(&[o, x, xy, x]), PolygonError::Repeated { corner: 3 });
        assert_eq!(refused(&[o, x, [2.0, 0.0]]), PolygonError::Flat);
        assert_eq!(refused(&[o, y, xy, x]), PolygonError::Clockwise);
        let dented = [o, [2.0, 0.0], [1.0, 0.5], [2.0, 2.0], [0.0, 2.0]];
        assert!(matches!(refused(&dented), PolygonError::NotConvex { .. }));
        let star: Vec<[f64; 2]> = (0..5)
            .map(|i| math::sin_cos(f64::from(i) * 0.8 * core::f64::consts::PI))
            .map(|(sin, cos)| [cos, sin])
            .collect();
        assert!(matches!(refused(&star), PolygonError::NotConvex { .. }));
        assert!(ConvexPolygon::new(vec![o, [0.5, 0.0], x, xy, y]).is_ok());
    }

    #[test]
    fn depth_is_negative_outside() {
        let bounds = Bounds { min: [0.0, 0.0], max: [4.0, 2.0] };
        assert_eq!(bounds.depth(&[[1.0, 1.0], [3.5, 1.0]]), 0.5);
        assert_eq!(bounds.depth(&[[1.0, 1.0], [4.25, 1.0]]), -0.25);
        assert_eq!(bounds.depth(&[[1.0, -3.0]]), -3.0);
    }
}
