//! Fuzzing: whatever a run folder or a recording holds, it is read or refused by name, and nothing of it is made up.

// A test may end loudly.
#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../../../../tests/common_fuzz/mod.rs"]
mod common_fuzz;

use std::fs;
use std::path::Path;

use kerbside_messages::topics::TABLE;
use kerbside_messages::{
    Message, Nanos, Odometry, Plan, Raw, State, Topic, TrajectoryPoint, Truth, seal,
};
use kerbside_recordings::input::{RawInput, Source};
use kerbside_recordings::recording::{
    Chunks, Provenance, RecordingReader, RecordingWriter, check, recover,
};
use kerbside_recordings::run_folder::Run;

use common_fuzz::{corpus, damaged};

const FILES: [&str; 7] = [
    "run.toml",
    "encoders.csv",
    "wheels.csv",
    "steering.csv",
    "imu.csv",
    "commands.csv",
    "reference.csv",
];

/// A run in good order, a file each, and the corpus.
fn files() -> Vec<Vec<u8>> {
    let good: [&str; 7] = [
        "name = \"run\"\nmanoeuvre = \"slalom\"\n",
        "t,fl,fr,rl,rr\n0.01,776,727,175,223\n0.03,776,728,176,223\n0.05,790,731,180,240\n",
        "t,fl,fr,rl,rr\n0.01,0.1,0.1,0.1,0.1\n0.03,0.2,,0.2,0.2\n",
        "t,angle\n0.009,-0.004\n0.047,-0.0025\n",
        "t,yaw_rate\n0.0083,0.0044\n0.0337,-0.0008\n",
        "t,speed,steering\n0.0023,0.0,0.0\n0.0527,0.1,0.2\n",
        "t,x,y,yaw\n0.0126,0.1765,-1.1175,1.9402\n0.0529,0.1767,-1.1176,1.939\n",
    ];
    let good = good.iter().map(|text| text.as_bytes().to_vec());
    good.chain(corpus(env!("CARGO_MANIFEST_DIR"), "run_folders")).collect()
}

/// The run whose file number `which` is `bytes`.
fn examine_run(folder: &Path, good: &[Vec<u8>], which: usize, bytes: &[u8]) {
    for (place, file) in FILES.iter().enumerate() {
        let content = if place == which { bytes } else { &good[place] };
        fs::write(folder.join(file), content).unwrap();
    }
    match Run::read(folder) {
        Ok(run) => {
            let mut last = (0, 0);
            for raw in run.raws() {
                assert_eq!(raw.validate(), Ok(()), "{raw:?}");
                let now = (raw.arrival, raw.header.stamp);
                assert!(now.0 >= last.0, "{last:?} {raw:?}");
                last = now;
            }
            run.notices().iter().for_each(|notice| assert!(!notice.is_empty()));
            // What was read is written as something that reads the same.
            let beside = folder.with_file_name("again").join("run");
            run.write(&beside).unwrap();
            assert!(Run::read(&beside).is_ok());
            fs::remove_dir_all(&beside).unwrap();
        }
        Err(error) => {
            let words = error.to_string();
            assert!(words.contains(FILES[which]) || words.contains("run"), "{words}");
        }
    }
    let source = Source::Run(folder.to_owned());
    if let Ok(input) = RawInput::open(&source, None) {
        let _ = (input.notices(), input.reference());
    }
}

#[test]
fn run_folders() {
    let case = tempfile::tempdir().unwrap();
    let folder = case.path().join("runs").join("run");
    fs::create_dir_all(&folder).unwrap();
    fs::write(case.path().join("vehicle.toml"), VEHICLE).unwrap();
    let examples = files();
    for (which, example) in examples.iter().enumerate() {
        examine_run(&folder, &examples, which % FILES.len(), example);
    }
    bolero::check!().for_each(|bytes: &[u8]| {
        let which = bytes.first().map_or(0, |first| usize::from(*first) % FILES.len());
        examine_run(&folder, &examples, which, bytes);
        examine_run(&folder, &examples, which, &damaged(&examples, bytes));
    });
}

