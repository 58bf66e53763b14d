//! Where the body of a vehicle is when its rear axle is at a pose.

use crate::{ConvexPolygon, Footprint, Pose, math};

impl Footprint {
    /// Its corners in the body frame \[m\]: counter-clockwise from the rear right one.
    #[must_use]
    pub fn corners(&self) -> [[f64; 2]; 4] {
        let (rear, front) = (-self.rear_overhang, self.length - self.rear_overhang);
        let half = 0.5 * self.width;
        [[rear, -half], [front, -half], [front, half], [rear, half]]
    }

    /// Its corners with the rear-axle centre at `pose`, in the frame of `pose` \[m\], in the same
    /// order.
    #[must_use]
    pub fn corners_at(&self, pose: &Pose) -> [[f64; 2]; 4] {
        let (sin, cos) = math::sin_cos(pose.yaw);
        self.corners().map(|[x, y]| [pose.x + cos * x - sin * y, pose.y + sin * x + cos * y])
    }

    /// The rectangle it covers with the rear-axle centre at `pose`; length and width above zero.
    #[must_use]
    pub fn polygon_at(&self, pose: &Pose) -> ConvexPolygon {
        ConvexPolygon::trusted(&self.corners_at(pose))
    }

    /// Distance from the rear-axle centre to the farthest corner \[m\].
    #[must_use]
    pub fn reach(&self) -> f64 {
        let farthest = self.rear_overhang.abs().max((self.length - self.rear_overhang).abs());
        math::hypot(farthest, 0.5 * self.width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;

    const CAR: Footprint = Footprint { length: 0.75, width: 0.37, rear_overhang: 0.13 };

    #[test]
    fn a_car_facing_up_covers_what_it_should() {
        let corners = CAR.corners_at(&Pose::new(1.0, 2.0, FRAC_PI_2));
        let expected = [[1.185, 1.87], [1.185, 2.62], [0.815, 2.62], [0.815, 1.87]];
        for (corner, expected) in corners.iter().zip(expected) {
            assert!((corner[0] - expected[0]).abs() < 1e-12, "{corner:?}");
            assert!((corner[1] - expected[1]).abs() < 1e-12, "{corner:?}");
        }
    }

    #[test]
    fn the_rectangle_is_a_valid_polygon_at_any_heading() {
        for step in 0..60 {
            let pose = Pose::new(-3.0, 0.5, f64::from(step) * 0.31);
            let polygon = CAR.polygon_at(&pose);
            assert_eq!(ConvexPolygon::new(polygon.corners().to_vec()), Ok(polygon.clone()));
            assert!(polygon.contains([pose.x, pose.y]));
            let from_axle = polygon.corners().iter().map(|p| math::hypot(p[0] + 3.0, p[1] - 0.5));
            assert!((from_axle.fold(0.0, f64::max) - CAR.reach()).abs() < 1e-12);
        }
    }
}
