use std::cell::RefCell;
use std::io::{Error, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use kerbside_messages::topics::{PLAN_REQUEST, TABLE};
use kerbside_messages::{
    Heartbeat, Message, Nanos, Plan, Raw, TrajectoryPoint, Travel, Truth, seal,
};
use proptest::prelude::*;
use tempfile::TempDir;

use super::*;

const SECOND: Nanos = 1_000_000_000;

fn provenance() -> Provenance {
    Provenance {
        version: Some("0.1.0".into()),
        instance: Some("garage-1".into()),
        scenario: Some("garage".into()),
        seed: Some(7),
        vehicle: Some("name = \"paper-1-6\"\n".into()),
        stack: Some("rate = 200.0\n".into()),
        further: [("host".to_owned(), "bench".to_owned())].into(),
    }
}

/// Reading `number` of a drive at 200 Hz.
fn raw(number: u64) -> Raw {
    let mut raw = Raw {
        counts: [number as i64 * 17, -3, number as i64, 0],
        counts_mask: 0xf,
        frame: number as u32,
        ..Raw::default()
    };
    raw.header.stamp = SECOND + number * 5_000_000;
    let stamp = raw.header.stamp;
    seal(&mut raw, &[], 1, number, stamp);
    raw
}

fn write_raws<W: Write>(writer: &mut RecordingWriter<W>, numbers: core::ops::Range<u64>) {
    for raw in numbers.map(raw) {
        writer.write_message(&raw, &[], raw.header.stamp).unwrap();
    }
}

/// A folder, and a file in it that does not exist yet.
fn place() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    (folder, path)
}

/// A complete recording of `count` readings.
fn recording(count: u64) -> (TempDir, PathBuf) {
    let (folder, path) = place();
    let mut writer = RecordingWriter::create(&path, &provenance(), 5).unwrap();
    write_raws(&mut writer, 1..count + 1);
    writer.finish().unwrap();
    (folder, path)
}

fn frames(path: &Path) -> Vec<u32> {
    let reader = RecordingReader::open(path).unwrap();
    reader.read_all::<Raw>().unwrap().iter().map(|raw| raw.frame).collect()
}

#[test]
fn what_is_written_is_read_again() {
    let (_folder, path) = place();
    let mut writer = RecordingWriter::create(&path, &provenance(), 5).unwrap();
    let points = [TrajectoryPoint { x: 1.5, ..Default::default() }; 3];
    let mut plan = Plan { points: 3, interval: 0.02, ..Default::default() };
    seal(&mut plan, bytemuck::cast_slice(&points), 1, 1, 9);
    write_raws(&mut writer, 1..1001);
    writer.write_message(&plan, bytemuck::cast_slice(&points), 6 * SECOND).unwrap();
    writer.write_message(&Truth { x: 2.0, ..Default::default() }, &[], 6 * SECOND).unwrap();
    assert_eq!(writer.finish().unwrap().messages, 1002);

    let reader = RecordingReader::open(&path).unwrap();
    assert_eq!(reader.provenance(), &provenance());
    assert_eq!(reader.end(), End::Complete);
    assert_eq!(reader.read_all::<Raw>().unwrap(), (1..1001).map(raw).collect::<Vec<_>>());
    assert_eq!(reader.read_all::<Truth>().unwrap()[0].x, 2.0);
    assert_eq!(reader.read_all::<Travel>().unwrap(), []);
    let mut plans = 0;
    reader
        .for_each_plan(|read, read_points| {
            assert_eq!((*read, read_points), (plan, &points[..]));
            plans += 1;
        })
        .unwrap();
    assert_eq!(plans, 1);
    let mut records = reader.records(&[Raw::TOPIC, Plan::TOPIC]).unwrap();
    let first = records.next().unwrap().unwrap();
    assert_eq!((first.sequence, first.log_time), (1, raw(1).header.stamp));
    assert_eq!(first.decode::<Truth>(), None);
}

#[test]
fn every_recorded_topic_has_a_channel_and_no_other() {
    let (_folder, path) = recording(1);
    let report = check(&path).unwrap();
    assert!(report.is_sound(), "{report:?}");
    let summary = mcap::Summary::read(&std::fs::read(&path).unwrap()).unwrap().unwrap();
    assert_eq!(summary.channels.len(), TABLE.iter().filter(|topic| topic.recorded).count());
    for channel in summary.channels.values() {
        let topic = topic_of(&channel.topic).unwrap();
        assert!(topic.recorded);
        assert_eq!(channel.schema.as_ref().unwrap().encoding, "ros2msg");
        assert_eq!(channel.message_encoding, "cdr");
    }
    let mut writer = RecordingWriter::new(Vec::new(), &provenance(), 0).unwrap();
    let error = writer.write(&PLAN_REQUEST, 0, 0, 1, &[], &[]).unwrap_err();
    assert_eq!(error.to_string(), "topic plan_request is not one that is recorded");
    assert!(!writer.has_failed());
}

