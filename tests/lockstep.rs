//! The stack in lockstep: it parks from many starts, gives the same bits for the same seed, and survives scripted
//! faults as the processes do.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use clap::Parser;
use kerbside::lockstep::{Fault, Kind, LineMishap, Schedule, Way};
use kerbside::manoeuvre::End;
use kerbside::park::judge::{Verdict, judge};
use kerbside::park::{Job, ParkArgs, Run, job, simulated};
use kerbside_messages::{
    AlterReason, Cause, EstimatorState, Mode, Nanos, Odometry, Process, ResetReason,
};

#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    park: ParkArgs,
}

const SECOND: Nanos = 1_000_000_000;

fn job_of(words: &[&str], seed: u64) -> Job {
    let words = ["park"].iter().chain(words).chain(&["--lockstep"]);
    let arguments = Arguments::parse_from(words);
    job(&arguments.park, seed, Path::new("/nonexistent")).unwrap()
}

fn drive(words: &[&str], seed: u64, schedule: Schedule) -> (Run, Verdict) {
    let job = job_of(words, seed);
    let run = simulated::run(&job, schedule).unwrap();
    let verdict = judge(&run.trace, &job.scenario, &job.service.vehicle, run.end);
    (run, verdict)
}

/// When the car of seed 1 is well on its way in the garage scene.
fn under_way() -> Nanos {
    let (run, _) = drive(&["garage"], 1, Schedule::default());
    let moving = run.trace.truth.iter().find(|truth| truth.distance > 0.3).unwrap();
    // Kills fall on the grid of simulated time.
    moving.header.stamp / 1_000_000 * 1_000_000 - SECOND
}

/// The greatest distance rolled after `since`, over the distance at that time.
fn rolled_after(run: &Run, since: Nanos) -> f64 {
    let at = |stamp: Nanos| {
        run.trace.truth.iter().find(|truth| truth.header.stamp >= stamp).unwrap().distance
    };
    let last = run.trace.truth.last().unwrap().distance;
    last - at(since + SECOND)
}

#[test]
fn every_scene_is_parked_from_disturbed_starts() {
    for scene in ["garage", "parallel", "garage-full-size", "parallel-full-size"] {
        let (mut positions, mut headings) = (0.0, 0.0);
        for seed in 1..=5 {
            let (run, verdict) = drive(&[scene], seed, Schedule::default());
            assert!(verdict.parked, "{scene}, seed {seed}: {:?} {}", run.end, verdict.cause);
            let error = verdict.end_error.unwrap();
            positions += error.x.hypot(error.y) / 5.0;
            headings += error.yaw.abs() / 5.0;
        }
        let scale = if scene.ends_with("full-size") { 6.0 } else { 1.0 };
        assert!(positions < 0.010 * scale, "{scene}: mean position error {positions} m");
        assert!(headings < 0.6_f64.to_radians(), "{scene}: mean heading error {headings} rad");
    }
}

#[test]
fn gear_changes_and_clearances_keep_to_the_scenes() {
    for (scene, changes, clearance) in [("garage", 1, 0.05), ("parallel", 4, 0.03)] {
        let (run, verdict) = drive(&[scene], 2, Schedule::default());
        let plan = &run.trace.plans[0].head;
        assert!(plan.gear_changes <= changes && plan.clearance >= clearance, "{scene}: {plan:?}");
        assert!(plan.steering <= 28.0_f64.to_radians() + 1e-9, "{scene}: {plan:?}");
        assert_eq!(verdict.gear_changes, plan.gear_changes, "{scene}");
        assert!(!verdict.collision);
    }
}

#[test]
fn the_same_seed_gives_the_same_bits() {
    let bits = |run: &Run| -> Vec<u8> {
        let odometry =
            run.trace.odometry.iter().flat_map(|sample| bytemuck::bytes_of(sample).to_vec());
        let commands =
            run.trace.commands.iter().flat_map(|sample| bytemuck::bytes_of(sample).to_vec());
        let truth = run.trace.truth.iter().flat_map(|sample| bytemuck::bytes_of(sample).to_vec());
        odometry.chain(commands).chain(truth).collect()
    };
    let (one, _) = drive(&["parallel"], 7, Schedule::default());
    let (two, _) = drive(&["parallel"], 7, Schedule::default());
    let (other, _) = drive(&["parallel"], 8, Schedule::default());
    assert!(bits(&one) == bits(&two), "two runs of seed 7 differ");
    assert!(bits(&one) != bits(&other), "seeds 7 and 8 are one run");
}

