//! Recordings as they come: one long log, stamps that begin anywhere, a car that is under way, few and slow sensors, rows
//! that are wrong. What is missing narrows the answer; it never breaks or bends it.

#![allow(clippy::expect_used, clippy::panic)] // Helpers of tests are tests.

#[allow(dead_code)] // What the other tests use.
mod support;

use kerbside_diagnosis::{Diagnosis, Run, Series, Verdict, Wheels};
use kerbside_simulation::effects::Link;
use kerbside_simulation::{Command, Effects};
use support::{ALL, answer, case, one_log, with};

fn names(found: &Diagnosis, id: &str, value: f64, tolerance: f64) {
    assert_eq!(found.verdict, Verdict::Effects, "{}", found.sentence);
    let effect = found.effects.iter().find(|effect| effect.id == id);
    let interval = effect.unwrap_or_else(|| panic!("{}", found.sentence)).parameters[0].value;
    assert!((interval.value - value).abs() < tolerance, "{}", found.sentence);
}

/// Begins a run `later` \[s\] than it did, and counts its stamps from `zero`.
fn begun(run: &Run, later: f64, zero: f64) -> Run {
    fn moved<const N: usize>(series: &Series<N>, later: f64, zero: f64) -> Series<N> {
        let mut series = series.between(later, f64::INFINITY);
        series.t.iter_mut().for_each(|t| *t += zero - later);
        series
    }
    let Wheels::Rotation(wheels) = &run.wheels else { panic!("counts") };
    let commands = run.commands.iter().filter(|command| command.t >= later);
    Run {
        commands: commands.map(|c| Command { t: c.t + zero - later, ..*c }).collect(),
        wheels: Wheels::Rotation(moved(wheels, later, zero)),
        steering: moved(&run.steering, later, zero),
        gyro: moved(&run.gyro, later, zero),
        reference: moved(&run.reference, later, zero),
        ..run.clone()
    }
}

#[test]
fn one_long_log_is_cut_into_blocks_that_serve_as_runs() {
    let found = answer(&one_log(&with("steering_offset", "offset", 0.025), 132.0, 21));
    names(&found, "steering_offset", 0.025, 0.003);
    let said = |words: &str| found.notices.iter().any(|notice| notice.contains(words));
    assert!(said("12 blocks of 1 drive") && said("one run: six are asked for"));
    assert!(found.gap.expect("a reference").removed.expect("a gap").value > 0.8);
}

#[test]
fn a_log_that_begins_under_way_and_at_any_stamp_has_the_same_answer() {
    let mut late = case(&with("speed_gain", "gain", 0.95), ALL, 22);
    late.runs = late.runs.iter().map(|run| begun(run, 2.5, 1.7e9)).collect();
    let found = answer(&late);
    names(&found, "speed_gain", 0.95, 0.004);
    assert!(found.notices.iter().any(|notice| notice.contains("counted from there")));
    late.runs.reverse();
    names(&answer(&late), "speed_gain", 0.95, 0.004);
}

#[test]
fn without_commands_the_floor_is_that_of_the_sensors_that_drive_the_model() {
    let mut log = case(&with("gyro_bias", "bias", 0.01), ALL, 23);
    log.runs.iter_mut().for_each(|run| run.commands.clear());
    let found = answer(&log);
    names(&found, "gyro_bias", 0.01, 0.002);
    for link in found.links.iter().filter(|link| link.measured) {
        let most = if link.unit == "m" { 0.03 } else { 0.05 };
        assert!(link.floor < most, "{link:?}");
    }
    for [.., floor] in found.horizons.iter().map(|h| [h.1, h.3]) {
        assert!(floor.is_finite() && floor < 0.3, "{:?}", found.horizons);
    }
}

#[test]
fn a_slow_reference_with_wild_rows_and_holes_is_no_effect() {
    let mut poor = case(&Effects::NEUTRAL, ALL, 25);
    for (drive, run) in poor.runs.iter_mut().enumerate() {
        let mut rows = 0;
        let mut keep = || {
            rows += 1;
            rows % 5 == 1 && !(60..90).contains(&rows)
        };
        let kept: Vec<bool> = run.reference.t.iter().map(|_| keep()).collect();
        let mut each = kept.iter();
        run.reference.t.retain(|_| *each.next().expect("as many"));
        let mut each = kept.iter();
        run.reference.value.retain(|_| *each.next().expect("as many"));
        run.reference.value[10 + drive][0] += 0.8;
        run.reference.value[25][2] -= 1.5;
    }
    let found = answer(&poor);
    assert_eq!(found.verdict, Verdict::None, "{}", found.sentence);
    let told = found.notices.iter().filter(|notice| notice.contains("stand out")).count();
    assert_eq!(told, 6, "{:?}", found.notices);
}

#[test]
fn what_changes_from_drive_to_drive_is_not_named() {
    let mut changing = case(&with("gyro_bias", "bias", 0.012), ALL, 26);
    let other = case(&with("gyro_bias", "bias", -0.012), ALL, 26);
    for drive in [1, 2, 5] {
        changing.runs[drive] = other.runs[drive].clone();
    }
    let found = answer(&changing);
    assert!(found.effects.iter().all(|effect| effect.id != "gyro_bias"), "{}", found.sentence);
}

#[test]
fn a_few_seconds_are_no_reason_to_fail_or_to_name_anything() {
    let mut short = one_log(&Effects::NEUTRAL, 5.0, 27);
    assert_eq!(answer(&short).verdict, Verdict::None);
    short.runs[0].reference = Series::default();
    assert_eq!(answer(&short).verdict, Verdict::None);
}

#[test]
fn the_links_that_moved_are_named_before_any_fit() {
    let found = answer(&case(&with("speed_lag", "lag", 0.25), ALL, 28));
    assert_eq!(found.moved.first(), Some(&Link::SpeedActuation), "{:?}", found.moved);
    assert!(found.moved.len() <= 2);
    let calm = answer(&case(&Effects::NEUTRAL, ALL, 29));
    assert!(calm.moved.is_empty(), "{:?}", calm.moved);
}

#[test]
fn a_wheel_steered_across_is_left_out_and_the_rest_tells_the_radius() {
    let mut log = case(&with("radius_scale", "scale", 0.95), ALL, 31);
    log.vehicle.limits.steering = 1.55;
    for run in &mut log.runs {
        run.commands.clear();
        // A corner in the midst of the run, that the reference did not take.
        let corner = run.steering.t.iter().zip(&mut run.steering.value);
        corner.filter(|(t, _)| (6.0..7.0).contains(*t)).for_each(|(_, angle)| angle[0] = 1.54);
    }
    let found = answer(&log);
    names(&found, "radius_scale", 0.95, 0.004);
    assert!(found.notices.iter().any(|notice| notice.contains("a turn on the spot is left out")));
}

#[test]
fn stamps_that_jitter_make_no_leaps_of_the_speed() {
    let mut log = case(&with("radius_scale", "scale", 0.95), ALL, 32);
    for run in &mut log.runs {
        run.commands.clear();
        let Wheels::Rotation(series) = &mut run.wheels else { panic!("counts") };
        // Every tenth row comes late, together with the next.
        for k in (5..series.t.len() - 1).step_by(10) {
            series.t[k] = series.t[k + 1] - 1e-4;
        }
    }
    let found = answer(&log);
    names(&found, "radius_scale", 0.95, 0.004);
    for link in found.links.iter().filter(|link| link.measured && link.unit == "m") {
        assert!(link.floor < 0.03 && link.allowance < 0.03, "{link:?}");
    }
}
