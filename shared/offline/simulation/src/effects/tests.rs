//! The library as a whole.

use std::collections::BTreeSet;

use kerbside_geometry::{Pose, Vehicle, Wheel};

use super::*;
use crate::simulator::STEP;
use crate::{Command, Drive, Noise, Simulator, Trajectory};

/// An effect that the library does not have: the front wheels are worn.
pub(super) const FRONT_WEAR: Definition = Definition {
    id: "front_wear",
    link: Link::Ground,
    parameters: &[ParameterDefinition {
        name: "loss",
        neutral: 0.0,
        range: (0.0, 0.1),
        allowed: (0.0, 0.5),
        unit: "1",
        scaling: Scaling::None,
    }],
    per_wheel: false,
    meaning: "The front wheels have lost a part of their radius.",
    source: "This test.",
    excited_by: "Any travel.",
    apply: |values, plant| {
        plant.contact.radius[0] *= 1.0 - values[0];
        plant.contact.radius[1] *= 1.0 - values[0];
    },
};

fn trajectory(effects: Effects) -> Trajectory {
    let vehicle = Vehicle::paper_car();
    let commands = [
        Command { t: 0.2, speed: 0.4, steering: 0.3 },
        Command { t: 3.01, speed: -0.3, steering: -0.2 },
    ];
    let drive = Drive {
        vehicle: &vehicle,
        effects,
        commands: &commands,
        start: Pose::default(),
        step: STEP,
    };
    let mut trajectory = Trajectory::new();
    drive.trajectory(8.0, &mut trajectory);
    trajectory
}

fn effect(id: &str, values: &[(&str, f64)]) -> Effect {
    Effect::new(id, None, values).unwrap()
}

fn overlay(effects: impl IntoIterator<Item = Effect>) -> Overlay {
    let mut overlay = Overlay::new();
    effects.into_iter().for_each(|effect| overlay.add(effect).unwrap());
    overlay
}

#[test]
fn one_more_line_in_the_library_adds_an_effect() {
    assert_eq!(library().last().unwrap().id, "front_wear");
    assert!(Parameter::all().any(|parameter| parameter.to_string() == "front_wear.loss"));
    let worn = overlay([effect("front_wear", &[("loss", 0.05)])]);
    assert_eq!(worn.to_string(), "[[effect]]\nid = \"front_wear\"\nloss = 0.05\n");
    let (worn, nominal) = (trajectory((&worn).into()), trajectory(Effects::NEUTRAL));
    let (worn, nominal) = (worn.rotation(7.0), nominal.rotation(7.0));
    assert!((worn[0] * 0.95 / nominal[0] - 1.0).abs() < 1e-12);
    assert_eq!(worn[2], nominal[2]);
}

#[test]
fn the_order_of_a_file_does_not_matter() {
    let effects = [
        effect("steering_compliance", &[("rate", 0.3)]),
        effect("speed_gain", &[("gain", 0.9)]),
        effect("floor_patch", &[("ratio", 0.2), ("y", 0.1), ("x", 0.3), ("radius", 0.4)]),
        effect("acceleration_limit", &[("limit", 0.2)]),
        effect("clock_drift", &[("rate", 0.003)]),
        effect("drive_slip", &[("ratio", 0.1)]),
    ];
    let ours = trajectory(Effects::from(&overlay(effects.clone())));
    let turned = trajectory(Effects::from(&overlay(effects.into_iter().rev())));
    assert_eq!(format!("{ours:?}"), format!("{turned:?}"));
}

