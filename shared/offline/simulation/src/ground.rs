//! From motor and rack to the motion of body and wheels.

use kerbside_geometry::{Drive, Vehicle, WHEELS, Wheel, math};

/// The motion at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Motion {
    /// Speed of the rear-axle centre along the body's x axis \[m/s\].
    pub speed: f64,
    /// Rate of the heading \[rad/s\].
    pub yaw_rate: f64,
    /// Rotation rates of the wheels \[rad/s\].
    pub rotation_rate: [f64; 4],
}

impl Motion {
    /// Whether nothing moves.
    pub(crate) fn is_rest(&self) -> bool {
        self.speed == 0.0
    }
}

/// Rolling without slip, driven through a differential.
#[derive(Clone, Debug)]
pub(crate) struct Ground {
    wheelbase: f64,
    position: [(f64, f64); 4],
    per_radius: [f64; 4],
    /// Share of each wheel in the mean rotation rate of the driven ones.
    driven: [f64; 4],
    driven_radius: f64,
}

impl Ground {
    /// The ground under `vehicle`.
    pub(crate) fn new(vehicle: &Vehicle) -> Self {
        Self {
            wheelbase: vehicle.wheelbase,
            position: WHEELS.map(|wheel| vehicle.wheel_position(wheel)),
            per_radius: vehicle.radius.map(|radius| 1.0 / radius),
            driven: WHEELS.map(|wheel| share(vehicle.drive, wheel)),
            driven_radius: vehicle.driven_radius(),
        }
    }

    /// The motion while the motor turns at `drive_speed` \[m/s\] (through the driven wheels' mean
    /// nominal radius) and the road wheels stand at `angle` \[rad\].
    ///
    /// Every wheel moves about the turning centre on the rear axle's line, (0, 1/k) with k =
    /// tan(angle) / wheelbase: wheel i at (x, y) rolls hypot(1 - y k, x k) times as far as the
    /// rear-axle centre.
    pub(crate) fn motion(&self, drive_speed: f64, angle: f64) -> Motion {
        let curvature = math::tan(angle) / self.wheelbase;
        let rotation_per_metre: [f64; 4] = core::array::from_fn(|wheel| {
            let (x, y) = self.position[wheel];
            let (across, along) = (x * curvature, 1.0 - y * curvature);
            (along * along + across * across).sqrt() * self.per_radius[wheel]
        });
        let driven_per_metre: f64 = self
            .driven
            .iter()
            .zip(rotation_per_metre)
            .map(|(share, rotation)| share * rotation)
            .sum();
        let speed = drive_speed / (self.driven_radius * driven_per_metre);
        Motion {
            speed,
            yaw_rate: curvature * speed,
            rotation_rate: rotation_per_metre.map(|rotation| rotation * speed),
        }
    }
}

fn share(drive: Drive, wheel: Wheel) -> f64 {
    match drive {
        Drive::All => 0.25,
        Drive::Front if wheel.is_front() => 0.5,
        Drive::Rear if !wheel.is_front() => 0.5,
        Drive::Front | Drive::Rear => 0.0,
    }
}
