//! What each effect changes, and what it leaves alone.

use super::*;

#[test]
fn neutral_effects_change_no_bit() {
    let case = equipped(1, Kind::Null, "", 0.0);
    for run in 0..2 {
        let plain = signals(&case, &[], run);
        for known in LISTED.iter().chain(UNLISTED) {
            let value = |of: &crate::insertions::Parameter| match of.role {
                Role::Free | Role::Place => (of.name, of.high),
                Role::Size | Role::Limit => (of.name, of.neutral),
            };
            let values: Vec<_> = known.parameters.iter().map(value).collect();
            let wheel = known.of_wheel.then_some(kerbside_geometry::Wheel::RearLeft);
            let effect = Effect { wheel, ..Effect::new(known.id, &values) };
            assert_eq!(signals(&case, &[effect], run), plain, "{}", known.id);
        }
    }
}

/// Whether an effect of `link` shows in the channels of that link, by how much they differ.
///
/// # Panics
/// Where a channel upstream differs.
fn shows(id: &str, link: Link, apart: [f64; 5]) -> bool {
    // Steps end where a command begins to act: a delay of one actuator moves the steps of the other one.
    const NOTHING: f64 = 1e-4;
    let [motor, wheels, steering, gyro, reference] = apart;
    match link {
        Link::SpeedActuation => {
            assert!(steering < NOTHING, "{id}: {apart:?}");
            motor > 0.03 && reference > 1e-3
        }
        Link::SteeringActuation => {
            assert!(motor < NOTHING, "{id}: {apart:?}");
            steering > 0.003 && reference > 1e-3
        }
        Link::Ground => {
            assert!(motor < NOTHING && steering < NOTHING, "{id}: {apart:?}");
            wheels.max(gyro).max(reference) > 2e-3
        }
        Link::Sensing => {
            assert!(reference == 0.0, "{id}: {apart:?}");
            let changed = [wheels, steering, gyro].map(|channel| channel > 0.0);
            assert!(changed.into_iter().filter(|changed| *changed).count() <= 1, "{apart:?}");
            wheels.max(steering).max(gyro) > 1e-3
        }
        Link::Reference => {
            assert!(wheels == 0.0 && steering == 0.0 && gyro == 0.0, "{id}: {apart:?}");
            reference > 1e-3
        }
    }
}

#[test]
fn every_effect_changes_its_link_and_nothing_upstream() {
    for (kind, table) in [(Kind::Single, LISTED), (Kind::Unknown, UNLISTED)] {
        for known in table {
            let case = equipped(11, kind, known.id, 0.6);
            let effects = &case.specification.effects;
            let shown = (0..7).any(|run| {
                let (plain, changed) = (signals(&case, &[], run), signals(&case, effects, run));
                shows(known.id, known.link, difference(&case, &changed, &plain))
            });
            assert!(shown, "{} shows in no run", known.id);
        }
    }
}

#[test]
fn gains_offsets_and_losses_are_what_they_say() {
    let case = equipped(21, Kind::Null, "", 0.0);
    let plain = signals(&case, &[], 0);
    let with = |id: &'static str, name: &'static str, value: f64| {
        signals(&case, &[Effect::new(id, &[(name, value)])], 0)
    };
    let close = |one: &[f64], other: Vec<f64>| {
        assert!(apart(one.iter().copied(), other.into_iter()) < 1e-12);
    };
    let each =
        |values: &[f64], change: &dyn Fn(f64) -> f64| values.iter().map(|v| change(*v)).collect();
    close(&with("steering_sensor_gain", "gain", 1.1).steering, each(&plain.steering, &|a| 1.1 * a));
    close(
        &with("steering_sensor_offset", "offset", 0.02).steering,
        each(&plain.steering, &|a| a + 0.02),
    );
    close(&with("gyro_gain", "gain", 0.95).yaw_rate, each(&plain.yaw_rate, &|w| 0.95 * w));
    close(&with("gyro_bias", "bias", 0.01).yaw_rate, each(&plain.yaw_rate, &|w| w + 0.01));
    let scaled = with("reference_scale", "scale", 1.03);
    for (one, other) in scaled.reference.iter().zip(&plain.reference) {
        assert!((one.x - 1.03 * other.x).abs() < 1e-12 && one.yaw == other.yaw);
    }
    let loss = [("fraction", 0.1)];
    let lossy = signals(&case, &[Effect::of_wheel("count_loss", WHEELS[1], &loss)], 0);
    for (one, other) in lossy.wheels.iter().zip(&plain.wheels) {
        assert!((one[1] - 0.9 * other[1]).abs() < 1e-12 && one[0] == other[0]);
    }
    // All radii larger: counts stay, the way grows.
    let larger = with("radius_scale", "scale", 1.05);
    assert!(difference(&case, &larger, &plain)[1] < 0.02, "counts hardly know the radii");
    assert!((larger.distance / plain.distance - 1.05).abs() < 1e-3);
    // Slip: the driven wheels go on, the car does not.
    let slipping = with("drive_slip", "ratio", 0.08);
    assert!((slipping.distance / plain.distance - 0.92).abs() < 2e-3);
}

