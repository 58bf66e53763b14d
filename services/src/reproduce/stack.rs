//! The parking scenes by the whole stack: in lockstep, and through the real processes where asked.

use std::path::Path;

use kerbside_reports::StackParking;

use crate::exit::Failure;
use crate::lockstep::Schedule;
use crate::output;
use crate::park::{self, ParkArgs};

/// The scenes of the paper's Table 3, and the same again full size.
const SCENES: [&str; 4] = ["garage", "parallel", "garage-full-size", "parallel-full-size"];

/// Parks each scene `runs` times in lockstep, and once through processes where `processes` says so.
///
/// # Errors
/// [`Failure`] where the configuration is refused or the stack cannot run.
pub fn park(
    seed: u64,
    runs: u32,
    processes: bool,
    folder: &Path,
) -> Result<Vec<StackParking>, Failure> {
    let mut lines = Vec::new();
    for scene in SCENES {
        lines.push(one_scene(scene, true, (seed, runs), folder)?);
        if processes {
            lines.push(one_scene(scene, false, (seed, 1), folder)?);
        }
    }
    Ok(lines)
}

fn one_scene(
    scene: &str,
    lockstep: bool,
    (seed, runs): (u64, u32),
    folder: &Path,
) -> Result<StackParking, Failure> {
    let mode = if lockstep { "in lockstep" } else { "as processes" };
    let mut line = StackParking {
        scene: scene.to_owned(),
        mode: mode.to_owned(),
        ends: Vec::new(),
        parked: 0,
        causes: Vec::new(),
    };
    let args =
        ParkArgs { lockstep, seed, runs, log: Some("warn".to_owned()), ..ParkArgs::of(scene) };
    for index in 0..runs {
        let seed = seed + u64::from(index);
        let folder =
            folder.join(format!("{scene}-{}-{seed}", if lockstep { "lockstep" } else { "live" }));
        let job = park::job(&args, seed, &folder)?;
        let run = if lockstep {
            park::simulated::run(&job, Schedule::default())?
        } else {
            output::make(&folder)?;
            park::run_live(&job)?
        };
        let verdict = park::judge::judge(&run.trace, &job.scenario, &job.service.vehicle, run.end);
        line.parked += usize::from(verdict.parked);
        line.ends.push(verdict.end_error);
        if !verdict.parked {
            line.causes.push(verdict.cause);
        }
    }
    Ok(line)
}
