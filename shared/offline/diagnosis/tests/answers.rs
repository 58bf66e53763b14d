//! The answer follows from the data: effects put in are found with their sizes, nothing is found where nothing is,
//! what is not listed is said to be unknown, and mistakes are told from physics.

#![allow(clippy::expect_used, clippy::panic)] // Helpers of tests are tests.

#[allow(dead_code)] // What the other tests use.
mod support;

use kerbside_diagnosis::{Case, DiagnosisError, Settings, Verdict, Wheels, diagnose};
use kerbside_geometry::Pose;
use kerbside_simulation::effects::Link;
use kerbside_simulation::{Effects, Parameter};
use support::{ALL, Sensors, answer, case, case_at_limit, case_marked, case_swinging, with};

fn finds(id: &str, name: &str, value: f64, link: Link, tolerance: f64) {
    let found = answer(&case(&with(id, name, value), ALL, 1));
    assert_eq!(found.verdict, Verdict::Effects, "{}", found.sentence);
    assert_eq!(found.effects.len(), 1, "{}", found.sentence);
    let effect = &found.effects[0];
    assert_eq!((effect.id, effect.link), (id, link), "{}", found.sentence);
    let parameter =
        effect.parameters.iter().find(|parameter| parameter.name == name).expect("named");
    assert!((parameter.value.value - value).abs() < tolerance, "{}", found.sentence);
    assert!(
        parameter.value.low <= parameter.value.value
            && parameter.value.value <= parameter.value.high
    );
    assert_eq!(found.links_named, [link]);
}

#[test]
fn a_speed_gain_is_found() {
    finds("speed_gain", "gain", 0.95, Link::SpeedActuation, 0.002);
}

#[test]
fn a_steering_delay_is_found() {
    finds("steering_delay", "delay", 0.08, Link::SteeringActuation, 0.004);
}

#[test]
fn a_steering_offset_is_found() {
    finds("steering_offset", "offset", 0.02, Link::Ground, 0.002);
}

#[test]
fn a_gyro_bias_is_found() {
    finds("gyro_bias", "bias", 0.008, Link::Sensing, 0.001);
}

#[test]
fn a_reference_delay_is_found() {
    finds("reference_delay", "delay", 0.1, Link::Reference, 0.005);
}

/// Wherever it lies and however large it is: its edges make many small valleys, and the right one is found.
#[test]
fn a_patch_of_the_floor_is_found_with_its_edges() {
    let names = ["x", "y", "radius", "ratio"];
    for (seed, disc) in [[0.6, 0.3, 0.6, 0.1], [1.2, -0.2, 0.9, 0.07], [0.0, 0.5, 0.4, 0.15]]
        .into_iter()
        .enumerate()
    {
        let put = |effects: Effects, (name, value): (&str, f64)| {
            effects.with(Parameter::find("floor_patch", name).expect("listed"), value)
        };
        let effects = names.into_iter().zip(disc).fold(Effects::NEUTRAL, put);
        let found = answer(&case(&effects, ALL, 40 + seed as u64));
        assert_eq!(found.verdict, Verdict::Effects, "{disc:?}: {}", found.sentence);
        assert_eq!(found.effects.len(), 1, "{disc:?}: {}", found.sentence);
        for (parameter, truth) in found.effects[0].parameters.iter().zip(disc) {
            let limit = if parameter.name == "ratio" { 0.01 } else { 0.05 };
            let off = (parameter.value.value - truth).abs();
            assert!(off < limit, "{disc:?}, {}: {}", parameter.name, found.sentence);
        }
    }
}

#[test]
fn two_effects_are_found_together() {
    let effects = with("steering_offset", "offset", 0.025)
        .with(Parameter::find("speed_lag", "lag").expect("listed"), 0.2);
    let found = answer(&case(&effects, ALL, 2));
    let mut ids: Vec<&str> = found.effects.iter().map(|effect| effect.id).collect();
    ids.sort_unstable();
    assert_eq!(
        (found.verdict, ids.as_slice()),
        (Verdict::Effects, &["speed_lag", "steering_offset"][..]),
        "{}",
        found.sentence
    );
    assert_eq!(found.links_named, [Link::SpeedActuation, Link::Ground]);
    let gap = found.gap.expect("a reference");
    assert!(gap.removed.expect("a gap").value > 0.8, "{gap:?}");
}