#[test]
fn chunks_close_by_size_by_age_and_on_demand() {
    let mut writer = RecordingWriter::new(Vec::new(), &provenance(), 0).unwrap();
    // 200 readings span 0.995 s and stay open; the 201st is a second old.
    write_raws(&mut writer, 1..201);
    assert_eq!(writer.written().chunks, 0);
    let first = raw(1).header.stamp;
    assert!(!writer.close_chunk_if_older(first + SECOND - 1).unwrap());
    assert!(writer.close_chunk_if_older(first + SECOND).unwrap());
    assert!(!writer.close_chunk_if_older(first + 10 * SECOND).unwrap());
    assert_eq!(writer.written().chunks, 1);
    write_raws(&mut writer, 201..402);
    assert_eq!(writer.written().chunks, 2);
    // Heartbeats of one instant: only their size closes.
    let beats = CHUNK_BYTES / size_of::<Heartbeat>() + 1;
    for _ in 0..beats {
        writer.write_message(&Heartbeat::default(), &[], 3 * SECOND).unwrap();
    }
    assert_eq!(writer.written().chunks, 3);
}

#[test]
fn chunks_are_as_large_and_as_packed_as_asked_for() {
    let size = |chunks: Chunks| {
        let (_folder, path) = place();
        let mut writer =
            RecordingWriter::create_in_chunks(&path, &provenance(), 5, chunks).unwrap();
        write_raws(&mut writer, 1..101);
        let closed = writer.finish().unwrap();
        assert_eq!(frames(&path), (1..101).collect::<Vec<_>>());
        (closed.chunks, check(&path).unwrap().bytes)
    };
    let small = size(Chunks { bytes: 4096, compressed: true });
    let large = size(Chunks { bytes: CHUNK_BYTES, compressed: true });
    let loose = size(Chunks { bytes: CHUNK_BYTES, compressed: false });
    assert!(small.0 > large.0 && large.0 == loose.0, "{small:?} {large:?} {loose:?}");
    assert!(large.1 < loose.1, "{large:?} {loose:?}");
}

#[test]
fn a_killed_recorder_leaves_its_closed_chunks() {
    let (folder, path) = place();
    let mut writer = RecordingWriter::create(&path, &provenance(), 5).unwrap();
    write_raws(&mut writer, 1..1000);
    let closed = (writer.written().chunks * 201) as u32;
    assert!(closed > 500);
    // The writer lives: what the file holds now is what a kill would leave.
    assert_eq!(frames(&path), (1..=closed).collect::<Vec<_>>());
    let report = check(&path).unwrap();
    assert_eq!((report.end, report.damage.len()), (End::Unfinished, 0));
    assert_eq!(report.problems(), ["ends without a footer"]);
    assert_eq!(report.provenance, provenance());

    let out = folder.path().join("recovered.mcap");
    let recovered = recover(&path, &out).unwrap();
    assert_eq!((recovered.messages, recovered.from_torn_chunk), (u64::from(closed), 0));
    assert!(check(&out).unwrap().is_sound());
    assert_eq!(frames(&out), frames(&path));
    assert_eq!(check(&out).unwrap().provenance, provenance());
    let again = recover(&path, &out).unwrap_err().to_string();
    assert_eq!(again, format!("{}: exists already and is not overwritten", out.display()));
}

#[test]
fn a_fresh_recording_is_readable_before_its_first_message() {
    let (_folder, path) = place();
    let writer = RecordingWriter::create(&path, &provenance(), 5).unwrap();
    let report = check(&path).unwrap();
    assert_eq!((report.messages(), report.time), (0, None));
    assert_eq!(report.provenance, provenance());
    assert_eq!(report.mismatches, []);
    let error = RecordingWriter::create(&path, &provenance(), 5).map(|_| ()).unwrap_err();
    assert!(matches!(error, WriteError::Io(_)), "{error}");
    drop(writer);
}

#[test]
fn of_a_torn_chunk_whole_messages_are_recovered() {
    let (folder, path) = place();
    let mut writer = RecordingWriter::create(&path, &provenance(), 5).unwrap();
    write_raws(&mut writer, 1..202);
    assert_eq!(writer.written().chunks, 1);
    let start = std::fs::metadata(&path).unwrap().len();
    // Messages of one instant stay in one chunk of several compressed blocks.
    for number in 202..1200 {
        writer.write_message(&raw(number), &[], 3 * SECOND).unwrap();
    }
    writer.close_chunk().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let end = start as usize + (bytes.len() - start as usize) / 2;
    std::fs::write(&path, &bytes[..end]).unwrap();

    let report = check(&path).unwrap();
    assert_eq!(report.end, End::Torn { offset: start });
    assert_eq!(report.problems(), [format!("byte {start}: ends within this record")]);
    assert_eq!(frames(&path), (1..202).collect::<Vec<_>>());
    let out = folder.path().join("recovered.mcap");
    let recovered = recover(&path, &out).unwrap();
    assert!(recovered.from_torn_chunk > 100, "{recovered:?}");
    assert_eq!(recovered.messages, 201 + recovered.from_torn_chunk);
    assert_eq!(frames(&out), (1..=recovered.messages as u32).collect::<Vec<_>>());
    assert!(check(&out).unwrap().is_sound());
}

