//! `bench replay`: how much faster than real time recorded readings go through ingest and estimator.

use std::path::{Path, PathBuf};

use kerbside_geometry::{Pose, Vehicle};
use kerbside_messages::{Header, Raw, nanos, seal};
use kerbside_recordings::recording::{Provenance, RecordingWriter};
use kerbside_recordings::run_folder::{BASE, CountRow, Run, RunFile, SteeringRow, Table, stamp_of};
use kerbside_simulation::{Noise, Simulator};
use serde_json::json;

use super::rows::{Told, tell};
use super::statistics::median;
use crate::configuration;
use crate::exit::{Exit, Failure};
use crate::figures::Figure;
use crate::output;
use crate::replay::{Speeds, speeds_of};

/// Readings per second of the generated drive.
const RATE: u32 = 200;
/// The limits: drive time over processing time.
const FROM_MEMORY: f64 = 5000.0;
const FROM_FILES: f64 = 1000.0;

/// What `bench replay` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct ReplayBenchArgs {
    /// Length of the generated drive.
    #[arg(long, value_name = "MINUTES", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    minutes: u32,
    /// How often each is measured; the median counts.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,
    /// Folder for the generated drive; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the drive cannot be written or replayed.
pub fn run(args: &ReplayBenchArgs) -> Result<Exit, Failure> {
    let folder = output::folder(args.out.as_deref(), "bench-replay")?;
    let drive = Drive::generate(args.minutes)?;
    let kinds =
        [("recording", drive.write_recording(&folder)?), ("run folder", drive.write_run(&folder)?)];
    let (mut figures, mut notes, mut measured) = (Vec::new(), Vec::new(), Vec::new());
    for (kind, path) in kinds {
        let speeds =
            (0..args.repeats).map(|_| speeds_of(&path)).collect::<Result<Vec<Speeds>, _>>()?;
        let of = |pick: fn(&Speeds) -> f64| median(speeds.iter().map(pick).collect());
        let (files, memory) = (of(|speeds| speeds.files), of(|speeds| speeds.memory));
        let name = |from: &str| format!("{kind}, from {from} [x real time]");
        figures.push(Figure::at_least(&name("memory"), memory, FROM_MEMORY));
        figures.push(Figure::at_least(&name("files"), files, FROM_FILES));
        notes.push(format!("{kind}: {}", path.display()));
        measured.push(json!({ "kind": kind, "path": path, "files": files, "memory": memory }));
    }
    notes.push(
        "memory: ingest, estimator and the checks between them, readings in memory; files: all from \
         opening the input to the hash of the odometry"
            .to_owned(),
    );
    notes.push(format!("{} min of four wheels and steering at {RATE} Hz", args.minutes));
    let more = json!({ "minutes": args.minutes, "repeats": args.repeats, "replays": measured });
    Ok(tell(&Told { verb: "replay", rows: Vec::new(), figures, notes, more }, args.json))
}

/// A generated drive: a slalom that stops, turns back and goes on.
struct Drive {
    vehicle_text: String,
    raws: Vec<Raw>,
    times: Vec<f64>,
}

impl Drive {
    fn generate(minutes: u32) -> Result<Self, Failure> {
        let stack = configuration::stack(None, Some("paper-1-6"))?;
        let count = minutes * 60 * RATE;
        let times: Vec<f64> = (0..count).map(|index| f64::from(index) / f64::from(RATE)).collect();
        let mut simulator = Simulator::new(&stack.vehicle, Pose::default(), &Noise::default(), 1);
        let raws = times.iter().map(|time| read(&mut simulator, &stack.vehicle, *time)).collect();
        Ok(Self { vehicle_text: stack.vehicle_text, raws, times })
    }

    fn write_recording(&self, folder: &Path) -> Result<PathBuf, Failure> {
        let path = folder.join("drive.mcap");
        let vehicle = Some(self.vehicle_text.clone());
        let provenance = Provenance { vehicle, ..Provenance::default() };
        let mut writer =
            RecordingWriter::create(&path, &provenance, BASE).map_err(Failure::internal)?;
        for (index, raw) in (1..).zip(&self.raws) {
            let mut sealed = *raw;
            seal(&mut sealed, &[], 1, index, raw.arrival);
            writer.write_message(&sealed, &[], raw.arrival).map_err(Failure::internal)?;
        }
        writer.finish().map_err(Failure::internal)?;
        Ok(path)
    }

    fn write_run(&self, folder: &Path) -> Result<PathBuf, Failure> {
        let path = folder.join("case/runs/drive");
        let timed = || self.times.iter().zip(&self.raws);
        let counts = timed().map(|(t, raw)| CountRow { t: *t, counts: raw.counts, mask: 0xf });
        let angles = timed().map(|(t, raw)| SteeringRow { t: *t, angle: Some(raw.steering) });
        let run = Run {
            about: RunFile::new("drive"),
            encoders: Some(Table::new(counts.collect(), 0xf)),
            wheels: None,
            steering: Some(Table::new(angles.collect(), 1)),
            gyro: None,
            commands: None,
            reference: None,
        };
        run.write(&path).map_err(Failure::internal)?;
        output::write(&folder.join("case/vehicle.toml"), &self.vehicle_text)?;
        Ok(path)
    }
}

/// Drives on to `time`; what the sensors say then.
fn read(simulator: &mut Simulator, vehicle: &Vehicle, time: f64) -> Raw {
    let (speed, steering) = asked(vehicle, time);
    simulator.command(time, speed, steering);
    simulator.advance(time);
    let reading = simulator.reading();
    let stamp = stamp_of(time);
    Raw {
        header: Header::stamped(stamp, stamp),
        vehicle_time: BASE + nanos(time),
        arrival: stamp,
        counts: reading.counts,
        counts_mask: reading.counts_mask,
        steering: reading.steering.unwrap_or(0.0),
        has_steering: u8::from(reading.steering.is_some()),
        boot: 1,
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // far below 2^32
        frame: 1 + (time * f64::from(RATE)).round() as u32,
        ..Raw::default()
    }
}

/// Half a minute forwards in a slalom with a stop, half a minute back.
fn asked(vehicle: &Vehicle, time: f64) -> (f64, f64) {
    let phase = time % 60.0;
    let speed = match phase {
        0.0..25.0 => 0.6,
        30.0..55.0 => -0.6,
        _ => 0.0,
    };
    let swing = kerbside_geometry::math::sin(time * 0.7);
    (speed * vehicle.limits.speed, 0.8 * vehicle.limits.steering * swing)
}
