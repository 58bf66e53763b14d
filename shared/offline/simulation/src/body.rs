//! The integral of the motion.

use kerbside_geometry::{Pose, math};

use crate::ground::Motion;
use crate::plant::Contact;

/// Where the body is and how far its wheels have turned.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// Of the rear-axle centre, yaw not wrapped.
    pub pose: Pose,
    /// Distance that the rear-axle centre covered in either direction \[m\].
    pub distance: f64,
    /// Rotation of each wheel \[rad\].
    pub rotation: [f64; 4],
    /// The same with every turn counted as positive \[rad\].
    pub turned: [f64; 4],
    heading: (f64, f64),
    /// Velocity of the floor per speed (x, y), where the body slides at all.
    slide: Option<(f64, f64)>,
}

impl Body {
    /// Standing at `pose`.
    pub(crate) fn new(pose: Pose, contact: &Contact) -> Self {
        let slides = contact.lateral_slip != 0.0
            || contact.lateral_drift != 0.0
            || contact.floor != (0.0, 0.0);
        Self {
            pose,
            distance: 0.0,
            rotation: [0.0; 4],
            turned: [0.0; 4],
            heading: math::sin_cos(pose.yaw),
            slide: slides.then_some(contact.floor),
        }
    }

    /// Moves on by `step` \[s\], given the motion at its beginning, middle and end.
    ///
    /// Simpson's rule throughout; the heading in the middle is the integral of the parabola through
    /// the three yaw rates.
    pub(crate) fn roll(&mut self, step: f64, motions: &[Motion; 3]) {
        let [begin, middle, end] = motions;
        let sixth = step / 6.0;
        let simpson = |b: f64, m: f64, e: f64| sixth * (b + 4.0 * m + e);
        for wheel in 0..4 {
            let rate = |motion: &Motion| motion.rotation_rate[wheel];
            let turn = simpson(rate(begin), rate(middle), rate(end));
            self.rotation[wheel] += turn;
            self.turned[wheel] += turn.abs();
        }
        self.distance += simpson(begin.speed, middle.speed, end.speed).abs();
        let half_turn = step / 24.0 * (5.0 * begin.yaw_rate + 8.0 * middle.yaw_rate - end.yaw_rate);
        let yaw = self.pose.yaw + simpson(begin.yaw_rate, middle.yaw_rate, end.yaw_rate);
        let headings = [self.heading, math::sin_cos(self.pose.yaw + half_turn), math::sin_cos(yaw)];
        let [sin, cos] = [headings.map(|(sin, _)| sin), headings.map(|(_, cos)| cos)];
        let along =
            |h: [f64; 3]| simpson(begin.speed * h[0], middle.speed * h[1], end.speed * h[2]);
        let mut pose = Pose::new(self.pose.x + along(cos), self.pose.y + along(sin), yaw);
        if let Some(floor) = self.slide {
            let across =
                |h: [f64; 3]| simpson(begin.side * h[0], middle.side * h[1], end.side * h[2]);
            let path = simpson(begin.speed.abs(), middle.speed.abs(), end.speed.abs());
            pose.x += floor.0 * path - across(sin);
            pose.y += floor.1 * path + across(cos);
        }
        self.pose = pose;
        self.heading = headings[2];
    }

    /// Velocity of the rear-axle centre in the frame of the pose (x, y) \[m/s\], while it moves as
    /// `motion`.
    pub(crate) fn velocity(&self, motion: &Motion) -> (f64, f64) {
        let (sin, cos) = self.heading;
        let (x, y) = (motion.speed * cos, motion.speed * sin);
        self.slide.map_or((x, y), |floor| {
            let speed = motion.speed.abs();
            (x - motion.side * sin + floor.0 * speed, y + motion.side * cos + floor.1 * speed)
        })
    }
}
