//! The stack that is soaked: started, looked at, and started anew where it was lost.

use std::ffi::OsString;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use kerbside_geometry::Pose;
use kerbside_messages::{Fix, Header, Nanos, Process, State, Truth, text};
use kerbside_runtime::{FileLock, Instance, Session, now};
use kerbside_settings::Disturbance;
use rustix::process::{Pid, Resource, Rlimit, prlimit};

use super::super::SoakArgs;
use super::flight::{Allowed, Course, Flight};
use crate::children::Children;
use crate::exit::Failure;
use crate::lockstep::VICTIMS;
use crate::park::live::Desk;
use crate::park::{self, Job, ParkArgs};
use crate::vehicle::format_pose;

/// A vehicle without a supervisor stands if it has not moved for so long \[ns\].
const STANDS: Nanos = 200_000_000;

/// The manoeuvre that is driven again and again.
///
/// # Errors
/// [`Failure`] where the configuration is refused.
pub fn job(args: &SoakArgs, folder: &Path) -> Result<Job, Failure> {
    let park = ParkArgs {
        seed: args.seed.unwrap_or(1),
        rearm: true,
        config: args.config.clone(),
        instance: Some(args.instance.clone().unwrap_or_else(|| Instance::fresh_name("soak"))),
        log: Some("error".to_owned()),
        ..ParkArgs::of(&args.scenario)
    };
    park::job(&park, park.seed, folder)
}

/// Where a vehicle stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place(Pose);

impl Place {
    /// A pose.
    #[must_use]
    pub fn of(pose: &Pose) -> Self {
        Self(*pose)
    }

    /// Where the vehicle truly is.
    #[must_use]
    pub fn of_truth(truth: &Truth) -> Self {
        Self(Pose::new(truth.x, truth.y, truth.yaw))
    }

    /// The fix that tells the estimator, as certain as a scenario's start.
    #[must_use]
    pub fn fix(&self, disturbance: &Disturbance, now: Nanos) -> Fix {
        let (position, yaw) = (disturbance.known_position.powi(2), disturbance.known_yaw.powi(2));
        Fix {
            header: Header::stamped(now, 0),
            x: self.0.x,
            y: self.0.y,
            yaw: self.0.yaw,
            covariance: [position, 0.0, 0.0, 0.0, position, 0.0, 0.0, 0.0, yaw],
            source: text::from_str("soak"),
            ..Fix::default()
        }
    }
}

/// A running stack with its operator's ports. Ended when dropped, in this order.
pub struct Stack {
    desk: Desk,
    _session: Session,
    children: Children,
    instance: Instance,
    vehicle: u32,
    place: Place,
    /// It is to be started anew.
    pub wants_anew: bool,
}

impl Stack {
    /// Starts supervisor and vehicle, which stands at `place`, and joins.
    ///
    /// # Errors
    /// [`Failure`] where they do not come up.
    pub fn start(job: &Job, place: Place, stop: &AtomicBool) -> Result<Self, Failure> {
        let pose = format_pose(&place.0);
        // Another seed for each vehicle: its noise is to be another one.
        let seed = (now() % 1_000_000_007).to_string();
        let vehicle =
            [OsString::from(format!("--start={pose}")), "--seed".into(), seed.into()].to_vec();
        let mut children = Children::start(&job.service, Some(&vehicle))?;
        let session = children.join(stop)?;
        let desk = Desk::open(&session, job)?;
        let instance = job.service.instance.clone();
        let lock = instance.process_lock(Process::Vehicle);
        let vehicle = FileLock::holder(&lock).unwrap_or(0);
        Ok(Self { desk, _session: session, children, instance, vehicle, place, wants_anew: false })
    }

    /// The operator's ports.
    pub fn desk(&mut self) -> &mut Desk {
        &mut self.desk
    }

    /// Whether the supervisor, and whether the vehicle ended.
    pub fn lost(&mut self) -> (bool, bool) {
        (self.children.supervisor_ended(), self.children.vehicle_ended())
    }

    /// Remembers where the vehicle is.
    pub fn saw(&mut self, truth: Option<&Truth>) {
        if let Some(truth) = truth {
            self.place = Place::of_truth(truth);
        }
    }

    /// Where the vehicle was seen last.
    #[must_use]
    pub fn place(&self) -> Place {
        self.place
    }

    /// The pid of a process; 0 for none.
    #[must_use]
    pub fn pid(&self, process: Process, state: &State) -> u32 {
        match process {
            Process::Supervisor => state.pid,
            Process::Vehicle => self.vehicle,
            other => {
                let row = state.rows().iter().find(|row| row.process == other as u8);
                row.map_or(0, |row| row.pid)
            }
        }
    }

    /// Every process of the stack, as (name, pid).
    #[must_use]
    pub fn processes(&self, state: Option<&State>) -> Vec<(String, u32)> {
        let Some(state) = state else { return Vec::new() };
        let mut all: Vec<(String, u32)> = VICTIMS
            .into_iter()
            .map(|process| (process.name().to_owned(), self.pid(process, state)))
            .collect();
        all.push(("supervisor".to_owned(), state.pid));
        let lock = self.instance.process_lock(Process::Vehicle);
        all.push(("vehicle".to_owned(), FileLock::holder(&lock).unwrap_or(self.vehicle)));
        all
    }
}

/// What became of a fault that took the supervisor or the vehicle: nobody will tell any more.
#[must_use]
pub fn without_supervisor(flight: &mut Flight, now: Nanos, allowed: &Allowed) -> Option<Course> {
    let (distance, time) = allowed.from(flight.fastest);
    let stands = now.saturating_sub(flight.moved.max(flight.at)) > STANDS;
    if flight.blow.must_stop(flight.process)
        && (flight.rolled > distance || flight.stop_time() > time)
    {
        return Some(Course::NotStopped);
    }
    if !stands {
        return None;
    }
    flight.stopped = true;
    if !flight.resumed {
        kerbside_runtime::resume(flight.pid);
        flight.resumed = true;
    }
    Some(Course::Over)
}

/// Lets the files of a process grow by no more than `more` from what they may be; whether that was possible.
#[must_use]
pub fn limit_file_size(pid: u32, more: u64) -> bool {
    let Some(pid) = i32::try_from(pid).ok().and_then(Pid::from_raw) else { return false };
    let limit = Some(more);
    prlimit(Some(pid), Resource::Fsize, Rlimit { current: limit, maximum: limit }).is_ok()
}

/// Whether a process lives in the run-time folder of this one: names of instances are unique there.
fn is_neighbour(pid: u32) -> bool {
    let Ok(environment) = std::fs::read(format!("/proc/{pid}/environ")) else { return false };
    let own = std::env::var_os("XDG_RUNTIME_DIR");
    let mut variables = environment.split(|byte| *byte == 0);
    let theirs = variables.find_map(|variable| variable.strip_prefix(b"XDG_RUNTIME_DIR="));
    theirs == own.as_deref().map(OsStrExt::as_bytes)
}

/// Processes that still name the instance on their command line, as (pid, command line).
#[must_use]
pub fn processes_of(instance: &Instance) -> Vec<(u32, String)> {
    let entries = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    pids.filter(|pid| *pid != std::process::id())
        .filter_map(|pid| {
            let bytes = std::fs::read(format!("/proc/{pid}/cmdline")).ok()?;
            let line = String::from_utf8_lossy(&bytes).replace('\0', " ");
            let named = format!("--instance {} ", instance.name());
            let service = line.contains(" up ") || line.contains(" service ");
            (service && line.contains(&named) && is_neighbour(pid))
                .then(|| (pid, line.trim().to_owned()))
        })
        .collect()
}