#[test]
fn a_car_in_good_order_has_nothing() {
    let found = answer(&case(&with("speed_gain", "gain", 1.003), ALL, 3));
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    assert!(
        found.effects.is_empty() && found.alternatives.is_empty() && found.links_named.is_empty()
    );
    let above: Vec<_> = found.links.iter().filter(|link| link.low > 0.0).collect();
    assert!(above.is_empty(), "{above:?}");
}

/// At the limit a motor that is a little too strong makes no difference, one that is too weak does.
#[test]
fn a_car_in_good_order_that_is_driven_at_its_limit_has_nothing() {
    for seed in 20..23 {
        let found = answer(&case_at_limit(&with("speed_gain", "gain", 0.985), 0.3, seed));
        assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    }
}

/// A marker far in front of the rear axle does not set out where the car heads.
#[test]
fn a_marker_in_front_whose_yaw_nobody_tells_is_no_gap() {
    for seed in 60..63 {
        let marker = Pose::new(0.6, 0.1, 0.0);
        let found = answer(&case_marked(&Effects::NEUTRAL, marker, seed));
        assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
        let gap = found.gap.expect("a reference");
        assert!(gap.before < 3.0 * gap.floor, "{gap:?}");
    }
}

#[test]
fn what_depends_on_the_direction_of_travel_is_unknown() {
    let mut left = case(&with("steering_offset", "offset", 0.03), ALL, 4);
    let right = case(&with("steering_offset", "offset", -0.03), ALL, 4);
    // The drives that go in reverse for their second half are of the other car: none is listed that changes sides.
    for drive in [2, 4, 5] {
        left.runs[drive] = right.runs[drive].clone();
    }
    let found = answer(&left);
    assert_ne!(found.verdict, Verdict::None, "{}", found.sentence);
    assert!(
        found.effects.iter().all(|effect| effect.id != "steering_offset"),
        "{}",
        found.sentence
    );
}

#[test]
fn what_swings_by_itself_is_unknown_and_said_with_its_frequency() {
    let found = answer(&case_swinging(0.03, 0.83, 7));
    assert_eq!(found.verdict, Verdict::Unknown, "{}", found.sentence);
    assert_eq!(found.links_named, [Link::SteeringActuation], "{}", found.sentence);
    assert!(found.sentence.contains("swings at 0.8"), "{}", found.sentence);
    // Faster than the bins tell apart.
    let found = answer(&case_swinging(0.05, 2.3, 8));
    assert_eq!(found.verdict, Verdict::Unknown, "{}", found.sentence);
    assert!(found.sentence.contains("or 2.3"), "{}", found.sentence);
}

#[test]
fn a_reference_that_is_pulled_to_a_spot_is_unknown() {
    let mut pulled = case(&Effects::NEUTRAL, ALL, 9);
    let (spot, radius, pull) = ((0.9, 0.1), 0.45, 0.05);
    for row in pulled.runs.iter_mut().flat_map(|run| &mut run.reference.value) {
        let (x, y) = (spot.0 - row[0], spot.1 - row[1]);
        let away = x.hypot(y) / radius;
        let share = pull * away * (1.0 - away).max(0.0) * 4.0 / (away * radius).max(1e-9);
        (row[0], row[1]) = (row[0] + share * x, row[1] + share * y);
    }
    let found = answer(&pulled);
    assert_eq!(found.verdict, Verdict::Unknown, "{}", found.sentence);
    assert_eq!(found.links_named, [Link::Reference], "{}", found.sentence);
}

#[test]
fn without_sensors_the_answer_holds_the_truth_and_says_what_was_not_shown() {
    let sensors = Sensors { steering: false, gyro: false, yaw: true };
    let mut bare = case(&with("steering_gain", "gain", 1.08), sensors, 5);
    for run in &mut bare.runs {
        let Wheels::Rotation(series) = &mut run.wheels else { panic!("counts") };
        series.value.iter_mut().for_each(|row| (row[0], row[1]) = (f64::NAN, f64::NAN));
    }
    let found = answer(&bare);
    assert!(matches!(found.verdict, Verdict::Effects | Verdict::Ambiguous), "{}", found.sentence);
    let ids: Vec<&str> = found.alternatives.iter().flat_map(|a| a.ids.clone()).collect();
    assert!(ids.contains(&"steering_gain"), "{ids:?}");
    for id in ["gyro_bias", "steering_sensor_offset"] {
        assert!(found.not_excited.contains(&id), "{:?}", found.not_excited);
    }
    let steering = found.links.iter().find(|link| link.link == Link::SteeringActuation);
    assert!(!steering.expect("every link is there").measured);
}