#[test]
fn delays_shift_what_they_delay() {
    let case = equipped(31, Kind::Null, "", 0.0);
    let plan = &case.specification.runs[0];
    let with = |id: &'static str, name: &'static str, value: f64| {
        signals(&case, &[Effect::new(id, &[(name, value)])], 0)
    };
    let plain = signals(&case, &[], 0);
    // Read at stamps that are the delay later, the delayed signal is the plain one.
    let mut late = case.clone();
    let stamps = &mut late.specification.runs[0].stamps;
    stamps.reference.iter_mut().for_each(|stamp| *stamp += 0.15);
    stamps.encoders.iter_mut().for_each(|stamp| *stamp += 0.15);
    for id in ["reference_delay", "encoder_delay"] {
        let delayed = signals(&late, &[Effect::new(id, &[("delay", 0.15)])], 0);
        let apart = difference(&case, &delayed, &plain);
        assert!(apart[if id == "encoder_delay" { 1 } else { 4 }] < 1e-9, "{id}: {apart:?}");
    }
    // The same of the actuators, but for the kinks of the other one's commands.
    let delayed = with("steering_delay", "delay", 0.15);
    let at = |signals: &Signals, time: f64| {
        let behind = plan.stamps.steering.partition_point(|stamp| *stamp < time).max(1);
        let (a, b) = (plan.stamps.steering[behind - 1], plan.stamps.steering[behind]);
        let share = (time - a) / (b - a);
        signals.steering[behind - 1] * (1.0 - share) + signals.steering[behind] * share
    };
    let times = (100..1700).map(|k| f64::from(k) * 0.01);
    let mean = |delay: f64| -> f64 {
        times.clone().map(|t| (at(&delayed, t) - at(&plain, t - delay)).abs()).sum::<f64>()
    };
    assert!(mean(0.15) < 0.2 * mean(0.0) && mean(0.15) < mean(0.12).min(mean(0.18)));
    let drifting = with("clock_drift", "rate", 0.004);
    let last = plan.stamps.reference.len() - 1;
    let taken = plan.stamps.reference[last] / 1.004;
    let mut early = case.clone();
    early.specification.runs[0].stamps.reference[last] = taken;
    let read = signals(&early, &[], 0).reference[last];
    assert!(drifting.reference[last].distance(&read) < 1e-12);
}

