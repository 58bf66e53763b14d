//! Tests of the cases, on noise-free signals where nothing is said of noise.

mod literal;
mod signatures;

use kerbside_geometry::{WHEELS, math};

use super::*;
use crate::insertions::{LISTED, Link, Measured, Role, UNLISTED, measure::steady, measured};
use crate::record::Stamped;

fn one(seed: u64, kind: Kind, id: &'static str, share: f64) -> Option<Case> {
    let request =
        Request { ids: vec![id], share: Some(share), runs: 7, holdout: 0, ..Request::new(kind) };
    Case::of(seed, &request)
}

/// The first seed from `seed` on whose vehicle has every sensor, all wheels read and counted, and shows the effect.
fn equipped(seed: u64, kind: Kind, id: &'static str, share: f64) -> Case {
    let complete = |case: &Case| {
        let vehicle = &case.specification.vehicle;
        let all = |counts: &[Option<f64>; 4]| counts.iter().all(Option::is_some);
        vehicle.encoders.is_some_and(|encoders| all(&encoders.counts_per_revolution))
            && vehicle.steering_sensor.is_some()
            && vehicle.gyro.is_some()
            && vehicle.reference.is_some()
            && case.specification.reference_yaw
    };
    (seed..).filter_map(|seed| one(seed, kind, id, share)).find(complete).expect("one of them")
}

fn signals(case: &Case, effects: &[Effect], run: usize) -> Signals {
    let case = &case.specification;
    let disturbance = Disturbance::NONE;
    SecondVehicle.drive(&Task { case, plan: &case.runs[run], effects, disturbance: &disturbance })
}

