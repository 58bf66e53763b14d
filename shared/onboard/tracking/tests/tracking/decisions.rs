//! When the tracker begins, finishes and gives up.

use kerbside_geometry::Pose;
use kerbside_messages::{
    Command, EstimatorState, Mode, Odometry, Permit, TrackingPhase, TrackingStop,
};
use kerbside_tracking::{Tracker, TrackerInputs, TrackerSettings};

use crate::car::vehicle;
use crate::drive::Loop;
use crate::scene::{ARM, GARAGE, Scene, odometry, permit, stamp};

fn start() -> Loop {
    Loop::new(&vehicle(), Scene::new(0.5, Pose::default(), GARAGE), Pose::default())
}

/// In the middle of the first arc.
fn underway() -> Loop {
    let mut drive = start();
    (0..700).for_each(|_| assert!(drive.step(|_| ())));
    assert!(drive.car.speed > 0.1);
    drive
}

fn stopped(drive: &mut Loop, alter: impl Fn(&mut Odometry)) -> TrackingStop {
    assert!(drive.step(alter));
    let (phase, stop) = drive.verdict();
    assert_eq!((phase, drive.command.speed), (TrackingPhase::Stopped, 0.0));
    stop
}

/// One step of a tracker at the plan's beginning, with samples as the caller wants them.
fn first(tracker: &mut Tracker, plan: bool, permit: Option<&Permit>, estimate: &Odometry) -> bool {
    let scene = Scene::new(0.5, Pose::default(), GARAGE);
    let plan = plan.then_some((&scene.plan, &scene.points[..]));
    let inputs = TrackerInputs { odometry: estimate, plan, permit, now: stamp(0.0) };
    let mut out = Command { speed: 77.0, ..Command::default() };
    let sent = tracker.step(inputs, &mut out);
    assert_eq!(sent, out.speed != 77.0, "what is not sent is not written");
    sent
}

#[test]
fn it_begins_only_with_plan_permit_and_a_valid_standing_pose() {
    let fresh = || Tracker::new(&vehicle(), &TrackerSettings::default());
    let (armed, here) = (permit(0.0, ARM, Mode::Armed), odometry(0.0, &Pose::default(), true));
    assert!(first(&mut fresh(), true, Some(&armed), &here));
    assert!(!first(&mut fresh(), false, Some(&armed), &here), "no plan");
    assert!(!first(&mut fresh(), true, None, &here), "no permit");
    let refused = [
        permit(0.0, ARM + 1, Mode::Armed),
        permit(0.0, ARM, Mode::Driving),
        permit(0.0, ARM, Mode::Done),
        permit(-0.15, ARM, Mode::Armed),
        Permit { granted: 0, ..armed },
    ];
    for permit in refused {
        assert!(!first(&mut fresh(), true, Some(&permit), &here), "{permit:?}");
    }
    let unset = Odometry { state: EstimatorState::Unset.code(), ..here };
    let moving = Odometry { standstill: 0, ..here };
    assert!(!first(&mut fresh(), true, Some(&armed), &unset));
    assert!(!first(&mut fresh(), true, Some(&armed), &moving));
}

#[test]
fn far_from_the_first_point_it_stops_at_once() {
    let scene = Scene::new(0.5, Pose::default(), GARAGE);
    let mut drive = Loop::new(&vehicle(), scene, Pose::new(0.2, 0.0, 0.0));
    assert_eq!(stopped(&mut drive, |_| ()), TrackingStop::Corridor);
}

#[test]
fn a_finished_plan_is_finished_for_good_and_holds_the_steering() {
    let mut drive = start();
    drive.run(|_| ());
    let steering = drive.command.steering;
    for _ in 0..100 {
        // Even a pose that jumps (a fix at standstill) changes nothing any more.
        assert!(drive.step(|odometry| odometry.resets += 1));
        assert_eq!(drive.verdict(), (TrackingPhase::Finished, TrackingStop::None));
        assert_eq!((drive.command.speed, drive.command.steering), (0.0, steering));
    }
}

#[test]
fn leaving_the_corridor_stops_it_for_good() {
    let mut drive = underway();
    assert_eq!(stopped(&mut drive, |odometry| odometry.y += 0.2), TrackingStop::Corridor);
    assert_eq!(stopped(&mut drive, |_| ()), TrackingStop::Corridor, "back in it: too late");
    assert_eq!(stopped(&mut underway(), |odometry| odometry.yaw -= 0.4), TrackingStop::Corridor);
}

#[test]
fn an_uncertain_pose_stops_it() {
    let stop = stopped(&mut underway(), |odometry| odometry.covariance[4] = 0.06 * 0.06);
    assert_eq!(stop, TrackingStop::Covariance);
}

#[test]
fn a_lost_or_jumping_pose_stops_it() {
    assert_eq!(stopped(&mut underway(), |odometry| odometry.resets += 1), TrackingStop::Pose);
    let lost = |odometry: &mut Odometry| odometry.state = EstimatorState::Lost.code();
    assert_eq!(stopped(&mut underway(), lost), TrackingStop::Pose);
}

