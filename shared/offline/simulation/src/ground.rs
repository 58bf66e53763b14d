//! From motor and rack to the motion of body and wheels.

use kerbside_geometry::{Drive, WHEELS, Wheel, math};

use crate::plant::Contact;

/// Relative error of the driven wheels' rotation at which a ground speed counts as found.
const FOUND: f64 = 1e-13;
/// Newton needs three or four; more are for parameters that no vehicle has.
const CORRECTIONS: usize = 30;

/// The motion at an instant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Motion {
    /// Speed of the rear-axle centre along the body's x axis \[m/s\].
    pub speed: f64,
    /// The same along its y axis \[m/s\].
    pub side: f64,
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

/// Rolling about the centre that the steering sets, driven through a differential; the driven
/// wheels may slip, the steering may yield, the body may slide.
#[derive(Clone, Debug)]
pub(crate) struct Ground {
    wheelbase: f64,
    position: [(f64, f64); 4],
    per_radius: [f64; 4],
    /// Share of each wheel in the mean rotation rate of the driven ones.
    driven: [f64; 4],
    driven_radius: f64,
    /// Mean rotation of the driven wheels per metre straight ahead \[rad/m\].
    straight: f64,
    offset: f64,
    compliance: f64,
    understeer: f64,
    lateral_slip: f64,
    lateral_drift: f64,
}

/// Where the wheels roll at a curvature.
struct Rolling {
    /// Of each wheel, per metre of the rear-axle centre \[rad/m\].
    rotation: [f64; 4],
    /// Mean over the driven wheels \[rad/m\].
    driven: f64,
}

impl Ground {
    /// The ground under a vehicle.
    pub(crate) fn new(contact: &Contact) -> Self {
        let per_radius = contact.radius.map(|radius| 1.0 / radius);
        let driven = WHEELS.map(|wheel| share(contact.drive, wheel));
        Self {
            wheelbase: contact.wheelbase,
            straight: (0..4).map(|wheel| driven[wheel] * per_radius[wheel]).sum(),
            position: WHEELS.map(|wheel| position(contact, wheel)),
            per_radius,
            driven,
            driven_radius: contact.driven_radius,
            offset: contact.offset,
            compliance: contact.compliance,
            understeer: contact.understeer,
            lateral_slip: contact.lateral_slip,
            lateral_drift: contact.lateral_drift,
        }
    }

    /// The motion while the motor turns at `drive_speed` \[m/s\] (through the driven wheels' mean
    /// nominal radius), the rack stands at `rack` \[rad\], and the driven wheels keep `kept` of the
    /// way that they turn.
    ///
    /// Every wheel moves about the turning centre on the rear axle's line, (0, 1/k) with the
    /// curvature k: wheel i at (x, y) rolls hypot(1 - y k, x k) times as far as the rear-axle
    /// centre.
    pub(crate) fn motion(&self, drive_speed: f64, rack: f64, kept: f64) -> Motion {
        // Adding zero would turn a negative zero round.
        let angle = if self.offset == 0.0 { rack } else { rack + self.offset };
        let motor = drive_speed * kept;
        let stiff = math::tan(angle) / self.wheelbase;
        let (speed, curvature, rolling) = if self.compliance == 0.0 && self.understeer == 0.0 {
            let rolling = self.rolling(stiff);
            (motor / (self.driven_radius * rolling.driven), stiff, rolling)
        } else {
            self.yielding(motor, angle, stiff)
        };
        let yaw_rate = curvature * speed;
        let per_kept = 1.0 / kept;
        Motion {
            speed,
            side: self.lateral_drift * speed.abs() - self.lateral_slip * (speed * yaw_rate),
            yaw_rate,
            rotation_rate: core::array::from_fn(|wheel| {
                let rate = rolling.rotation[wheel] * speed;
                if self.driven[wheel] == 0.0 { rate } else { rate * per_kept }
            }),
        }
    }

    fn rolling(&self, curvature: f64) -> Rolling {
        let rotation: [f64; 4] = core::array::from_fn(|wheel| {
            let (x, y) = self.position[wheel];
            let (across, along) = (x * curvature, 1.0 - y * curvature);
            (along * along + across * across).sqrt() * self.per_radius[wheel]
        });
        Rolling { driven: self.mean(rotation), rotation }
    }

    fn mean(&self, of_wheels: [f64; 4]) -> f64 {
        self.driven.iter().zip(of_wheels).map(|(share, value)| share * value).sum()
    }

