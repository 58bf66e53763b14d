//! Bad input is named by its evidence, and good input is not accused.

#![allow(clippy::expect_used)] // Helpers of tests are tests.

mod support;

use core::f64::consts::{FRAC_PI_2, TAU};

use kerbside_calibration::{Finding, Problem, Run, Series, calibrate, diagnose_runs};
use kerbside_geometry::{WHEELS, Wheel};
use support::{Car, nominal};

/// Reference track at 5 Hz, 5 mm and 10 mrad.
fn car() -> Car {
    let mut car = Car::new(0.005, 0.01);
    car.track = Some(0.2);
    car
}

fn findings(runs: &[Run]) -> Vec<Finding> {
    diagnose_runs(runs, &nominal(), &car().settings().noise)
}

fn straight() -> Run {
    car().straight("straight", 5.0, 1)
}

fn left() -> Run {
    car().circle("left", 1.5, TAU, 2)
}

fn right() -> Run {
    car().circle("right", -1.5, TAU, 3)
}

fn slalom() -> Run {
    let legs = [(0.3, 1.2), (-0.3, 2.4), (0.3, 1.2), (-0.2, -1.5), (0.0, 1.0)];
    car().drive("slalom", "slalom", &legs, 4)
}

/// The problems that are named for the run after `spoil`, beside good runs.
fn problems(mut run: Run, spoil: impl Fn(&mut Run)) -> Vec<Problem> {
    spoil(&mut run);
    let name = run.name.clone();
    let mut others = vec![straight(), left(), right()];
    others.retain(|other| other.name != name);
    others.push(run);
    let found = findings(&others);
    let about = found.iter().filter(|finding| finding.run.as_ref() == Some(&name));
    let strangers: Vec<_> =
        found.iter().filter(|finding| finding.run.as_ref() != Some(&name)).collect();
    assert!(strangers.is_empty(), "{strangers:?}");
    about.map(|finding| finding.problem).collect()
}

fn series(run: &mut Run, wheel: usize) -> &mut Series {
    run.rotation[wheel].as_mut().expect("a wheel")
}

#[test]
fn good_runs_are_not_accused() {
    let found = findings(&[straight(), left(), right(), slalom()]);
    assert!(found.is_empty(), "{found:?}");
    let coarse = Car::new(0.05, 5.0_f64.to_radians());
    let runs = coarse.plan(4, 9);
    let found = diagnose_runs(&runs, &nominal(), &coarse.settings().noise);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn swapped_sides_are_named() {
    for run in [left(), right(), slalom()] {
        assert_eq!(
            problems(run.clone(), |run| run.rotation.swap(2, 3)),
            [Problem::SwappedSides { front: false }]
        );
        assert_eq!(
            problems(run, |run| run.rotation.swap(0, 1)),
            [Problem::SwappedSides { front: true }]
        );
    }
}

#[test]
fn wires_swapped_for_good_are_named_in_every_run() {
    let mut runs = vec![straight(), left(), right()];
    runs.iter_mut().for_each(|run| run.rotation.swap(2, 3));
    let found = findings(&runs);
    assert_eq!(found.len(), 3, "{found:?}");
    let swapped = Problem::SwappedSides { front: false };
    assert!(found.iter().all(|finding| finding.problem == swapped && finding.forbids));
}

#[test]
fn swapped_axles_are_named() {
    let swap = |run: &mut Run| {
        run.rotation.swap(0, 2);
        run.rotation.swap(1, 3);
    };
    assert_eq!(problems(left(), swap), [Problem::SwappedAxles]);
    let mut runs = vec![straight(), left(), right()];
    runs.iter_mut().for_each(swap);
    let found = findings(&runs);
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found.iter().all(|finding| finding.problem == Problem::SwappedAxles));
}

#[test]
fn a_wheel_that_counts_backwards_is_named() {
    for wheel in WHEELS {
        for run in [straight(), left(), slalom()] {
            let found = problems(run, |run| {
                series(run, wheel.index()).value.iter_mut().for_each(|value| *value = -*value);
            });
            assert_eq!(found, [Problem::ReversedWheel(wheel)]);
        }
    }
}

