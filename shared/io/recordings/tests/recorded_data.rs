//! Recorded drives of real vehicles, from the file to the reading.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::{Path, PathBuf};

use kerbside_geometry::Pose;
use kerbside_messages::{Message, Raw, Truth, seal};
use kerbside_recordings::drift::{EstimatedPose, drift};
use kerbside_recordings::input::{RawInput, Reference, Source, sources};
use kerbside_recordings::recording::{Provenance, RecordingWriter};
use kerbside_recordings::run_folder::{BASE, Run, runs_of};

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..")
}

fn cases() -> PathBuf {
    repository().join("tests/data/cases")
}

/// Opens every drive of a case, and checks what holds for any.
fn open_all(case: &Path) -> Vec<RawInput> {
    let inputs: Vec<_> = sources(case)
        .unwrap()
        .iter()
        .map(|source| RawInput::open(source, None).unwrap_or_else(|error| panic!("{error}")))
        .collect();
    for input in &inputs {
        let raws: Vec<Raw> = input.raws().unwrap().collect::<Result<_, _>>().unwrap();
        assert!(raws.windows(2).all(|pair| pair[0].arrival <= pair[1].arrival));
        assert!(raws.iter().all(|raw| raw.validate().is_ok()), "{}", input.name());
        assert!(raws.iter().any(|raw| raw.counts_mask | raw.speeds_mask != 0));
        assert!(input.vehicle().text.contains("wheelbase"));
    }
    inputs
}

#[test]
fn a_differential_robot_is_read() {
    let inputs = open_all(&cases().join("optiodom-differential"));
    let [input] = &inputs[..] else { panic!("one run") };
    assert_eq!(input.name(), "ivanjko-2020-12-23-0104-1");
    let raws: Vec<Raw> = input.raws().unwrap().collect::<Result<_, _>>().unwrap();
    assert_eq!(raws.len(), 391);
    assert_eq!((raws[2].header.stamp, raws[2].counts), (BASE + 100_000_000, [0, 0, 0, 29]));
    assert!(raws.iter().all(|raw| raw.counts_mask == 0b1100));
    let Reference::Marker(poses) = input.reference().unwrap() else { panic!("a marker") };
    assert_eq!((poses.len(), poses[2].x, poses[2].yaw), (391, 0.00843, Some(0.02889)));
}

/// Dead reckoning with the nominal wheels. Those who converted the run found 0.5 % and 0.6 degrees
/// at its end, from single poses of a reference that scatters by 1 mm and 0.2 degrees.
#[test]
fn the_drift_of_a_differential_robot_is_what_others_found() {
    let input = &open_all(&cases().join("optiodom-differential"))[0];
    let Reference::Marker(references) = input.reference().unwrap() else { panic!("a marker") };
    let per_count = core::f64::consts::PI * 0.084 / 2796.8;
    let mut estimate = EstimatedPose::default();
    let mut last = [0; 4];
    let mut estimates = Vec::new();
    for raw in input.raws().unwrap().map(Result::unwrap) {
        let rolled = |wheel: usize| (raw.counts[wheel] - last[wheel]) as f64 * per_count;
        let (left, right) = (rolled(2), rolled(3));
        let way = 0.5 * (left + right);
        estimate.pose = estimate.pose.advance(way, (right - left) / 0.2);
        estimate.distance += way.abs();
        estimate.stamp = raw.arrival;
        estimates.push(estimate);
        last = raw.counts;
    }
    let drift = drift(&estimates, &references, &Pose::default()).unwrap();
    let percent = 100.0 * drift.end_error.distance() / drift.distance;
    assert!((drift.distance - 2.0).abs() < 0.02, "{drift:?}");
    assert!((percent - 0.5).abs() < 0.1, "{percent} of {drift:?}");
    assert!((drift.end_error.yaw.to_degrees() - 0.6).abs() < 0.25, "{drift:?}");
    assert_eq!(drift.window, 1.0);
}

#[test]
fn a_car_with_every_sensor_is_read() {
    let inputs = open_all(&cases().join("paper-1-6"));
    let raws: Vec<Raw> = inputs[0].raws().unwrap().collect::<Result<_, _>>().unwrap();
    let count = |has: fn(&Raw) -> bool| raws.iter().filter(|raw| has(raw)).count();
    assert!(count(|raw| raw.counts_mask == 0xf) > 150);
    assert!(count(|raw| raw.has_steering == 1) > 75);
    assert!(count(|raw| raw.has_yaw_rate == 1) > 120);
    assert!(inputs[0].run().unwrap().commands.is_some());
}

