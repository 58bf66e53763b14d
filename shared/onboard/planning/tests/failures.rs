//! What is not planned, and what is said of it.

mod common;

use common::{check, garage, parallel};
use kerbside_geometry::PolygonError;
use kerbside_messages::PlanVerdict;
use kerbside_planning::{Nearest, PlanFailure, PlannerSettings, RequestFault, plan};

#[test]
fn a_goal_inside_an_obstacle_is_named() {
    let mut scene = garage();
    scene.request.x = 0.3;
    let failure = scene.plan().unwrap_err();
    assert_eq!(failure.verdict(), PlanVerdict::GoalBlocked);
    assert_eq!(failure.to_string(), "the goal overlaps obstacle 1");
}

#[test]
fn a_goal_too_near_says_how_near() {
    let mut scene = garage();
    scene.request.x = 0.035;
    let failure = scene.plan().unwrap_err();
    assert_eq!(failure.to_string(), "the goal is 0.040 m from obstacle 1, 0.050 m are needed");
    let PlanFailure::GoalBlocked(shortfall) = failure else { panic!("{failure}") };
    assert_eq!(shortfall.nearest, Nearest::Obstacle(1));
    assert!((shortfall.found - 0.04).abs() < 1e-12);
}

#[test]
fn a_start_beyond_the_bounds_is_blocked() {
    let failure = garage().started_at(-2.0, 0.65, 0.0).plan().unwrap_err();
    assert_eq!(failure.verdict(), PlanVerdict::StartBlocked);
    assert_eq!(failure.to_string(), "the start leaves the bounds by 0.130 m");
    let failure = garage().started_at(-1.0, 0.1, 0.0).plan().unwrap_err();
    assert_eq!(failure.to_string(), "the start overlaps obstacle 0");
}

#[test]
fn a_goal_behind_a_wall_has_no_path() {
    let mut scene = garage();
    let wall = [[-0.4, 0.25], [0.4, 0.25], [0.4, 0.4], [-0.4, 0.4]];
    assert!(scene.request.push_obstacle(&wall));
    let failure = scene.plan().unwrap_err();
    assert_eq!(failure.verdict(), PlanVerdict::NoPath);
    assert!(failure.to_string().contains("none left"), "{failure}");
}

#[test]
fn limits_that_are_too_tight_have_no_path() {
    let mut scene = parallel();
    scene.request.gear_changes = 0;
    assert_eq!(scene.plan().unwrap_err().verdict(), PlanVerdict::NoPath);
    let settings = PlannerSettings { search_nodes: 50, ..PlannerSettings::default() };
    let scene = parallel();
    let failure =
        plan(&scene.vehicle, &settings, scene.start, &scene.request, &mut |_| ()).unwrap_err();
    let told = failure.to_string();
    assert!(told.contains("50 nodes opened") && !told.contains("none left"), "{told}");
    assert!(told.len() <= 160, "more than an answer holds: {told}");
}

#[test]
fn a_crawl_needs_too_many_points() {
    let mut scene = garage();
    scene.request.speed = 0.005;
    let failure = scene.plan().unwrap_err();
    assert_eq!(failure.verdict(), PlanVerdict::TooLong);
    scene.request.speed = 0.03;
    let planned = scene.plan().unwrap();
    assert!(planned.head.interval > PlannerSettings::default().interval);
    check(&scene, &planned);
}

#[test]
fn polygons_that_are_none_are_refused() {
    let star = [[0.0, 0.3], [1.0, 0.3], [0.5, 0.4], [0.5, 1.0]];
    let clockwise = [[0.0, 0.0], [0.0, 0.1], [0.1, 0.1], [0.1, 0.0]];
    for (corners, cause) in [
        (star, PolygonError::NotConvex { corner: 3 }),
        (clockwise, PolygonError::Clockwise),
        ([[0.0, f64::NAN]; 4], PolygonError::NotFinite { corner: 0 }),
        ([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.3, 0.0]], PolygonError::Flat),
    ] {
        let mut scene = garage();
        assert!(scene.request.push_obstacle(&corners));
        let failure = scene.plan().unwrap_err();
        assert_eq!(failure.verdict(), PlanVerdict::Malformed);
        let PlanFailure::Malformed(RequestFault::Obstacle { index: 2, cause: found }) = failure
        else {
            panic!("{failure}")
        };
        assert!(found == cause || matches!(cause, PolygonError::NotConvex { .. }), "{found}");
    }
}

#[test]
fn requests_that_make_no_sense_are_refused() {
    type Spoil = fn(&mut common::Scene);
    let spoils: [(Spoil, &str); 9] = [
        (|s| s.request.speed = 0.0, "speed is 0"),
        (|s| s.request.speed = f64::INFINITY, "speed is inf"),
        (|s| s.request.clearance = -0.01, "clearance is -0.01, allowed is 0 or more"),
        (|s| s.request.steering = 1.6, "steering is 1.6"),
        (|s| s.request.gear = 2, "gear is 2, allowed is -1, 0 or 1"),
        (|s| s.request.yaw = f64::NAN, "goal pose"),
        (|s| s.start.x = f64::NAN, "start pose"),
        (|s| s.request.bounds[2] = -2.0, "bounds hold nothing"),
        (|s| s.request.sizes = [200; 32], "the obstacles have 6400 corners"),
    ];
    for (spoil, text) in spoils {
        let mut scene = garage();
        spoil(&mut scene);
        let failure = scene.plan().unwrap_err();
        assert_eq!(failure.verdict(), PlanVerdict::Malformed, "{text}");
        assert!(failure.to_string().contains(text), "{failure}");
    }
}

#[test]
fn a_vehicle_that_is_there_already_stays() {
    let mut scene = garage();
    scene.start = kerbside_geometry::Pose::new(0.0, -0.72, core::f64::consts::FRAC_PI_2);
    let planned = scene.plan().unwrap();
    assert_eq!((planned.path.len(), planned.points.len()), (0, 2));
    assert!((planned.head.clearance - 0.075).abs() < 1e-12);
}

#[test]
fn progress_is_told_all_along() {
    let scene = parallel();
    let mut told = Vec::new();
    let settings = PlannerSettings::default();
    let planned =
        plan(&scene.vehicle, &settings, scene.start, &scene.request, &mut |n| told.push(n));
    let nodes = planned.unwrap().search_nodes;
    assert_eq!((told.first(), told.last()), (Some(&0), Some(&nodes)));
    assert!(told.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] - pair[0] <= 32));
}