/// The records of a file: kind, offset, length with head.
fn layout(bytes: &[u8]) -> Vec<(u8, usize, usize)> {
    let mut places = Vec::new();
    let mut offset = 8;
    while offset + 9 <= bytes.len() {
        let length = u64::from_le_bytes(bytes[offset + 1..offset + 9].try_into().unwrap());
        places.push((bytes[offset], offset, length as usize + 9));
        offset += length as usize + 9;
    }
    places
}

#[test]
fn a_damaged_chunk_is_named_and_left_out() {
    let (folder, path) = recording(1000);
    let mut bytes = std::fs::read(&path).unwrap();
    let chunks: Vec<_> = layout(&bytes).into_iter().filter(|place| place.0 == 6).collect();
    let (_, offset, length) = chunks[2];
    bytes[offset + length - 100] ^= 0x40;
    std::fs::write(&path, &bytes).unwrap();

    let error = RecordingReader::open(&path).unwrap().read_all::<Raw>().unwrap_err().to_string();
    let expected = format!("{}: byte {offset}: ", path.display());
    assert!(error.starts_with(&expected), "{error}");
    let report = check(&path).unwrap();
    assert_eq!(report.damage.len(), 2, "the chunk, and the sum over all data: {report:?}");
    assert_eq!(report.damage[0].offset, offset as u64);
    assert_eq!(report.end, End::Complete);

    let out = folder.path().join("recovered.mcap");
    let recovered = recover(&path, &out).unwrap();
    assert_eq!(recovered.lost, report.damage[..1]);
    assert_eq!(recovered.messages, 1000 - 201);
    assert!(check(&out).unwrap().is_sound());
}

#[test]
fn lost_definitions_are_made_good_by_the_index() {
    let (folder, path) = recording(500);
    let mut bytes = std::fs::read(&path).unwrap();
    let first = layout(&bytes).into_iter().find(|place| place.0 == 6).unwrap();
    bytes[first.1 + 80] ^= 1;
    std::fs::write(&path, &bytes).unwrap();
    let out = folder.path().join("recovered.mcap");
    let recovered = recover(&path, &out).unwrap();
    assert_eq!((recovered.messages, recovered.unnamed), (500, 0));
    assert_eq!(frames(&out), (1..501).collect::<Vec<_>>());
}

#[test]
fn another_layout_is_named_with_its_version() {
    let (_folder, path) = place();
    let file = std::fs::File::create(&path).unwrap();
    let mut container = super::writer::container(file, Chunks::default()).unwrap();
    let schema = container.add_schema("kerbside/msg/Raw", "ros2msg", b"uint8 x").unwrap();
    let version = [("layout_version".to_owned(), "9".to_owned())].into();
    let channel = container.add_channel(schema, "/kerbside/raw", "cdr", &version).unwrap();
    let foreign = container.add_channel(0, "/camera", "jpeg", &Default::default()).unwrap();
    for channel_id in [foreign, channel] {
        let header =
            mcap::records::MessageHeader { channel_id, sequence: 1, log_time: 1, publish_time: 1 };
        container.write_to_known_channel(&header, &[0, 1, 0, 0, 7]).unwrap();
    }
    container.finish().unwrap();

    let report = check(&path).unwrap();
    assert!(!report.is_sound() && report.damage.is_empty());
    let ours = kerbside_messages::LAYOUT_VERSION;
    let problem = format!("topic raw: layout version 9; this build reads {ours}");
    assert_eq!(report.problems(), [problem]);
    assert_eq!(report.messages(), 2);
    let error = RecordingReader::open(&path).unwrap().read_all::<Raw>().unwrap_err().to_string();
    assert_eq!(
        error,
        format!(
            "{}: topic raw was recorded in layout version 9; this build reads version {ours}",
            path.display()
        )
    );
    assert_eq!(RecordingReader::open(&path).unwrap().read_all::<Truth>().unwrap(), []);
}

#[test]
fn what_is_no_recording_is_refused() {
    let (_folder, path) = place();
    let open = || RecordingReader::open(&path).unwrap_err().to_string();
    assert!(open().ends_with("No such file or directory (os error 2)"));
    for bytes in [&b""[..], b"t,fl\n0,1\n"] {
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(open(), format!("{}: byte 0: not an MCAP file", path.display()));
    }
}