#[test]
fn a_car_without_slip_rolls_as_geometry_says() {
    let mut case = equipped(41, Kind::Null, "", 0.0);
    let build = &mut case.specification.build;
    build.lateral_compliance = [0.0; 2];
    build.longitudinal_compliance = 0.0;
    (build.ackermann, build.linkage, build.toe, build.rolling_resistance) = (1.0, 0.0, 0.0, 0.0);
    case.specification.truth.radius = case.specification.vehicle.radius;
    let truth = &case.specification.truth;
    let motion = steady(&case.specification, &[], 0.2, 0.3);
    let curvature = motion.yaw_rate / motion.forward;
    assert!((curvature * truth.wheelbase - math::tan(0.3)).abs() < 1e-9, "{curvature}");
    let chassis = crate::car::chassis(&case.specification);
    let travel = chassis.travel_per_metre(curvature);
    for (i, travel) in travel.into_iter().enumerate() {
        let rolled = motion.rotation_rate[i] * truth.radius[i];
        assert!((rolled - motion.forward * travel).abs() < 1e-9);
    }
    // And on the way: the rear wheels' difference is the turn.
    let (track, radius) = (truth.track_rear, truth.radius);
    for run in 0..3 {
        let stamps = &mut case.specification.runs[run].stamps;
        stamps.encoders.clone_from(&stamps.reference);
        let signals = signals(&case, &[], run);
        let begin = signals.reference[0].yaw;
        for (wheels, pose) in signals.wheels.iter().zip(&signals.reference) {
            let turned = (wheels[3] * radius[3] - wheels[2] * radius[2]) / track;
            assert!((pose.yaw - begin - turned).abs() < 1e-6, "{turned}");
        }
    }
}

#[test]
fn what_acts_by_side_force_is_labelled_as_measured() {
    for (id, tight) in [("understeer", 0.01), ("steering_compliance", 0.12)] {
        for seed in 0..12 {
            let case = one(seed, Kind::Single, id, 0.6).expect("every car has it").specification;
            let (name, drawn) = case.effects[0].values[0];
            let Measured { value, spread } = measured(&case, id, name).expect("measured");
            assert!((value / drawn - 1.0).abs() < 1.5 * tight, "{id} {seed}: {value} of {drawn}");
            assert!(spread < tight * value, "{id} {seed}: {value} within {spread}");
            let label = Label::new(&case);
            assert_eq!((label.effects[0].values[0].1, label.spread[0].2), (value, spread));
        }
    }
    let case = one(1, Kind::Single, "drive_slip", 0.6).expect("every car has it").specification;
    assert_eq!(measured(&case, "drive_slip", "ratio"), None);
}

#[test]
fn the_plant_of_held_commands_drives_the_same_way() {
    use crate::{Actuators, Command, Plant};
    let mut case = equipped(71, Kind::Null, "", 0.0);
    // Where the rear wheels drive and are as believed, both take a command in the same sense.
    let specification = &mut case.specification;
    specification.vehicle.drive = kerbside_geometry::Drive::Rear;
    specification.truth.drive = kerbside_geometry::Drive::Rear;
    specification.truth.radius = specification.vehicle.radius;
    let (limits, response) = (specification.truth.limits, specification.truth.response());
    let mut physics = crate::car::physics(specification);
    physics.actuators = Actuators {
        speed_delay: response.speed_delay,
        speed_lag: response.speed_lag,
        acceleration_limit: limits.acceleration,
        droop: 0.0,
        steering_delay: response.steering_delay,
        steering_lag: response.steering_lag,
        steering_rate_limit: limits.steering_rate,
        steering_limit: limits.steering,
    };
    let chassis = crate::car::chassis(specification);
    let plan = &mut specification.runs[0];
    plan.stamps.reference = vec![plan.duration];
    let plan = plan.clone();
    let mut plant = Plant::new(&chassis, &physics, plan.start, 0.0);
    plant.step(plan.commands[0].time, Command::default());
    for (k, row) in plan.commands.iter().enumerate() {
        let end = plan.commands.get(k + 1).map_or(plan.duration, |next| next.time);
        plant.step(end - row.time, Command { speed: row.speed, steering: row.steering });
    }
    let end = signals(&case, &[], 0).reference[0];
    let marker = case.specification.vehicle.reference.expect("a reference").marker;
    let other = plant.state().pose.compose(&marker);
    assert!(plan.start.distance(&plant.state().pose) > 0.1);
    let size = case.specification.vehicle.wheelbase;
    assert!(end.distance(&other) < 2e-4 * size, "{end:?} against {other:?}");
    assert!((end.yaw - other.yaw).abs() < 2e-4);
}