/// Largest difference of two channels.
fn apart(one: impl Iterator<Item = f64>, other: impl Iterator<Item = f64>) -> f64 {
    one.zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// By how much channels differ: mean rotation of the driven wheels, all wheels, steering, gyro, reference.
fn difference(case: &Case, one: &Signals, other: &Signals) -> [f64; 5] {
    let chassis = crate::car::chassis(&case.specification);
    let driven = WHEELS.map(|wheel| f64::from(u8::from(chassis.is_driven(wheel))));
    let count: f64 = driven.iter().sum();
    let mean = |wheels: &[f64; 4]| (0..4).map(|i| driven[i] * wheels[i]).sum::<f64>() / count;
    let motor = |signals: &Signals| signals.wheels.iter().map(mean).collect::<Vec<_>>();
    let wheels = |signals: &Signals| signals.wheels.concat();
    let marker = |signals: &Signals| {
        signals.reference.iter().flat_map(|pose| [pose.x, pose.y, pose.yaw]).collect::<Vec<_>>()
    };
    let of = |channel: &dyn Fn(&Signals) -> Vec<f64>| {
        apart(channel(one).into_iter(), channel(other).into_iter())
    };
    [
        of(&motor),
        of(&wheels),
        of(&|signals: &Signals| signals.steering.clone()),
        of(&|signals: &Signals| signals.yaw_rate.clone()),
        of(&marker),
    ]
}

#[test]
fn a_car_in_good_order_is_within_its_allowance() {
    for seed in 0..60 {
        let case = bare(seed, &Request::new(Kind::Null));
        let allowed = |id: &str| {
            let of = case.uncertainty.effects.iter().find(|known| known.0 == id);
            of.map_or(0.0, |known| known.2)
        };
        let field = |name: &str| {
            let of = case.uncertainty.fields.iter().find(|known| known.0 == name);
            of.map_or(0.0, |known| known.1)
        };
        let vehicle = &case.vehicle;
        for speed in [0.3, 0.9].map(|share| share * vehicle.limits.speed) {
            for angle in [-0.8, 0.3, 0.8].map(|share| share * vehicle.limits.steering) {
                let gain = case.habits.iter().find(|habit| habit.id == "steering_gain");
                let rack = angle * gain.map_or(1.0, |gain| gain.get("gain"));
                let offset = case.habits.iter().find(|habit| habit.id == "steering_offset");
                let askew = offset.map_or(0.0, |offset| offset.get("offset"));
                let motion = steady(&case, &[], speed, rack + askew);
                let believed = math::tan(angle) / vehicle.wheelbase;
                let off = (motion.yaw_rate / motion.forward / believed - 1.0).abs();
                let tangent = math::tan(angle).abs();
                let per_angle = (1.0 + tangent * tangent) / tangent;
                let squares = [
                    allowed("steering_gain") * angle * per_angle,
                    allowed("steering_offset") * per_angle,
                    field("wheelbase") / vehicle.wheelbase,
                ];
                let deviation = squares.iter().map(|part| part * part).sum::<f64>().sqrt();
                assert!(off < 3.5 * deviation, "{seed}: {off} of {deviation}");
            }
        }
    }
}

#[test]
fn the_kind_shows_in_nothing_but_the_effects() {
    for seed in 0..6 {
        let null = Case::draw(seed, Kind::Null).specification;
        for kind in [Kind::Single, Kind::Pair, Kind::Unknown] {
            let case = Case::draw(seed, kind).specification;
            assert_eq!(case.effects.len(), if kind == Kind::Pair { 2 } else { 1 });
            let hidden = Specification { kind: Kind::Null, effects: Vec::new(), ..case };
            assert_eq!(hidden, null, "{kind:?}");
        }
    }
}

#[test]
fn runs_are_what_they_should_be() {
    for seed in 0..20 {
        let case = Case::draw(seed, Kind::Single);
        let Specification { runs, holdout, .. } = &case.specification;
        assert_eq!((runs.len(), holdout.len()), (6, 3));
        let again: Vec<_> = runs.iter().filter(|plan| plan.repeat_of.is_some()).collect();
        assert_eq!(again.len(), 1);
        let first = runs.iter().find(|plan| Some(&plan.name) == again[0].repeat_of.as_ref());
        assert_eq!(first.expect("it is there").commands, again[0].commands);
        for plan in runs {
            let same = runs.iter().filter(|other| other.name == plan.name).count();
            assert_eq!((same, plan.duration), (1, 18.0));
            let moving = plan.commands.iter().map(|row| row.speed.abs()).fold(0.0, f64::max);
            assert!(moving <= case.specification.vehicle.limits.speed + 5e-4 && moving > 0.0);
        }
        assert_eq!(case.further(4, 10.0).len(), 4);
        assert!(case.further(4, 10.0).iter().all(|plan| plan.duration == 10.0));
    }
}

fn rising<T>(rows: &[Stamped<T>]) -> bool {
    rows.windows(2).all(|pair| pair[0].time < pair[1].time)
}

#[test]
fn rows_are_as_a_recorder_writes_them() {
    for seed in 0..8 {
        let case = Case::draw(seed, Kind::Null);
        let vehicle = &case.specification.vehicle;
        for plan in &case.specification.runs[..2] {
            let rows = case.record(plan, true, Errors::Drawn(0));
            assert_eq!(rows, case.record(plan, true, Errors::Drawn(0)));
            assert_ne!(rows, case.record(plan, true, Errors::Drawn(1)));
            assert!(rising(&rows.counts) && rising(&rows.speeds) && rising(&rows.steering));
            assert!(rising(&rows.yaw_rate) && rising(&rows.reference));
            assert_eq!(rows.counts.is_empty(), vehicle.encoders.is_none());
            assert_ne!(rows.counts.is_empty(), rows.speeds.is_empty());
            if let Some(encoders) = vehicle.encoders {
                let half = 2.0_f64.powi(i32::try_from(encoders.counter_bits).unwrap() - 1);
                let counts = rows.counts.iter().flat_map(|row| row.value).flatten();
                assert!(counts.clone().all(|count| count.fract() == 0.0 && count.abs() <= half));
                let read = encoders.counts_per_revolution.map(|counts| counts.is_some());
                assert!(
                    rows.counts.iter().all(|row| row.value.map(|count| count.is_some()) == read)
                );
            }
            let ideal = case.record(plan, true, Errors::None);
            assert_eq!(ideal, case.record(plan, true, Errors::None));
            let unwrapped = case.record(plan, true, Errors::Unwrapped(0));
            for (shown, exact) in unwrapped.counts.iter().zip(&ideal.counts) {
                let pairs = shown.value.into_iter().zip(exact.value);
                let off = pairs.filter_map(|(shown, exact)| Some((shown? - exact?).abs()));
                // Disturbances of a few thousandths.
                assert!(
                    off.fold(0.0, f64::max)
                        < 5.0 + 0.02 * exact.value[0].or(exact.value[2]).unwrap_or(0.0).abs()
                );
            }
            let white = case.specification.floor.steering;
            if !rows.steering.is_empty() {
                let off = rows.steering.iter().zip(&ideal.steering);
                let square: f64 = off.map(|(a, b)| (a.value - b.value).powi(2)).sum();
                let deviation = (square / rows.steering.len() as f64).sqrt();
                assert!((0.7..2.0).contains(&(deviation / white)), "{deviation} of {white}");
            }
        }
    }
}

#[test]
fn another_plant_can_drive_a_case() {
    struct Parked;
    impl Drives for Parked {
        fn drive(&self, task: &Task<'_>) -> Signals {
            let stamps = &task.plan.stamps;
            Signals {
                wheels: vec![[0.0; 4]; stamps.encoders.len()],
                steering: vec![0.0; stamps.steering.len()],
                yaw_rate: vec![0.0; stamps.gyro.len()],
                reference: vec![task.plan.start; stamps.reference.len()],
                distance: 0.0,
            }
        }
    }
    let case = equipped(51, Kind::Null, "", 0.0);
    let plan = &case.specification.runs[0];
    let rows = case.record_by(&Parked, plan, true, Errors::Drawn(0));
    assert!(rows.counts.windows(2).all(|pair| pair[0].value == pair[1].value));
    assert!((rows.reference[9].value.0 - plan.start.x).abs() < 0.1);
}

#[test]
fn labels_and_descriptions_say_it_all() {
    let case = equipped(61, Kind::Single, "floor_patch", 0.5);
    let text = case.label().text();
    for line in
        ["kind = \"single\"", "links = [\"ground\"]", "id = \"floor_patch\"", "ratio = 0.15"]
    {
        assert!(text.lines().any(|written| written == line), "{line} in {text}");
    }
    for known in UNLISTED {
        let case = equipped(61, Kind::Unknown, known.id, 0.5);
        let label = case.label();
        let text = label.description.clone().expect("a description");
        assert!(text.len() > 40 && !text.contains(['{', '}']), "{text}");
        assert!(label.effects.is_empty() && label.links == [known.link]);
    }
    assert!(vehicle_text(&case.specification).contains("[uncertainty.effect]"));
    assert_eq!(Case::draw(3, Kind::Null).label().text(), "kind = \"null\"\nlinks = []\n");
}

#[test]
fn sizes_occur_from_small_to_large_and_stay_in_range() {
    let mut seen = std::collections::BTreeMap::<&str, usize>::new();
    let mut shares = Vec::new();
    for seed in 0..400 {
        let case = Case::draw(seed, Kind::Single).specification;
        let effect = &case.effects[0];
        *seen.entry(effect.id).or_default() += 1;
        let known = LISTED.iter().find(|known| known.id == effect.id).expect("listed");
        for parameter in known.parameters.iter().filter(|known| known.role == Role::Size) {
            let scale = parameter.unit.scale(&case.vehicle);
            let distance = (effect.get(parameter.name) - parameter.neutral) / scale;
            let end = if distance < 0.0 { parameter.low } else { parameter.high };
            let share = distance / (end - parameter.neutral);
            if known.parameters.len() == 1 {
                assert!((0.049..0.701).contains(&share), "{effect:?}: {share}");
                shares.push(share);
            }
        }
    }
    assert!(seen.len() > 30, "{seen:?}");
    let part = |low: f64, high: f64| {
        let inside = shares.iter().filter(|share| (low..high).contains(*share)).count();
        inside as f64 / shares.len() as f64
    };
    assert!(part(0.0, 0.12) > 0.2 && part(0.12, 0.3) > 0.2 && part(0.3, 1.0) > 0.2);
}

#[test]
fn a_series_has_its_shares_and_every_effect() {
    let series = series(5, 100, |request| Request { runs: 2, holdout: 1, ..request });
    assert_eq!(series.len(), 100);
    let of = |kind: Kind| series.iter().filter(|case| case.1.kind == kind).count();
    let kinds = [Kind::Single, Kind::Pair, Kind::Null, Kind::Unknown];
    assert_eq!(kinds.map(of), [40, 18, 20, 22]);
    for (table, kind) in [(LISTED, Kind::Single), (UNLISTED, Kind::Unknown)] {
        for known in table {
            let there = |case: &&(u64, Request)| case.1.kind == kind && case.1.ids == [known.id];
            assert!(series.iter().any(|case| there(&case)), "{}", known.id);
        }
    }
    for (seed, request) in series.iter().take(20) {
        let case = Case::of(*seed, request).expect("it was tried");
        let first = case.specification.effects.first().map(|effect| effect.id);
        assert_eq!(first, request.ids.first().copied());
    }
    // The first half is no more of one kind than the second.
    let half = |kind: Kind| series[..50].iter().filter(|case| case.1.kind == kind).count();
    assert!(kinds.iter().all(|kind| half(*kind).abs_diff(of(*kind) / 2) <= 8));
}

#[test]
fn each_deviation_is_seen_and_is_small() {
    let case = equipped(91, Kind::Single, "steering_offset", 0.5);
    let deviations = case.deviations();
    let names: Vec<_> = deviations.iter().map(|(name, _)| name.as_str()).collect();
    let all = case.specification.uncertainty.fields.len()
        + 3
        + case.specification.uncertainty.effects.len();
    assert_eq!(names.len(), all, "{names:?}");
    assert!(names.contains(&"radius.fr") && names.contains(&"steering_offset.offset"));
    let acting = |case: &Case, run: usize| {
        let plan = &case.specification.runs[run];
        signals(case, &case.acting(plan, true, Errors::None), run)
    };
    let size = case.specification.vehicle.wheelbase;
    for (name, other) in &deviations {
        let most = (0..4).map(|run| difference(&case, &acting(other, run), &acting(&case, run)));
        let most =
            most.fold([0.0_f64; 5], |most, apart| core::array::from_fn(|i| most[i].max(apart[i])));
        assert!(most.iter().any(|apart| *apart > 1e-5), "{name}: {most:?}");
        assert!(most[4] < 0.3 * size && most[2] < 0.02, "{name}: {most:?}");
    }
}