    /// Ground speed, curvature and rolling where the curvature depends on the speed: Newton's
    /// method on V r D(k(V)) = motor, r the driven radius and D the driven wheels' mean rotation
    /// per metre.
    fn yielding(&self, motor: f64, angle: f64, stiff: f64) -> (f64, f64, Rolling) {
        let turns = motor / self.driven_radius;
        let mut speed = turns / self.straight;
        let (mut curvature, mut slope) = self.curvature(speed, angle, stiff);
        let mut rolling = self.rolling(curvature);
        for _ in 0..CORRECTIONS {
            let excess = speed * rolling.driven - turns;
            if excess.abs() <= FOUND * turns.abs() {
                break;
            }
            speed -=
                excess / (rolling.driven + speed * self.driven_slope(curvature, &rolling) * slope);
            (curvature, slope) = self.curvature(speed, angle, stiff);
            rolling = self.rolling(curvature);
        }
        (speed, curvature, rolling)
    }

    /// Curvature \[1/m\] at a ground speed, and its derivative by that.
    fn curvature(&self, speed: f64, angle: f64, stiff: f64) -> (f64, f64) {
        let square = speed * speed;
        let stiffness = 1.0 / (1.0 + self.understeer * square);
        let (tan, tan_slope) = if self.compliance == 0.0 {
            (stiff * self.wheelbase, 0.0)
        } else {
            let tan = math::tan(angle - self.compliance * square * stiff);
            (tan, -2.0 * self.compliance * speed * stiff * (1.0 + tan * tan))
        };
        let curvature = tan / self.wheelbase * stiffness;
        let slope = tan_slope / self.wheelbase * stiffness
            - curvature * stiffness * 2.0 * self.understeer * speed;
        (curvature, slope)
    }

    /// Derivative of the driven wheels' mean rotation per metre by the curvature.
    fn driven_slope(&self, curvature: f64, rolling: &Rolling) -> f64 {
        self.mean(core::array::from_fn(|wheel| {
            let (x, y) = self.position[wheel];
            let per_radius = self.per_radius[wheel];
            let along = 1.0 - y * curvature;
            (x * x * curvature - y * along) * per_radius * per_radius / rolling.rotation[wheel]
        }))
    }
}

fn position(contact: &Contact, wheel: Wheel) -> (f64, f64) {
    let (x, track) = if wheel.is_front() {
        (contact.wheelbase, contact.track_front)
    } else {
        (0.0, contact.track_rear)
    };
    (x, if wheel.is_left() { 0.5 * track } else { -0.5 * track })
}

fn share(drive: Drive, wheel: Wheel) -> f64 {
    match drive {
        Drive::All => 0.25,
        Drive::Front if wheel.is_front() => 0.5,
        Drive::Rear if !wheel.is_front() => 0.5,
        Drive::Front | Drive::Rear => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Effects, Parameter};
    use crate::plant::Plant;
    use kerbside_geometry::Vehicle;

    #[test]
    fn speed_and_curvature_solve_each_others_equation() {
        for drive in [Drive::Rear, Drive::Front, Drive::All] {
            let vehicle =
                Vehicle { drive, radius: [0.0725, 0.0715, 0.0735, 0.0718], ..Vehicle::paper_car() };
            let parameter = |id, name| Parameter::find(id, name).unwrap();
            let effects = Effects::NEUTRAL
                .with(parameter("understeer", "gradient"), 3.0)
                .with(parameter("steering_compliance", "rate"), 0.5)
                .with(parameter("steering_offset", "offset"), 0.02);
            let ground = Ground::new(&Plant::new(&vehicle, &effects).contact);
            for (drive_speed, rack) in
                [(0.5, 0.5), (-0.5, 0.5), (0.01, -0.5), (0.3, -0.02), (0.4, 0.0)]
            {
                let motion = ground.motion(drive_speed, rack, 0.9);
                let speed = motion.speed;
                let stiff = math::tan(rack + 0.02) / vehicle.wheelbase;
                let angle = rack + 0.02 - 0.5 * speed * speed * stiff;
                let curvature =
                    math::tan(angle) / (vehicle.wheelbase * (1.0 + 3.0 * speed * speed));
                assert!((motion.yaw_rate - curvature * speed).abs() < 1e-12);
                let mean: f64 = ground.mean(motion.rotation_rate) * vehicle.driven_radius();
                assert!((mean - drive_speed).abs() < 1e-12, "{drive:?} {mean} {drive_speed}");
            }
        }
    }
}