#[test]
fn real_drives_survive_writing_and_reading() {
    for case in ["optiodom-differential", "paper-1-6"] {
        let folder = &runs_of(&cases().join(case)).unwrap()[0];
        let run = Run::read(folder).unwrap();
        let made = tempfile::tempdir().unwrap();
        let copy = made.path().join(folder.file_name().unwrap());
        run.write(&copy).unwrap();
        assert_eq!(Run::read(&copy).unwrap(), run);
    }
}

#[test]
fn a_recording_gives_the_readings_it_was_made_of() {
    let inputs = open_all(&cases().join("paper-1-6"));
    let raws: Vec<Raw> = inputs[0].raws().unwrap().collect::<Result<_, _>>().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slalom.mcap");
    let vehicle = Some(inputs[0].vehicle().text.clone());
    let provenance = Provenance { vehicle, ..Provenance::default() };
    let mut writer = RecordingWriter::create(&path, &provenance, BASE).unwrap();
    let mut sent = Vec::new();
    for (index, raw) in raws.iter().enumerate() {
        let mut raw = *raw;
        let sent_at = raw.arrival;
        seal(&mut raw, &[], 1, index as u64 + 1, sent_at);
        writer.write_message(&raw, &[], raw.arrival).unwrap();
        let mut truth = Truth { x: index as f64, yaw: 0.5, ..Truth::default() };
        truth.header.stamp = raw.arrival / 10 * 10;
        writer.write_message(&truth, &[], raw.arrival).unwrap();
        sent.push(raw);
    }
    writer.finish().unwrap();

    let opened = sources(&path).unwrap();
    assert_eq!(opened, [Source::Recording(path.clone())]);
    let input = RawInput::open(&opened[0], None).unwrap();
    assert_eq!((input.name(), &input.vehicle().text), ("slalom", &inputs[0].vehicle().text));
    let read: Vec<Raw> = input.raws().unwrap().collect::<Result<_, _>>().unwrap();
    assert_eq!(read, sent);
    let Reference::Truth(poses) = input.reference().unwrap() else { panic!("truth") };
    assert!(poses.windows(2).all(|pair| pair[0].stamp < pair[1].stamp));
    assert_eq!((poses[0].x, poses[0].yaw), (0.0, Some(0.5)));
}

#[test]
fn what_cannot_be_replayed_is_said() {
    let made = tempfile::tempdir().unwrap();
    let nothing = sources(made.path()).unwrap_err().to_string();
    assert!(nothing.ends_with(
        ": nothing to replay; allowed: a run folder, a case folder with runs/, or an .mcap \
         recording"
    ));
    let run = Run::read(&runs_of(&cases().join("paper-1-6")).unwrap()[0]).unwrap();
    let folder = made.path().join("runs/slalom-1");
    run.write(&folder).unwrap();
    let source = &sources(made.path()).unwrap()[0];
    let error = RawInput::open(source, None).unwrap_err().to_string();
    assert!(error.contains(": no description of the vehicle: "), "{error}");
    let given = cases().join("paper-1-6/vehicle.toml");
    let input = RawInput::open(source, Some(&given)).unwrap();
    assert_eq!(input.vehicle().origin, given);
    let recording = made.path().join("bare.mcap");
    RecordingWriter::create(&recording, &Provenance::default(), 1).unwrap().finish().unwrap();
    let source = Source::Recording(recording);
    let error = RawInput::open(&source, None).unwrap_err().to_string();
    assert!(error.contains("attachment vehicle.toml is not there; give one"), "{error}");
    assert_eq!(
        RawInput::open(&source, Some(&given)).unwrap().reference().unwrap(),
        Reference::None
    );
}

/// Every run of a larger collection, where it is on this machine.
#[test]
fn collections_beside_the_repository_are_read() {
    let collections = repository().join("../shared/data");
    if !collections.is_dir() {
        eprintln!("skipped: {} is not there", collections.display());
        return;
    }
    let mut drives = 0;
    for collection in ["real", "practice"] {
        for entry in std::fs::read_dir(collections.join(collection)).unwrap() {
            let case = entry.unwrap().path();
            if case.join("vehicle.toml").is_file() {
                drives += open_all(&case).len();
            }
        }
    }
    assert!(drives > 34, "{drives} drives");
}