#[test]
fn what_is_no_overlay_is_refused_with_what_would_be() {
    let mut twice = overlay([effect("drive_slip", &[("ratio", 0.1)])]);
    let error = twice.add(effect("drive_slip", &[("ratio", 0.2)])).unwrap_err();
    assert_eq!(error, OverlayError::EffectTwice { id: "drive_slip" });
    assert_eq!(twice.effects().len(), 1);
    let refused = |id, wheel, values: &[(&str, f64)]| {
        let error = Effect::new(id, wheel, values).unwrap_err();
        format!("{}: {error}", error.key())
    };
    for (found, parts) in [
        (refused("drift", None, &[]), &["id:", "\"drift\"", "lateral_drift"][..]),
        (refused("drive_slip", None, &[("rate", 0.1)]), &["rate:", "\"rate\"", "ratio"]),
        (refused("track_scale", None, &[("rear", 1.0)]), &["front:", "missing", "front, rear"]),
        (refused("drive_slip", None, &[("ratio", 1.5)]), &["ratio:", "1.5", "-1 to 0.95"]),
        (refused("speed_delay", None, &[("delay", f64::NAN)]), &["delay:", "NaN"]),
        (refused("count_loss", None, &[("fraction", 0.1)]), &["wheel:", "fl, fr, rl, rr"]),
        (
            refused("drive_slip", Some(Wheel::RearLeft), &[("ratio", 0.1)]),
            &["wheel:", "does not belong", "no wheel"],
        ),
        (
            refused("drive_slip", None, &[("ratio", 0.1), ("ratio", 0.1)]),
            &["ratio:", "given twice"],
        ),
    ] {
        parts.iter().for_each(|part| assert!(found.contains(part), "{part} in {found}"));
    }
}

#[test]
fn every_parameter_has_one_place_and_neutral_values_that_are_allowed() {
    let names: BTreeSet<String> = Parameter::all().map(|parameter| parameter.to_string()).collect();
    assert_eq!(names.len(), Parameter::COUNT);
    for parameter in Parameter::all() {
        let (id, name) = (parameter.effect().id, parameter.definition().name);
        let found = match parameter.wheel() {
            Some(wheel) => Parameter::find_at(id, name, wheel),
            None => Parameter::find(id, name),
        };
        assert_eq!(found, Some(parameter));
        let declared = parameter.definition();
        let inside = |value: f64| value >= declared.allowed.0 && value <= declared.allowed.1;
        assert!(inside(declared.neutral) && inside(declared.range.0), "{parameter}");
        assert!(inside(declared.range.1) && declared.range.0 < declared.range.1);
        assert_eq!(Effects::NEUTRAL.get(parameter), parameter.neutral());
        assert_eq!(Effects::NEUTRAL.with(parameter, 0.5).get(parameter), 0.5);
        assert_eq!(parameter.is_deviation(), definition(id).is_none());
    }
    assert_eq!(Parameter::all().filter(|parameter| parameter.is_deviation()).count(), 6);
    assert!(library().iter().all(|effect| !effect.meaning.is_empty() && !effect.source.is_empty()));
}

#[test]
fn deviations_alter_one_wheel_and_the_limits() {
    let radius = Parameter::find_at("radius", "factor", Wheel::RearRight).unwrap();
    let rotation = trajectory(Effects::NEUTRAL.with(radius, 1.02)).rotation(7.0);
    let nominal = trajectory(Effects::NEUTRAL).rotation(7.0);
    assert!(rotation[3] / rotation[2] < nominal[3] / nominal[2] * 0.985);
    let limit = Parameter::find("limits", "acceleration").unwrap();
    let quick = trajectory(Effects::NEUTRAL.with(limit, 1.02));
    let (quick, nominal) = (quick.state(0.8).motor_speed, 0.3 * (0.8 - 0.22));
    assert!((quick / nominal - 1.02).abs() < 1e-9, "{quick}");
    let rate = Parameter::find("limits", "steering_rate").unwrap();
    let quick = trajectory(Effects::NEUTRAL.with(rate, 0.98)).state(0.4).rack;
    assert!((quick / (0.8 * (0.4 - 0.22)) - 0.98).abs() < 1e-9, "{quick}");
}