#[test]
fn a_death_on_the_control_path_stops_the_car_and_is_named() {
    let at = under_way();
    for process in [
        Process::Interface,
        Process::Ingest,
        Process::Estimator,
        Process::Tracker,
        Process::Actuation,
    ] {
        let schedule = Schedule::kills(&[(at, process)]);
        let (run, verdict) = drive(&["garage"], 1, schedule);
        assert_eq!(run.end, End::Stopped(Cause::Died), "{process}: {}", verdict.cause);
        assert!(verdict.cause.contains(process.name()), "{process}: {}", verdict.cause);
        assert!(!verdict.parked && !verdict.collision, "{process}");
        let rolled = rolled_after(&run, at);
        assert!(rolled < 0.15, "{process}: rolled {rolled} m at 0.2 m/s");
        assert_eq!(run.trace.state.unwrap().mode(), Mode::Faulted, "{process}");
    }
}

#[test]
fn after_a_death_the_operator_completes_the_manoeuvre() {
    let at = under_way();
    for process in [
        Process::Interface,
        Process::Ingest,
        Process::Estimator,
        Process::Tracker,
        Process::Actuation,
    ] {
        let schedule = Schedule::kills(&[(at, process)]);
        let (run, verdict) = drive(&["garage", "--rearm"], 1, schedule);
        assert!(verdict.parked, "{process}: {:?} {}", run.end, verdict.cause);
        assert_eq!(run.trace.restarts(), 1, "{process}");
        assert!(run.trace.plans.len() >= 2, "{process}: planned anew");
        let lost = |state: u8| state == EstimatorState::Lost.code();
        assert!(
            !run.trace.odometry.iter().any(|odometry| lost(odometry.state)),
            "{process}: pose lost"
        );
    }
}

#[test]
fn a_restarted_estimator_goes_on_with_what_it_had_learnt_of_the_vehicle() {
    let schedule = Schedule::kills(&[(under_way(), Process::Estimator)]);
    let (run, _) = drive(&["garage", "--rearm"], 1, schedule);
    let restored = |odometry: &Odometry| odometry.reset_reason == ResetReason::Restored.code();
    let lives: Vec<_> = run
        .trace
        .odometry
        .chunk_by(|one, next| {
            one.header.epoch == next.header.epoch && restored(one) == restored(next)
        })
        .collect();
    let before = lives[0].last().unwrap();
    let after = lives.iter().find(|life| restored(&life[0])).unwrap()[0];
    let (known, taken) = (&before.filter_state, &after.filter_state);
    assert_ne!(known.parameters, [0.0; 9], "it had learnt something");
    assert_eq!(taken.parameters, known.parameters);
    assert_eq!(taken.basis, known.basis);
    assert!(after.covariance[0] > before.covariance[0], "what rolled by is less certain");
    assert!(after.covariance[0] < 1.9 * before.covariance[0], "but not twice the covariance");
}

#[test]
fn the_death_of_planner_or_recorder_does_not_stop_the_car() {
    let at = under_way();
    for process in [Process::Planner, Process::Recorder] {
        let schedule = Schedule::kills(&[(at, process)]);
        let (run, verdict) = drive(&["garage"], 1, schedule);
        assert!(verdict.parked, "{process}: {:?} {}", run.end, verdict.cause);
        assert_eq!((run.trace.restarts(), run.trace.plans.len()), (1, 1), "{process}");
    }
}

#[test]
fn an_inhibit_stops_the_car_until_somebody_arms() {
    let at = under_way();
    let schedule = Schedule::new(vec![Fault { at, kind: Kind::Inhibit(SECOND) }]);
    let (run, verdict) = drive(&["garage"], 1, schedule.clone());
    assert_eq!(run.end, End::Stopped(Cause::Inhibited), "{}", verdict.cause);
    assert!(rolled_after(&run, at) < 0.10);
    let (run, verdict) = drive(&["garage", "--rearm"], 1, schedule);
    assert!(verdict.parked, "{:?} {}", run.end, verdict.cause);
    let latched = |code: u8| code == AlterReason::Inhibited.code();
    assert!(run.trace.actuators.iter().any(|actuator| latched(actuator.latch)));
}

#[test]
fn a_lost_line_stops_the_car_and_its_return_is_found() {
    let at = under_way();
    let kind = Kind::Line { way: Way::ToHost, mishap: LineMishap::Silence, span: 600_000_000 };
    let schedule = Schedule::new(vec![Fault { at, kind }]);
    let (run, verdict) = drive(&["garage"], 1, schedule.clone());
    assert!(matches!(run.end, End::Stopped(_)), "{:?} {}", run.end, verdict.cause);
    assert!(rolled_after(&run, at) < 0.15);
    let (run, verdict) = drive(&["garage", "--rearm"], 1, schedule);
    assert!(verdict.parked, "{:?} {}", run.end, verdict.cause);
}