#[test]
fn a_reversed_steering_sensor_is_named() {
    let reverse = |run: &mut Run| {
        let steering = run.steering.as_mut().expect("a sensor");
        steering.value.iter_mut().for_each(|value| *value = -*value);
    };
    for run in [left(), right(), slalom()] {
        assert_eq!(problems(run, reverse), [Problem::ReversedSteering]);
    }
    assert_eq!(
        problems(left(), |run| {
            let steering = run.steering.as_mut().expect("a sensor");
            steering.value.iter_mut().for_each(|value| *value = value.to_degrees());
        }),
        [Problem::SteeringUnit]
    );
}

#[test]
fn a_mirrored_reference_is_told_from_a_reversed_heading() {
    for run in [left(), right(), slalom()] {
        let found = problems(run.clone(), |run| {
            for reading in &mut run.reference {
                reading.y = -reading.y;
                reading.yaw = reading.yaw.map(|yaw| -yaw);
            }
        });
        assert_eq!(found, [Problem::MirroredReference]);
        let found = problems(run, |run| {
            for reading in &mut run.reference {
                reading.yaw = reading.yaw.map(|yaw| -yaw);
            }
        });
        assert_eq!(found[0], Problem::ReversedYaw);
    }
}

#[test]
fn a_turned_heading_and_other_units_are_named() {
    for run in [straight(), left(), slalom()] {
        let found = problems(run.clone(), |run| {
            for reading in &mut run.reference {
                reading.yaw = reading.yaw.map(|yaw| yaw + FRAC_PI_2);
            }
        });
        assert_eq!(found, [Problem::TurnedYaw]);
        let found = problems(run.clone(), |run| {
            for reading in &mut run.reference {
                (reading.x, reading.y) = (1000.0 * reading.x, 1000.0 * reading.y);
            }
        });
        assert_eq!(found, [Problem::PositionUnit]);
    }
    let found = problems(left(), |run| {
        for reading in &mut run.reference {
            reading.yaw = reading.yaw.map(f64::to_degrees);
        }
    });
    assert_eq!(found, [Problem::YawUnit]);
}

#[test]
fn a_closed_path_known_at_its_ends_alone_is_not_in_another_unit() {
    // To the left and back to the right: it ends beside where it began, with hardly any turn in all.
    let legs = [(0.6, 5.0), (-0.6, 5.0)];
    let found = problems(car().drive("eight", "eight", &legs, 5), |run| {
        let (first, last) = (run.reference[0], run.reference[run.reference.len() - 1]);
        run.reference = vec![first, last];
    });
    assert!(!found.contains(&Problem::PositionUnit), "{found:?}");
}

#[test]
fn a_wheel_that_tells_no_turn_accuses_no_reference() {
    let mut run = car().drive("slalom", "slalom", &[(0.5, 20.0)], 6);
    for wheel in [0, 1, 3] {
        run.rotation[wheel] = None;
    }
    run.steering = None;
    let found = findings(&[run]);
    let wrong = [Problem::YawUnit, Problem::PositionUnit];
    assert!(found.iter().all(|finding| !wrong.contains(&finding.problem)), "{found:?}");
}

#[test]
fn another_clock_is_found_with_its_offset() {
    for offset in [0.4, -0.4, 1.5] {
        for run in [straight(), left(), slalom()] {
            let found = problems(run.clone(), |run| {
                run.reference.iter_mut().for_each(|reading| reading.t += offset);
            });
            assert_eq!(found, [Problem::OtherClock], "{} {offset}", run.name);
        }
    }
    let mut run = straight();
    run.reference.iter_mut().for_each(|reading| reading.t += 0.4);
    let evidence = &findings(&[run, left()])[0].evidence;
    assert!(evidence.contains("0.4") || evidence.contains("0.38"), "{evidence}");
}

