//! Between the body's motion and the reference's reading.

use kerbside_geometry::{Pose, math};

use super::Effect;

/// What is put in there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    delay: f64,
    scale: f64,
    marker: [f64; 3],
    drift: f64,
    pull: Option<Pull>,
    turning: f64,
    stretch: f64,
}

#[derive(Clone, Copy, Debug)]
struct Pull {
    x: f64,
    y: f64,
    radius: f64,
    pull: f64,
}

impl Sight {
    pub(crate) fn neutral() -> Self {
        Self {
            delay: 0.0,
            scale: 1.0,
            marker: [0.0; 3],
            drift: 0.0,
            pull: None,
            turning: 0.0,
            stretch: 0.0,
        }
    }

    pub(crate) fn take(&mut self, effect: &Effect) {
        match effect.id {
            "reference_delay" => self.delay = effect.get("delay"),
            "reference_scale" => self.scale = effect.get("scale"),
            "reference_marker" => self.marker = ["x", "y", "yaw"].map(|name| effect.get(name)),
            "clock_drift" => self.drift = effect.get("rate"),
            "reference_pull" => {
                let [x, y, radius, pull] =
                    ["x", "y", "radius", "pull"].map(|name| effect.get(name));
                self.pull = Some(Pull { x, y, radius, pull });
            }
            "reference_turning" => self.turning = effect.get("rate"),
            "reference_stretch" => self.stretch = effect.get("share"),
            _ => {}
        }
    }

    /// When a row stamped `stamp` was taken, both \[s\].
    pub(crate) fn taken(&self, stamp: f64) -> f64 {
        stamp / (1.0 + self.drift) - self.delay
    }

    /// The marker's place in the body frame, where `marker` is the believed one.
    pub(crate) fn marker(&self, marker: &Pose) -> Pose {
        let [x, y, yaw] = self.marker;
        Pose::new(marker.x + x, marker.y + y, marker.yaw + yaw)
    }

    /// What is shown at `time` \[s\] of the marker's true pose.
    pub(crate) fn shown(&self, marker: &Pose, time: f64) -> Pose {
        let (mut x, mut y, mut yaw) = (marker.x, marker.y, marker.yaw);
        if let Some(pull) = &self.pull {
            let (dx, dy) = (pull.x - x, pull.y - y);
            let away = math::hypot(dx, dy);
            if away < pull.radius && away > 0.0 {
                // Nothing at its middle and at its edge, smooth in between.
                let along = away / pull.radius;
                let share = pull.pull * 3.0 * 3.0_f64.sqrt() / 2.0 * along * (1.0 - along * along);
                x += share * dx / away;
                y += share * dy / away;
            }
        }
        if self.turning != 0.0 {
            let (sin, cos) = math::sin_cos(self.turning * time);
            (x, y, yaw) = (cos * x - sin * y, sin * x + cos * y, yaw + self.turning * time);
        }
        x *= 1.0 + self.stretch;
        Pose::new(self.scale * x, self.scale * y, yaw)
    }
}