#[test]
fn negative_delays_and_lags_make_a_car_quicker_down_to_none() {
    let effects = |values: [f64; 2]| {
        let parameter = |id, name| Parameter::find(id, name).unwrap();
        Effects::NEUTRAL
            .with(parameter("speed_delay", "delay"), values[0])
            .with(parameter("speed_lag", "lag"), values[1])
    };
    let speed = |values| trajectory(effects(values)).state(1.0).motor_speed;
    assert!(speed([-0.01, -0.05]) > speed([0.0, 0.0]));
    assert_eq!(speed([-0.02, -0.1]), speed([-5.0, -5.0]));
}

#[test]
fn a_range_grows_with_the_vehicle() {
    let mut large = Vehicle::paper_car();
    (large.wheelbase, large.limits.speed, large.limits.acceleration) = (2.5, 2.0, 1.2);
    let range = |id, name| Parameter::find(id, name).unwrap().range_for(&large).1;
    assert!((range("reference_marker", "x") - 0.5).abs() < 1e-12);
    assert!((range("speed_dead_zone", "width") - 0.6).abs() < 1e-12);
    assert!((range("acceleration_limit", "limit") - 1.2).abs() < 1e-12);
    assert!((range("understeer", "gradient") - 3.0 / 16.0).abs() < 1e-12);
    assert!((range("steering_compliance", "rate") - 0.125).abs() < 1e-12);
    assert_eq!(range("speed_delay", "delay"), 0.4);
}

#[test]
fn a_car_that_halts_holds_its_steering_whatever_the_actuator_makes_of_commands() {
    let effects = Effects::from(&overlay([
        effect("steering_gain", &[("gain", 1.2)]),
        effect("steering_backlash", &[("width", 0.05)]),
    ]));
    let vehicle = Vehicle::paper_car();
    let mut car = Simulator::with_effects(&vehicle, &effects, Pose::default(), &Noise::NONE, 0);
    car.command(0.0, 0.3, 0.2);
    car.advance(3.0);
    let rack = car.steering();
    car.halt(3.0);
    car.advance(8.0);
    assert!((car.steering() - rack).abs() < 1e-12 && car.speed() == 0.0);
}

#[test]
fn a_live_drive_reads_what_a_whole_one_shows() {
    let effects = Effects::from(&overlay([
        Effect::new("count_loss", Some(Wheel::RearRight), &[("fraction", 0.1)]).unwrap(),
        effect("encoder_delay", &[("delay", 0.123)]),
        effect("steering_sensor_gain", &[("gain", 0.9)]),
        effect("steering_backlash", &[("width", 0.05)]),
        effect("gyro_bias", &[("bias", 0.02)]),
        effect("acceleration_slip", &[("rate", 0.3)]),
    ]));
    let whole = trajectory(effects);
    let vehicle = Vehicle {
        gyro: Some(kerbside_geometry::Gyro { noise: 0.003, rate: 100.0, bias: 0.0 }),
        ..Vehicle::paper_car()
    };
    let mut live = Simulator::with_effects(&vehicle, &effects, Pose::default(), &Noise::NONE, 0);
    live.command(0.2, 0.4, 0.3);
    live.command(3.01, -0.3, -0.2);
    for step in 1..=160 {
        let t = f64::from(step) * 0.05;
        live.advance(t);
        let reading = live.reading();
        let per_radian = 2048.0 / core::f64::consts::TAU;
        for wheel in 0..4 {
            let counts = whole.rotation(t)[wheel] * per_radian;
            let error = reading.counts[wheel] as f64 + 0.5 - counts;
            assert!(error.abs() < 0.51, "{t}: {error}");
        }
        assert!((reading.steering.unwrap() - whole.steering(t)).abs() < 1e-4);
        assert!((reading.yaw_rate.unwrap() - whole.yaw_rate(t)).abs() < 1e-4);
        assert!((live.pose().x - whole.pose(t).x).abs() < 1e-7);
    }
}
