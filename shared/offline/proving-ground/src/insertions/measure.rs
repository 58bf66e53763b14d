//! What an insertion that is no listed parameter amounts to in one: measured on the vehicle itself.

use kerbside_geometry::math;

use super::{Effect, Insertions};
use crate::car;
use crate::cases::Specification;
use crate::contact::{Contacts, Drivetrain, Motion};

/// Steady circles on which is measured: shares of the largest speed and angle.
const SPEEDS: [f64; 3] = [0.5, 0.7, 0.9];
const ANGLES: [f64; 4] = [-0.7, -0.3, 0.3, 0.7];

/// A parameter as measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Mean over speeds and angles, each circle counting by how much the effect bends it.
    pub value: f64,
    /// Half the range of the single results.
    pub spread: f64,
}

/// What the effects of `case` amount to in a parameter of the listed effect `id`; none where what is put in is that
/// parameter itself.
#[must_use]
pub fn measured(case: &Specification, id: &str, parameter: &str) -> Option<Measured> {
    match (id, parameter) {
        ("understeer", "gradient") => on_circles(case, "understeer", |circle| {
            let Circle { plain, bent, speed, .. } = circle;
            (plain / bent - 1.0) / (speed * speed)
        }),
        ("steering_compliance", "rate") => on_circles(case, "steering_compliance", |circle| {
            let Circle { plain, bent, speed, wheelbase } = circle;
            let [before, after] = [plain, bent].map(|curvature| math::atan(wheelbase * curvature));
            (before - after) / (speed * speed * plain)
        }),
        _ => None,
    }
}

/// A steady circle without and with the effect: curvatures \[1/m\], speed of the rear axle \[m/s\], wheelbase \[m\].
struct Circle {
    plain: f64,
    bent: f64,
    speed: f64,
    wheelbase: f64,
}

fn on_circles(
    case: &Specification,
    id: &str,
    parameter: impl Fn(Circle) -> f64,
) -> Option<Measured> {
    let effect = case.effects.iter().find(|effect| effect.id == id)?;
    let limits = &case.vehicle.limits;
    let (mut sum, mut weights, mut low, mut high) = (0.0, 0.0, f64::INFINITY, f64::NEG_INFINITY);
    for speed in SPEEDS.map(|share| share * limits.speed) {
        for angle in ANGLES.map(|share| share * limits.steering) {
            let [plain, bent] = [&[][..], core::slice::from_ref(effect)]
                .map(|effects| steady(case, effects, speed, angle));
            let [plain, curve] = [&plain, &bent].map(|motion| motion.yaw_rate / motion.forward);
            let (speed, wheelbase) = (bent.forward, case.truth.wheelbase);
            let value = parameter(Circle { plain, bent: curve, speed, wheelbase });
            let weight = speed * speed * plain * plain;
            (sum, weights) = (sum + weight * value, weights + weight);
            (low, high) = (low.min(value), high.max(value));
        }
    }
    Some(Measured { value: sum / weights, spread: 0.5 * (high - low) })
}

/// Motion of a motor that holds `speed` \[m/s\] and a rack that holds `angle` \[rad\].
pub(crate) fn steady(case: &Specification, effects: &[Effect], speed: f64, angle: f64) -> Motion {
    let insertions = Insertions::new(case, effects);
    let plain = car::chassis(case);
    let chassis = insertions.ground.chassis(&plain);
    let mut contacts = Contacts::new(&chassis, &car::physics(case));
    let motor = 1.0 / case.vehicle.driven_radius();
    contacts.set_rolling(chassis.radius, motor);
    let surface = speed * motor * chassis.driven_radius();
    let steering = insertions.ground.under_force(&chassis, angle, surface);
    contacts.motion(&Drivetrain { speed, acceleration: 0.0, steering, steering_rate: 0.0 })
}