const VEHICLE: &str = include_str!("../../../../config/vehicles/paper-1-6.toml");

/// A small recording in chunks of a few messages.
fn recording(compressed: bool, complete: bool) -> Vec<u8> {
    let mut sink = Vec::new();
    let provenance = Provenance {
        vehicle: Some(VEHICLE.to_owned()),
        scenario: Some("garage".to_owned()),
        ..Provenance::default()
    };
    let chunks = Chunks { bytes: 4096, compressed };
    let mut writer = RecordingWriter::in_chunks(&mut sink, &provenance, 1, chunks).unwrap();
    for sequence in 1..8 {
        let stamp: Nanos = sequence * 5_000_000;
        let mut raw = Raw { arrival: stamp, counts_mask: 0xf, ..Raw::default() };
        raw.header.stamp = stamp;
        seal(&mut raw, &[], 1, sequence, stamp);
        writer.write_message(&raw, &[], stamp).unwrap();
        let mut odometry = Odometry::default();
        seal(&mut odometry, &[], 1, sequence, stamp);
        writer.write_message(&odometry, &[], stamp).unwrap();
    }
    let points = [0.0, 0.1, 0.2].map(|time| TrajectoryPoint { time, ..Default::default() });
    let tail: &[u8] = bytemuck::cast_slice(&points);
    let mut plan = Plan { points: 3, interval: 0.1, ..Plan::default() };
    seal(&mut plan, tail, 1, 1, 1);
    writer.write_message(&plan, tail, 40_000_000).unwrap();
    writer.close_chunk().unwrap();
    if complete {
        writer.finish().unwrap();
    }
    drop(writer);
    if !complete {
        sink.truncate(sink.len() - 700);
    }
    sink
}

fn examine_recording(folder: &Path, bytes: &[u8]) {
    let (path, whole) = (folder.join("some.mcap"), folder.join("whole.mcap"));
    fs::write(&path, bytes).unwrap();
    let report = check(&path);
    if let Ok(reader) = RecordingReader::open(&path) {
        let topics: Vec<&Topic> = TABLE.iter().collect();
        if let Ok(mut records) = reader.records(&topics) {
            while let Ok(Some(record)) = records.next() {
                let _ = (record.decode::<State>(), record.decode::<Truth>());
            }
        }
        let _ = reader.for_each_plan(|plan, points| {
            let _ = plan.validate_points(points);
        });
        if let Ok(input) = RawInput::open(&Source::Recording(path.clone()), None) {
            let _ = input.reference();
            if let Ok(raws) = input.raws() {
                raws.take_while(Result::is_ok).for_each(drop);
            }
        }
    }
    match recover(&path, &whole) {
        // What was recovered is sound in itself, and holds no more than there was.
        Ok(_) => {
            let recovered = check(&whole).unwrap();
            assert!(recovered.damage.is_empty(), "{:?}", recovered.damage);
            if let Ok(report) = &report {
                assert!(recovered.messages() <= report.messages() + report.bytes / 22);
            }
            fs::remove_file(&whole).unwrap();
        }
        Err(_) => assert!(!whole.exists(), "a half-made file is left"),
    }
    if let Ok(report) = report {
        assert!(report.is_sound() || !report.problems().is_empty());
    }
}

#[test]
fn recordings() {
    let folder = tempfile::tempdir().unwrap();
    let mut examples = vec![recording(true, true), recording(false, true), recording(false, false)];
    examples.extend(corpus(env!("CARGO_MANIFEST_DIR"), "recordings"));
    examples.iter().for_each(|example| examine_recording(folder.path(), example));
    let folder = folder.path().to_owned();
    bolero::check!().for_each(|bytes: &[u8]| {
        examine_recording(&folder, bytes);
        examine_recording(&folder, &damaged(&examples, bytes));
    });
}