#[test]
fn a_lag_that_is_stated_is_no_other_clock() {
    let mut run = straight();
    run.reference.iter_mut().for_each(|reading| reading.t += 0.4);
    let mut noise = car().settings().noise;
    noise.reference_lag = 0.3;
    let found = diagnose_runs(&[run, left(), right()], &nominal(), &noise);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn samples_that_are_none_are_named() {
    assert_eq!(
        problems(straight(), |run| series(run, 0).value[7] = f64::NAN),
        [Problem::NotANumber]
    );
    assert_eq!(
        problems(straight(), |run| run.reference[3].x = f64::INFINITY),
        [Problem::NotANumber]
    );
    assert_eq!(problems(straight(), |run| series(run, 2).t[7] = 0.0), [Problem::Stamps]);
    assert_eq!(problems(straight(), |run| series(run, 1).value.truncate(9)), [Problem::Stamps]);
}

#[test]
fn a_stuck_wheel_is_named_also_when_it_sticks_half_way() {
    for from in [0, 600] {
        let found = problems(straight(), |run| {
            let value = &mut series(run, 3).value;
            let held = value[from];
            value[from..].iter_mut().for_each(|value| *value = held);
        });
        assert_eq!(found, [Problem::StuckWheel(Wheel::RearRight)], "from reading {from}");
    }
    let found = problems(straight(), |run| {
        series(run, 1).value.iter_mut().for_each(|value| *value *= 4.0);
    });
    assert_eq!(found, [Problem::WheelScale(Wheel::FrontRight)]);
}

#[test]
fn a_counter_that_jumps_is_named() {
    let found = problems(left(), |run| {
        series(run, 0).value[700..].iter_mut().for_each(|value| *value -= 65536.0 / 2000.0 * TAU);
    });
    assert_eq!(found, [Problem::Jump(Wheel::FrontLeft)]);
}

#[test]
fn a_row_that_comes_late_is_no_jump() {
    let found = problems(left(), |run| {
        for series in run.rotation.iter_mut().flatten() {
            let rows = series.t.iter().zip(&series.value).step_by(20);
            let (t, value): (Vec<f64>, Vec<f64>) = rows.map(|(t, value)| (*t, *value)).unzip();
            (series.t, series.value) = (t, value);
            series.t[15] = series.t[16] - 1e-4;
        }
    });
    assert_eq!(found, []);
}

#[test]
fn a_vehicle_that_turns_on_the_spot_is_not_accused() {
    let mut vehicle = nominal();
    vehicle.limits.steering = 1.57;
    let t: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.02).collect();
    let turn = |sign: f64| Series { t: t.clone(), value: t.iter().map(|t| sign * t).collect() };
    let yaw = |t: f64| Some(t * 2.0 * 0.0725 / 0.31);
    let run = Run {
        name: "spot".to_owned(),
        rotation: [None, None, Some(turn(-1.0)), Some(turn(1.0))],
        reference: t
            .iter()
            .step_by(10)
            .map(|t| kerbside_calibration::ReferencePose { t: *t, x: 1.0, y: 2.0, yaw: yaw(*t) })
            .collect(),
        ..Run::default()
    };
    let noise = car().settings().noise;
    let accused = diagnose_runs(&[run], &vehicle, &noise);
    assert!(accused.iter().all(|finding| !finding.forbids), "{accused:?}");
}

#[test]
fn runs_that_are_too_short_or_do_not_turn_are_named() {
    let short = car().straight("short", 0.3, 5);
    assert_eq!(problems(short, |_| ()), [Problem::TooShort]);
    let named_circle = car().drive("named", "circle", &[(0.0, 4.0)], 6);
    assert_eq!(problems(named_circle, |_| ()), [Problem::NoTurning]);
    let found = findings(&[straight()]);
    assert_eq!(found.len(), 1);
    assert_eq!((found[0].run.as_ref(), found[0].problem), (None, Problem::NoTurning));
}

#[test]
fn a_quarter_turn_with_a_coarse_reference_is_not_for_the_closed_form() {
    let car = Car::new(0.05, 5.0_f64.to_radians());
    let quarter = car.circle("quarter", 1.5, FRAC_PI_2, 7);
    let runs = [car.straight("straight", 5.0, 8), quarter];
    let found = diagnose_runs(&runs, &nominal(), &car.settings().noise);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((found[0].problem, found[0].forbids), (Problem::CoarseHeading, false));
    let form = kerbside_calibration::closed_form(&runs, &nominal(), &car.settings().noise);
    assert_eq!(form.refused.len(), 1);
    assert!(form.missing[0].to_string().contains("3 % at most"), "{:?}", form.missing);
}

#[test]
fn what_is_forbidden_is_not_fitted() {
    let mut runs = vec![straight(), left(), right()];
    runs[1].rotation.swap(2, 3);
    let found = calibrate(&runs, &nominal(), &car().settings()).expect("a calibration");
    assert_eq!(found.rejected.len(), 1);
    assert_eq!(found.rejected[0].run, "left");
    assert!(found.rejected[0].why.contains("exchanged"), "{}", found.rejected[0].why);
    let mut runs = vec![straight()];
    series(&mut runs[0], 0).value[0] = f64::NAN;
    assert!(calibrate(&runs, &nominal(), &car().settings()).is_err());
    assert!(calibrate(&[], &nominal(), &car().settings()).is_err());
}