#[test]
fn a_goal_that_is_not_reached_in_time_stops_it() {
    // The estimate says 5 mm ahead of wherever the plan ends, however far the car creeps.
    let mut drive = start();
    let scene = drive.scene.clone();
    let goal = scene.goal.compose(&Pose::new(0.005, 0.0, 0.0));
    let over = stamp(scene.plan.duration);
    let verdict = drive.run(|odometry| {
        if odometry.header.stamp > over {
            (odometry.x, odometry.y, odometry.yaw) = (goal.x, goal.y, goal.yaw);
        }
    });
    assert_eq!(verdict, (TrackingPhase::Stopped, TrackingStop::Goal));
    let late = drive.command.plan_time - scene.plan.duration;
    assert!((late - 5.0).abs() < 0.01, "{late}");
}

#[test]
fn the_end_is_approached_at_a_creep_in_either_direction() {
    for offset in [0.05, -0.05] {
        // A wheel slips while the plan stands for the last time: the car is elsewhere.
        let mut drive = start();
        let over = drive.scene.plan.duration;
        while drive.command.plan_time < over - 0.1 {
            drive.step(|_| ());
        }
        drive.car.pose = drive.car.pose.compose(&Pose::new(offset, 0.0, 0.0));
        let (mut creep, mut steering) = (0.0_f64, None);
        while drive.command.phase == TrackingPhase::Tracking.code() {
            drive.step(|_| ());
            if drive.command.plan_time > over {
                creep = creep.max(-drive.command.speed * offset.signum());
                assert!(drive.command.speed * offset <= 0.0, "never away from the goal");
                assert_eq!(*steering.get_or_insert(drive.command.steering), drive.command.steering);
            }
        }
        assert!((0.02..=0.025).contains(&creep), "{creep}");
        assert_eq!(drive.verdict().0, TrackingPhase::Finished);
        assert!(drive.miss().x.abs() <= 0.002, "{:?}", drive.miss());
    }
}

#[test]
fn a_permit_that_lapses_ends_the_plan_for_good() {
    let mut drive = underway();
    let at = odometry(drive.car.time, &drive.car.pose, false);
    let now = at.header.stamp;
    let mut out = Command::default();
    let scene = drive.scene.clone();
    let mut step = |permit: &Permit| {
        let plan = Some((&scene.plan, &scene.points[..]));
        let inputs = TrackerInputs { odometry: &at, plan, permit: Some(permit), now };
        drive.tracker.step(inputs, &mut out)
    };
    let live = permit(drive.car.time, ARM, Mode::Driving);
    assert!(step(&live));
    assert!(!step(&Permit { expiry: now, ..live }));
    assert!(!step(&live), "the same arm does not bring it back");
    assert!(!step(&Permit { mode: Mode::Armed.code(), ..live }), "nor does it from the beginning");
}

#[test]
fn a_newer_arm_needs_a_plan_of_its_own() {
    let mut drive = start();
    drive.run(|_| ());
    let here = odometry(drive.car.time, &drive.car.pose, true);
    let newer = permit(drive.car.time, ARM + 1, Mode::Armed);
    let mut out = Command::default();
    let mut step = |scene: &Scene| {
        let plan = Some((&scene.plan, &scene.points[..]));
        let now = here.header.stamp;
        let inputs = TrackerInputs { odometry: &here, plan, permit: Some(&newer), now };
        drive.tracker.step(inputs, &mut out)
    };
    assert!(!step(&drive.scene), "the plan of the arm before");
    let mut next = Scene::new(0.5, drive.car.pose, GARAGE);
    next.plan.arm = ARM + 1;
    assert!(step(&next));
    assert_eq!((out.arm, out.plan_time, out.stop), (ARM + 1, 0.0, TrackingStop::None.code()));
}

#[test]
fn the_plan_is_completed_when_the_planner_is_gone_or_plans_anew() {
    let mut whole = start();
    whole.run(|_| ());
    let mut orphan = start();
    (0..300).for_each(|_| assert!(orphan.step(|_| ())));
    let goal = orphan.scene.goal;
    // A restarted planner answers the request again, from where the car is by now.
    orphan.scene = Scene::new(0.5, orphan.car.pose, &[(-0.3, 0.0)]);
    orphan.scene.plan.id = 4;
    orphan.run(|_| ());
    assert_eq!(orphan.car.pose, whole.car.pose);
    assert!(orphan.car.pose.distance(&goal) < 0.003 && orphan.command.plan == 3);
}

#[test]
fn a_tracker_that_was_restarted_in_the_middle_keeps_quiet() {
    let mut drive = underway();
    drive.tracker = Tracker::new(&vehicle(), &TrackerSettings::default());
    let sent = drive.sent.len();
    // Its last command still acts for a moment; then the gate would brake.
    drive.car.command(0.0, 0.3);
    (0..1000).for_each(|_| assert!(!drive.step(|_| ())));
    assert_eq!((drive.sent.len(), drive.car.speed.abs() < 1e-6), (sent, true));
}