/// A disk that is full after `room` bytes, and remembers what it took.
#[derive(Clone)]
struct Disk {
    taken: Rc<RefCell<Vec<u8>>>,
    room: usize,
    error: i32,
}

impl Disk {
    fn with(room: usize, error: i32) -> Self {
        Self { taken: Rc::default(), room, error }
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut taken = self.taken.borrow_mut();
        let length = bytes.len().min(self.room - taken.len());
        if length == 0 && !bytes.is_empty() {
            return Err(Error::from_raw_os_error(self.error));
        }
        taken.extend_from_slice(&bytes[..length]);
        Ok(length)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

const ENOSPC: i32 = 28;
const EFBIG: i32 = 27;

#[test]
fn a_full_disk_ends_the_recording_and_nothing_else() {
    let whole = Disk::with(usize::MAX, ENOSPC);
    let mut writer = RecordingWriter::new(whole.clone(), &provenance(), 5).unwrap();
    let begun = whole.taken.borrow().len();
    write_raws(&mut writer, 1..1001);
    writer.finish().unwrap();
    drop(writer);
    let length = whole.taken.borrow().len();
    let (folder, path) = place();
    for room in (0..length).step_by(797) {
        let disk = Disk::with(room, ENOSPC);
        let made = RecordingWriter::new(disk.clone(), &provenance(), 5);
        assert_eq!(made.is_ok(), room >= begun, "room {room} of {begun}");
        let Ok(mut writer) = made else { continue };
        let mut results =
            (1..1001).map(raw).map(|raw| writer.write_message(&raw, &[], raw.header.stamp));
        let error = results.find_map(Result::err);
        let refused: Vec<_> = results.filter_map(Result::err).collect();
        assert!(refused.iter().all(|error| matches!(error, WriteError::Failed)), "{refused:?}");
        let error = error.unwrap_or_else(|| writer.finish().unwrap_err());
        assert!(matches!(error, WriteError::DiskFull(_)), "{error}");
        assert!(writer.has_failed());
        assert!(matches!(
            writer.close_chunk_if_older(u64::MAX),
            Err(WriteError::Failed) | Ok(false)
        ));
        assert!(matches!(writer.finish(), Err(WriteError::Failed)));
        drop(writer);
        // What had reached the disk is readable, and is the beginning of the drive.
        std::fs::write(&path, &*disk.taken.borrow()).unwrap();
        let frames = frames(&path);
        assert_eq!(frames, (1..=frames.len() as u32).collect::<Vec<_>>());
        let out = folder.path().join("recovered.mcap");
        assert!(recover(&path, &out).unwrap().messages >= frames.len() as u64);
        assert!(check(&out).unwrap().is_sound());
        std::fs::remove_file(&out).unwrap();
    }
}

#[test]
fn a_limit_on_the_files_size_is_told_apart() {
    let mut writer = RecordingWriter::new(Disk::with(60_000, EFBIG), &provenance(), 5).unwrap();
    let error = (1..100_000)
        .find_map(|number| writer.write_message(&raw(number), &[], raw(number).header.stamp).err());
    let error = error.unwrap();
    assert!(matches!(error, WriteError::FileTooLarge(_)), "{error}");
    assert!(error.to_string().starts_with("the file has reached the largest size allowed"));
}

#[test]
fn a_complete_recording_takes_no_more() {
    let mut writer = RecordingWriter::new(Vec::new(), &provenance(), 0).unwrap();
    writer.finish().unwrap();
    let error = writer.write_message(&raw(1), &[], 1).unwrap_err();
    assert!(matches!(error, WriteError::Complete), "{error}");
    assert!(!writer.has_failed());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_damage_makes_reading_panic_or_lie(
        flips in prop::collection::vec((0.0..1.0, 0_u8..8), 1..6),
        cut in 0.0..1.2,
    ) {
        let (folder, path) = recording(450);
        let mut bytes = std::fs::read(&path).unwrap();
        for (place, bit) in flips {
            let index = (place * bytes.len() as f64) as usize;
            bytes[index] ^= 1 << bit;
        }
        bytes.truncate((cut * bytes.len() as f64) as usize);
        std::fs::write(&path, &bytes).unwrap();
        if let Ok(report) = check(&path) {
            let out = folder.path().join("recovered.mcap");
            let recovered = recover(&path, &out).unwrap();
            prop_assert!(recovered.messages + recovered.unnamed >= report.messages());
        }
        if let Ok(reader) = RecordingReader::open(&path) {
            let mut read = Vec::new();
            let _ = reader.for_each(|raw: &Raw| read.push(*raw));
            prop_assert!(read.iter().all(|read| *read == raw(u64::from(read.frame))));
        }
    }
}
