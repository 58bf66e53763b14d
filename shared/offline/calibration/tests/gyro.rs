//! A gyro in the fit: where it alone tells the heading, and where nothing else tells it.

#![allow(clippy::float_cmp)] // The same number, handed on.

use kerbside_calibration::{Parameter, ReferencePose, Run, Series, Settings, calibrate};
use kerbside_geometry::{Gyro, Pose, Vehicle};

/// Readings per second \[Hz\].
const RATE: u32 = 50;
/// What the gyro reads at rest \[rad/s\].
const BIAS: f64 = 0.02;

/// Time at rest before a drive \[s\].
const REST: f64 = 10.0;

/// A car whose rear wheels are 1 % and 1.2 % larger, its rear track 3 % wider than its file says.
const LARGER: [f64; 2] = [1.01, 1.012];
const WIDER: f64 = 1.03;

fn car() -> Vehicle {
    Vehicle {
        gyro: Some(Gyro { noise: 0.002, rate: f64::from(RATE), bias: 0.0 }),
        ..Vehicle::paper_car()
    }
}

/// A drive of 8 m at 0.25 m/s on circles of `curvature` \[1/m\], after a rest, by which the
/// gyro's bias is told from a turn.
fn drive(name: &str, curvature: f64, poses: bool) -> Run {
    let car = car();
    let half = 0.5 * WIDER * car.track_rear;
    let rolled = |t: f64| 0.25 * (t - REST).max(0.0);
    let count = 42 * RATE;
    let t: Vec<f64> = (0..=count).map(|index| f64::from(index) / f64::from(RATE)).collect();
    let wheel = |side: usize| {
        let lever = if side == 0 { -half } else { half };
        let radius = LARGER[side] * car.radius[2 + side];
        let turn = |t: &f64| rolled(*t) * (1.0 + lever * curvature) / radius;
        Series { t: t.clone(), value: t.iter().map(turn).collect() }
    };
    let rate = |t: &f64| BIAS + if *t > REST { 0.25 * curvature } else { 0.0 };
    let yaw_rate = Series { t: t.clone(), value: t.iter().map(rate).collect() };
    let seen = |t: &f64| {
        let pose = Pose::default().advance(rolled(*t), curvature * rolled(*t));
        ReferencePose { t: *t, x: pose.x, y: pose.y, yaw: None }
    };
    let last = t[t.len() - 1];
    Run {
        name: name.to_owned(),
        manoeuvre: "circle".to_owned(),
        rotation: [None, None, Some(wheel(0)), Some(wheel(1))],
        yaw_rate: Some(yaw_rate),
        reference: if poses { t.iter().step_by(10).map(seen).collect() } else { Vec::new() },
        distance: (!poses).then(|| rolled(last)),
        ..Run::default()
    }
}

#[test]
fn a_gyro_and_a_tape_stand_for_a_reference() {
    let runs = [("left", 0.6), ("right", -0.6), ("straight", 0.0), ("wide", 0.3)];
    let runs = runs.map(|(name, curvature)| drive(name, curvature, false));
    let car = car();
    let mut settings = Settings::of(&car);
    settings.noise.distance = 0.0005;
    let found = calibrate(&runs, &car, &settings).unwrap();
    let rejected: Vec<_> = found.rejected.iter().map(|out| &out.why).collect();
    assert!(rejected.is_empty(), "{rejected:?}");
    let of = |parameter: Parameter| found.estimate(parameter).unwrap();
    for (parameter, truth) in [
        (Parameter::RadiusRearLeft, LARGER[0] * car.radius[2]),
        (Parameter::RadiusRearRight, LARGER[1] * car.radius[3]),
        (Parameter::TrackRear, WIDER * car.track_rear),
    ] {
        let estimate = of(parameter);
        assert!(estimate.identified, "{}", parameter.name());
        let error = (estimate.value / truth - 1.0).abs();
        assert!(error < 2e-3, "{}: {error}", parameter.name());
    }
}

/// One wheel and a gyro whose bias nobody told: the positions give the wheel's radius.
#[test]
fn one_wheel_and_a_gyro_are_enough_beside_positions() {
    let mut car = car();
    car.track_rear = 0.0;
    let radius = 1.01 * car.radius[2];
    let runs = [("left", 0.6), ("right", -0.6), ("straight", 0.0)].map(|(name, curvature)| {
        let mut run = drive(name, curvature, true);
        let moved = |t: &f64| 0.25 * (t - REST).max(0.0) / radius;
        let t = run.rotation[2].take().map_or(Vec::new(), |series| series.t);
        run.rotation = [None, None, Some(Series { value: t.iter().map(moved).collect(), t }), None];
        run
    });
    let found = calibrate(&runs, &car, &Settings::of(&car)).unwrap();
    let estimate = found.estimate(Parameter::RadiusRearLeft).unwrap();
    assert!(estimate.identified);
    let error = estimate.value / radius - 1.0;
    assert!(error.abs() < 1e-3, "{error}");
    let bias = found.gyro_bias.unwrap();
    assert!((bias.value - BIAS).abs() < 5e-4, "{bias:?}");
    assert!(bias.deviation.unwrap() < 2e-3, "{bias:?}");
    assert_eq!(found.vehicle.gyro.unwrap().bias, bias.value);
}

/// Of one run alone nothing is said of the next one's bias.
#[test]
fn the_bias_of_one_run_comes_without_a_deviation() {
    let mut car = car();
    car.track_rear = 0.0;
    let mut run = drive("left", 0.6, true);
    run.rotation[3] = None;
    let found = calibrate(&[run], &car, &Settings::of(&car)).unwrap();
    let bias = found.gyro_bias.unwrap();
    assert!((bias.value - BIAS).abs() < 2e-3 && bias.deviation.is_none(), "{bias:?}");
    // Two wheels and a reference with headings tell the turn: nobody asks the gyro.
    let mut run = drive("left", 0.6, true);
    run.reference
        .iter_mut()
        .for_each(|pose| pose.yaw = Some(0.6 * 0.25 * (pose.t - REST).max(0.0)));
    let found = calibrate(&[run], &self::car(), &Settings::of(&self::car())).unwrap();
    assert_eq!(found.gyro_bias, None);
}