#[test]
fn a_gyro_with_the_wrong_sign_is_a_mistake() {
    let mut wrong = case(&Effects::NEUTRAL, ALL, 6);
    for run in &mut wrong.runs {
        run.gyro.value.iter_mut().for_each(|row| row[0] = -row[0]);
    }
    let found = answer(&wrong);
    assert_eq!(found.verdict, Verdict::Mistake, "{}", found.sentence);
    assert_eq!(found.mistake.as_ref().map(|mistake| mistake.kind), Some("sign"));
}

#[test]
fn degrees_and_exchanged_wheels_are_mistakes() {
    let mut degrees = case(&Effects::NEUTRAL, ALL, 7);
    for run in &mut degrees.runs {
        run.steering.value.iter_mut().for_each(|row| row[0] = row[0].to_degrees());
    }
    assert_eq!(answer(&degrees).mistake.map(|mistake| mistake.kind), Some("degrees"));
    let mut swapped = case(&Effects::NEUTRAL, ALL, 8);
    for run in &mut swapped.runs {
        let Wheels::Rotation(series) = &mut run.wheels else { panic!("counts") };
        series.value.iter_mut().for_each(|row| row.swap(2, 3));
    }
    assert_eq!(answer(&swapped).mistake.map(|mistake| mistake.kind), Some("swap"));
}

#[test]
fn what_is_missing_narrows_the_answer_and_breaks_nothing() {
    let mut short = case(&with("steering_offset", "offset", 0.02), ALL, 9);
    short.allowance = None;
    for run in &mut short.runs {
        run.commands.clear();
    }
    let found = answer(&short);
    assert!(found.notices.iter().any(|notice| notice.contains("commands")), "{:?}", found.notices);
    assert!(
        found.effects.iter().all(|effect| effect.link != Link::SpeedActuation),
        "{}",
        found.sentence
    );
    for run in &mut short.runs {
        run.reference = kerbside_diagnosis::Series::default();
    }
    answer(&short);
}

#[test]
fn nothing_to_diagnose_is_said() {
    let mut none = case(&Effects::NEUTRAL, ALL, 10);
    none.runs.clear();
    assert_eq!(diagnose(&none, &Settings::default(), &|_, _| {}), Err(DiagnosisError::NoRun));
}

#[test]
fn the_same_case_gives_the_same_answer() {
    let case = case(&with("understeer", "gradient", 0.8), ALL, 11);
    assert_eq!(format!("{:?}", answer(&case)), format!("{:?}", answer(&case)));
}

/// One wheel's counts and a gyro: nothing but the reference tells how far the car went.
fn one_wheel_and_gyro(effects: &Effects, seed: u64) -> Case {
    let mut case = case(effects, Sensors { steering: false, gyro: true, yaw: true }, seed);
    for run in &mut case.runs {
        let Wheels::Rotation(series) = &mut run.wheels else { panic!("counts") };
        series.value.iter_mut().for_each(|row| *row = [f64::NAN, f64::NAN, row[2], f64::NAN]);
    }
    case
}

#[test]
fn with_one_wheel_and_a_gyro_a_scale_of_the_reference_is_no_unknown_cause() {
    for (scale, seed, commanded) in [(0.96, 12, true), (0.97, 13, false)] {
        let mut case = one_wheel_and_gyro(&with("reference_scale", "scale", scale), seed);
        if !commanded {
            case.runs.iter_mut().for_each(|run| run.commands.clear());
        }
        let found = answer(&case);
        let listed = matches!(found.verdict, Verdict::Effects | Verdict::Ambiguous);
        assert!(listed, "{commanded}: {}", found.sentence);
        let ids: Vec<&str> = found.alternatives.iter().flat_map(|a| a.ids.clone()).collect();
        assert!(ids.contains(&"reference_scale"), "{commanded}: {ids:?}");
    }
}
