//! The nominal simulator in the place of the proving ground's vehicle: what an answer is worth on the very model that
//! it was fitted with.
//!
//! The vehicle is the described one; true measures, habits and what is put in are effects of the simulator. Disturbances
//! act on its motion as they do on the other plant: slip of the driven wheels, angle of the front wheels, side velocity.
//! Tyres, linkage and body have no physics of their own here.

use kerbside_geometry::{Drive as Driven, Pose, Vehicle, WHEELS, Wheel, math};
use kerbside_proving_ground::cases::{Drives, Signals, Specification, Task};
use kerbside_proving_ground::insertions::Effect;
use kerbside_simulation::{Command, Drive, Effects, Knot, Parameter, STEP, Trajectory};

/// Beyond the last stamp \[s\]: a reference's clock may be faster.
const BEYOND: f64 = 0.5;

/// The simulator as one that drives cases. It knows the listed effects; others change nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Simulated;

impl Drives for Simulated {
    fn drive(&self, task: &Task<'_>) -> Signals {
        let (case, plan) = (task.case, task.plan);
        let commands = plan.commands.iter();
        let commands: Vec<Command> = commands
            .map(|asked| Command { t: asked.time, speed: asked.speed, steering: asked.steering })
            .collect();
        let (vehicle, start) = (&case.vehicle, plan.start);
        let effects = truth(case, task.effects);
        let mut shown = Trajectory::new();
        Drive { vehicle, effects, commands: &commands, start, step: STEP }
            .trajectory(plan.duration + BEYOND, &mut shown);
        let mut disturbed = Disturbed::new(vehicle);
        shown.alter(|knot| disturbed.alter(knot, task.disturbance.at(knot.time)));
        let stamps = &plan.stamps;
        let wheels = |t: &f64| match vehicle.encoders {
            Some(_) => shown.rotation(*t),
            None => shown.wheel_speed(*t),
        };
        let late = case.build.gyro_latency;
        Signals {
            wheels: stamps.encoders.iter().map(wheels).collect(),
            steering: stamps.steering.iter().map(|t| shown.steering(*t)).collect(),
            yaw_rate: stamps.gyro.iter().map(|t| shown.yaw_rate(*t - late)).collect(),
            reference: stamps.reference.iter().map(|t| shown.reference(*t)).collect(),
            distance: way(&shown, plan.duration),
        }
    }
}

/// Signed way of the rear axle until `end` \[m\].
fn way(shown: &Trajectory, end: f64) -> f64 {
    let pieces = shown.knots().windows(2).filter(|pair| pair[1].time <= end);
    pieces.map(|pair| 0.5 * (pair[0].speed + pair[1].speed) * (pair[1].time - pair[0].time)).sum()
}

/// What acts, with true measures and responses as deviations from the described ones.
fn truth(case: &Specification, acting: &[Effect]) -> Effects {
    let mut effects = of(acting);
    let (believed, truth) = (&case.vehicle, &case.truth);
    let mut alter = |id: &str, name: &str, change: &dyn Fn(f64) -> f64| {
        if let Some(parameter) = Parameter::find(id, name) {
            effects.set(parameter, change(effects.get(parameter)));
        }
    };
    alter("wheelbase_scale", "scale", &|scale| scale * truth.wheelbase / believed.wheelbase);
    alter("track_scale", "front", &|scale| scale * truth.track_front / believed.track_front);
    alter("track_scale", "rear", &|scale| scale * truth.track_rear / believed.track_rear);
    let (real, said) = (truth.response(), believed.response());
    alter("speed_delay", "delay", &|delay| delay + real.speed_delay - said.speed_delay);
    alter("speed_lag", "lag", &|lag| lag + real.speed_lag - said.speed_lag);
    alter("steering_delay", "delay", &|delay| delay + real.steering_delay - said.steering_delay);
    alter("steering_lag", "lag", &|lag| lag + real.steering_lag - said.steering_lag);
    for wheel in WHEELS {
        if let Some(parameter) = Parameter::find_at("radius", "factor", wheel) {
            let factor = truth.radius[wheel.index()] / believed.radius[wheel.index()];
            effects.set(parameter, effects.get(parameter) * factor);
        }
    }
    effects
}

/// Listed effects in the simulator's terms.
pub fn of(acting: &[Effect]) -> Effects {
    let mut effects = Effects::NEUTRAL;
    for effect in acting {
        for (name, value) in &effect.values {
            let parameter = match effect.wheel {
                Some(wheel) => Parameter::find_at(effect.id, name, wheel),
                None => Parameter::find(effect.id, name),
            };
            if let Some(parameter) = parameter {
                effects.set(parameter, *value);
            }
        }
    }
    effects
}

/// A drive that is disturbed on its way.
struct Disturbed<'a> {
    vehicle: &'a Vehicle,
    /// The knot before, as it was and as it became.
    before: Option<(Knot, Knot)>,
}

impl<'a> Disturbed<'a> {
    fn new(vehicle: &'a Vehicle) -> Self {
        Self { vehicle, before: None }
    }

    fn is_driven(&self, wheel: Wheel) -> bool {
        match self.vehicle.drive {
            Driven::All => true,
            Driven::Front => wheel.is_front(),
            Driven::Rear => !wheel.is_front(),
        }
    }