#[test]
fn a_vehicle_that_stopped_for_silence_does_not_drive_on_by_itself() {
    let at = under_way();
    for span in [330, 400, 1_200].map(|ms| ms * 1_000_000) {
        let kind = Kind::Line { way: Way::ToVehicle, mishap: LineMishap::Silence, span };
        let schedule = Schedule::new(vec![Fault { at, kind }]);
        let (run, verdict) = drive(&["garage"], 1, schedule.clone());
        assert_eq!(run.end, End::Stopped(Cause::LineLost), "{span}: {}", verdict.cause);
        assert!(rolled_after(&run, at) < 0.15, "{span}");
        let (run, verdict) = drive(&["garage", "--rearm"], 1, schedule);
        assert!(verdict.parked, "{span}: {:?} {}", run.end, verdict.cause);
        assert!(run.trace.plans.len() >= 2, "{span}: planned anew");
    }
}

#[test]
fn garbage_on_the_line_costs_nothing_but_itself() {
    let at = under_way();
    let garbage = |index: Nanos| {
        let mishap = LineMishap::Garbage((0..200_u8).collect());
        let kind = Kind::Line { way: Way::ToHost, mishap, span: 1_000_000 };
        Fault { at: at + index * 10_000_000, kind }
    };
    let schedule = Schedule::new((0..50).map(garbage).collect());
    let (run, verdict) = drive(&["garage"], 1, schedule);
    assert!(verdict.parked, "{:?} {}", run.end, verdict.cause);
    assert_eq!(run.trace.restarts(), 0);
}

#[test]
fn two_deaths_at_once_are_survived() {
    let at = under_way();
    let kills = [(at, Process::Ingest), (at, Process::Estimator)];
    let (run, verdict) = drive(&["garage", "--rearm"], 1, Schedule::kills(&kills));
    assert!(verdict.parked, "{:?} {}", run.end, verdict.cause);
    assert_eq!(run.trace.restarts(), 2);
}

#[test]
fn a_process_that_keeps_dying_is_given_up() {
    let at = under_way();
    let kills: Vec<_> = (0..40).map(|index| (at + index * SECOND, Process::Tracker)).collect();
    let (run, verdict) = drive(&["garage", "--rearm"], 1, Schedule::kills(&kills));
    assert_eq!(run.end, End::Stopped(Cause::GaveUp), "{}", verdict.cause);
}

#[test]
fn effects_of_an_overlay_show_in_how_the_car_parks() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("model.toml");
    let text = "[[effect]]\nid = \"steering_offset\"\noffset = 0.05\n\n\
                [[effect]]\nid = \"radius_scale\"\nscale = 1.04\n";
    std::fs::write(&file, text).unwrap();
    let words = ["garage", "--effects", file.to_str().unwrap()];
    let job = job_of(&words, 1);
    assert!(job.command_line.contains("--effects") && job.configuration.len() == 4);
    let (with, told) = drive(&words, 1, Schedule::default());
    let (without, nominal) = drive(&["garage"], 1, Schedule::default());
    let way = |run: &Run| run.trace.truth.last().unwrap().distance;
    let believed = |verdict: &Verdict| {
        let estimate = verdict.estimate_error.unwrap();
        estimate.x.hypot(estimate.y)
    };
    // Wheels that are larger than described roll farther than the odometry believes.
    assert!(way(&with) > 1.02 * way(&without), "{} {}", way(&with), way(&without));
    assert!(believed(&told) > believed(&nominal) + 0.02, "{told:?} {nominal:?}");
}

#[test]
fn a_vehicle_file_that_absorbs_the_effects_brings_the_parking_back() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let model = "[[effect]]\nid = \"steering_offset\"\noffset = 0.03\n\n\
                 [[effect]]\nid = \"radius_scale\"\nscale = 1.04\n\n\
                 [[effect]]\nid = \"steering_gain\"\ngain = 0.92\n";
    let effects = file("model.toml", model);
    let shipped = kerbside_settings::COMPILED_IN;
    let shipped = shipped.iter().find(|(path, _)| *path == "vehicles/paper-1-6.toml").unwrap().1;
    // As `diagnose` writes it: straight wheels are another angle of the rack, and another command.
    let believed = shipped
        .replace("0.0725", "0.0754")
        .replace("[encoders]", "steering_offset = 0.03\nsteering_gain = 0.92\n\n[encoders]")
        .replace("[steering_sensor]", "[steering_sensor]\noffset = -0.03");
    let believed = file("believed.toml", &believed);
    let with = ["garage", "--effects", &effects];
    let back = [&with[..], &["--plant", "paper-1-6", "--vehicle", &believed]].concat();
    let mean = |words: &[&str]| {
        let error = |seed| {
            let error = drive(words, seed, Schedule::default()).1.end_error.unwrap();
            error.x.hypot(error.y)
        };
        (1..=5).map(error).sum::<f64>() / 5.0
    };
    let (without, absorbed) = (mean(&with), mean(&back));
    assert!(absorbed < 0.2 * without && absorbed < 0.015, "{without} and {absorbed}");
}
