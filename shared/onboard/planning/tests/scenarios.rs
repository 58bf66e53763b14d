//! The two parking scenarios, as they are and with everything about them changed a little.

mod common;

use common::{Scene, check, full_size, garage, garage_of, parallel, parallel_of};
use core::f64::consts::PI;
use kerbside_planning::{Planned, PlannerSettings, plan};

fn solve(scene: &Scene) -> Planned {
    let planned = scene.plan();
    assert!(planned.is_ok(), "{:?}: {planned:?}", scene.start);
    planned.inspect(|planned| check(scene, planned)).unwrap_or_else(|_| unreachable!())
}

#[test]
fn the_garage_takes_one_gear_change_and_ends_straight() {
    let planned = solve(&garage());
    assert_eq!(planned.head.gear_changes, 1);
    let last = planned.path.last().unwrap();
    assert!(last.curvature == 0.0 && last.length < -0.3, "{last:?}");
}

#[test]
fn the_parallel_slot_takes_several_moves() {
    let planned = solve(&parallel());
    assert!((2..=4).contains(&planned.head.gear_changes));
    assert!(planned.head.length < 6.0 && planned.head.duration < 60.0);
}

#[test]
fn disturbed_starts_of_the_garage_are_solved() {
    (0..20).for_each(|number| drop(solve(&garage().disturbed(number))));
}

#[test]
fn disturbed_starts_of_the_parallel_slot_are_solved() {
    (0..10).for_each(|number| drop(solve(&parallel().disturbed(number))));
}

#[test]
fn more_disturbed_starts_of_the_parallel_slot_are_solved() {
    (10..20).for_each(|number| drop(solve(&parallel().disturbed(number))));
}

#[test]
fn both_are_solved_at_full_size() {
    let exact = full_size(3.0, 4.5, 2.22, 0.78);
    let other = full_size(2.8, 4.6, 1.85, 0.9);
    for vehicle in [exact, other] {
        solve(&garage().scaled(6.0, vehicle.clone(), 0.6));
        solve(&garage().scaled(6.0, vehicle.clone(), 0.6).disturbed(3));
        solve(&parallel().scaled(6.0, vehicle.clone(), 0.6));
        solve(&parallel().scaled(6.0, vehicle, 0.6).disturbed(5));
    }
}

#[test]
fn the_mirror_image_is_solved_as_well() {
    for scene in [garage(), parallel()] {
        let (seen, mirrored) = (solve(&scene), solve(&scene.clone().mirrored()));
        assert_eq!(seen.head.gear_changes, mirrored.head.gear_changes);
        assert!((seen.head.duration / mirrored.head.duration - 1.0).abs() < 0.1);
    }
}

#[test]
fn other_slots_are_solved() {
    solve(&garage_of(0.572));
    let mut narrow = garage_of(0.468);
    narrow.request.clearance = 0.04;
    solve(&narrow);
    solve(&parallel_of(1.2375));
    let mut short = parallel_of(1.0125);
    short.request.gear_changes = 8;
    solve(&short);
}

#[test]
fn other_starts_in_the_aisle_are_solved() {
    solve(&garage().started_at(1.3, 0.6, PI));
    solve(&garage().started_at(-1.4, 0.4, 0.2));
    solve(&garage().started_at(0.6, 0.7, 7.0 * PI));
    solve(&parallel().started_at(1.3, 0.45, 0.0));
    solve(&parallel().started_at(-1.3, 0.8, -0.2));
    solve(&parallel().started_at(0.3, 0.6, 0.15));
}

#[test]
fn the_same_request_gives_the_same_bits() {
    for scene in [garage().disturbed(9), parallel().disturbed(4)] {
        let (first, second) = (scene.plan().unwrap(), scene.plan().unwrap());
        let bytes = |planned: &Planned| bytemuck::cast_slice::<_, u8>(&planned.points).to_vec();
        assert_eq!(bytes(&first), bytes(&second));
        assert_eq!(bytemuck::bytes_of(&first.head), bytemuck::bytes_of(&second.head));
    }
}

#[test]
fn more_clearance_than_asked_for_is_taken_where_there_is_room() {
    let scene = parallel();
    let settings = PlannerSettings { comfort: 1.0, ..PlannerSettings::default() };
    let bare = plan(&scene.vehicle, &settings, scene.start, &scene.request, &mut |_| ()).unwrap();
    let planned = solve(&scene);
    assert!(planned.head.clearance >= 1.3 * scene.request.clearance);
    assert!(planned.head.duration < 1.2 * bare.head.duration);
}