    /// Lets a knot be what it is with `slip` as a share, `angle` \[rad\] and `side` as a share of the speed.
    fn alter(&mut self, knot: &mut Knot, [slip, angle, side]: [f64; 3]) {
        let plain = *knot;
        let cos = math::cos(plain.rack);
        let grip = 1.0 - slip;
        let turn = plain.yaw_rate * grip
            + plain.speed * grip * angle / (self.vehicle.wheelbase * cos * cos);
        let more = turn - plain.yaw_rate;
        let (sin, cos) = math::sin_cos(plain.pose.yaw);
        let ahead = grip * (cos * plain.velocity.0 + sin * plain.velocity.1);
        let across =
            grip * (-sin * plain.velocity.0 + cos * plain.velocity.1) + side * plain.speed.abs();
        knot.speed = plain.speed * grip;
        knot.yaw_rate = turn;
        for wheel in WHEELS {
            let i = wheel.index();
            let roll = if self.is_driven(wheel) { 1.0 } else { grip };
            let lever = -self.vehicle.wheel_position(wheel).1 / self.vehicle.radius[i];
            knot.rotation_rate[i] = plain.rotation_rate[i] * roll + lever * more;
        }
        if let Some((was, became)) = self.before {
            let span = plain.time - was.time;
            let mean = |from: f64, to: f64| 0.5 * span * (from + to);
            knot.pose.yaw = became.pose.yaw
                + (plain.pose.yaw - was.pose.yaw)
                + mean(became.yaw_rate - was.yaw_rate, more);
            for i in 0..4 {
                let more = mean(
                    became.rotation_rate[i] - was.rotation_rate[i],
                    knot.rotation_rate[i] - plain.rotation_rate[i],
                );
                knot.rotation[i] =
                    became.rotation[i] + (plain.rotation[i] - was.rotation[i]) + more;
            }
            knot.velocity = turned(knot.pose.yaw, ahead, across);
            // What the plain drive did, turned by how far this one has turned from it, and what the disturbances add.
            let off = became.pose.yaw - was.pose.yaw;
            let (dx, dy) = turned(off, plain.pose.x - was.pose.x, plain.pose.y - was.pose.y);
            let extra = |plain: &Knot, real: &Knot, off: f64| {
                let (x, y) = turned(off, plain.velocity.0, plain.velocity.1);
                (real.velocity.0 - x, real.velocity.1 - y)
            };
            let (first, last) = (extra(&was, &became, off), extra(&plain, knot, off));
            knot.pose = Pose {
                x: became.pose.x + dx + mean(first.0, last.0),
                y: became.pose.y + dy + mean(first.1, last.1),
                ..knot.pose
            };
        } else {
            knot.velocity = turned(plain.pose.yaw, ahead, across);
        }
        self.before = Some((plain, *knot));
    }
}

/// A vector turned by `angle` \[rad\].
fn turned(angle: f64, x: f64, y: f64) -> (f64, f64) {
    let (sin, cos) = math::sin_cos(angle);
    (cos * x - sin * y, sin * x + cos * y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_proving_ground::cases::{Case, Errors, Kind, Request, SecondVehicle};

    fn case(id: &'static str, kind: Kind) -> Case {
        let ids = if kind == Kind::Null { Vec::new() } else { vec![id] };
        let request = Request { ids, share: Some(0.3), duration: 12.0, ..Request::new(kind) };
        let mut cases = (0..200).filter_map(|seed| Case::of(seed, &request));
        let small = |case: &Case| {
            let vehicle = &case.specification.vehicle;
            vehicle.wheelbase < 0.6 && vehicle.reference.is_some() && vehicle.encoders.is_some()
        };
        cases.find(small).unwrap()
    }

    /// Where a drive ends, by the reference's last row.
    fn end(case: &Case, plant: &dyn Drives, run: usize, errors: Errors) -> (f64, f64) {
        let plan = &case.specification.runs[run];
        let rows = case.record_by(plant, plan, true, errors);
        let last = rows.reference.last().unwrap().value;
        (last.0, last.1)
    }

    #[test]
    fn both_plants_drive_about_the_same_way_where_the_effect_is_the_same() {
        for id in
            ["wheelbase_scale", "steering_lag", "speed_gain", "count_loss", "reference_marker"]
        {
            let case = case(id, Kind::Single);
            for run in 0..case.specification.runs.len() {
                let [a, b] = [&SecondVehicle as &dyn Drives, &Simulated]
                    .map(|plant| end(&case, plant, run, Errors::None));
                let off = math::hypot(a.0 - b.0, a.1 - b.1);
                // Tyres and linkage; the effects themselves move the end by many times that.
                assert!(off < 0.06, "{id}, run {run}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn disturbances_move_both_plants_by_about_as_much() {
        let case = case("", Kind::Null);
        let scatter = |plant: &dyn Drives| {
            let (mut sum, mut count) = (0.0, 0.0);
            for run in 0..case.specification.runs.len() {
                let calm = end(&case, plant, run, Errors::None);
                for seed in 1..8 {
                    let (x, y) = end(&case, plant, run, Errors::Unwrapped(seed));
                    sum += (x - calm.0).powi(2) + (y - calm.1).powi(2);
                    count += 1.0;
                }
            }
            f64::sqrt(sum / count)
        };
        let (theirs, ours) = (scatter(&SecondVehicle), scatter(&Simulated));
        assert!((0.6..1.6).contains(&(ours / theirs)), "{theirs} m and {ours} m");
        let noise = case.specification.floor.position;
        assert!(ours > 1.5 * noise, "{ours} m is noise of the reference alone");
    }
}
