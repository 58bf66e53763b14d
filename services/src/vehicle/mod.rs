//! The simulated vehicle: a process outside the supervised set that speaks the same line as a real one.
//!
//! It makes a pseudo-terminal, links its line end in the instance's folder, and drives on its own clock whether
//! anybody listens or not. Topics out: `truth`, while there is a supervisor.

pub(crate) mod plant;
pub mod pty;
mod reporter;
mod stage;

use std::os::fd::AsFd;
use std::sync::atomic::Ordering;

use kerbside_geometry::{Pose, angle};
use kerbside_messages::{Nanos, Process, Truth};
use kerbside_runtime::{FileLock, Instance, LockError, Ticker, now, poll_readable};

pub use plant::{Plant, PlantArgs};
pub use stage::{Making, VehicleStage};

use crate::exit::{Exit, Failure};
use crate::life::{self, stop_flag};
use crate::service::{Service, ServiceArgs};
use pty::Pty;
use reporter::Reporter;

/// A pause of the process longer than this stops the vehicle's time: it was stopped, not late \[ns\].
pub(crate) const PAUSE: Nanos = 250_000_000;

/// A vehicle that belongs to a stack ends once there was no supervisor for so long \[ns\].
const ABANDONED: Nanos = 60_000_000_000;
/// Time between looks for the supervisor \[ns\].
const LOOK: Nanos = 1_000_000_000;

/// What the simulated vehicle is started with.
#[derive(Clone, Debug, clap::Args)]
pub struct VehicleArgs {
    /// Instance and configuration.
    #[command(flatten)]
    pub service: ServiceArgs,
    /// Where it stands at first: x and y in metres, yaw in degrees.
    #[arg(long, value_name = "X,Y,YAW", default_value = "0,0,0", allow_hyphen_values = true, value_parser = parse_pose)]
    pub start: Pose,
    /// Seed of its sensors' noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// What it is.
    #[command(flatten)]
    pub plant: PlantArgs,
    /// End together with the process that started this one.
    #[arg(long, value_name = "PID", hide = true)]
    pub with_parent: Option<u32>,
    /// End once the instance has had no supervisor for a minute.
    #[arg(long, hide = true)]
    pub with_stack: bool,
}

/// A pose as people write it: metres and degrees.
///
/// # Errors
/// What was found and what is allowed.
pub fn parse_pose(text: &str) -> Result<Pose, String> {
    let expected =
        || format!("found {text:?}, allowed are three numbers: x,y in metres, yaw in degrees");
    let numbers: Result<Vec<f64>, _> =
        text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    match numbers.map_err(|_| expected())?[..] {
        [x, y, yaw] if x.is_finite() && y.is_finite() && yaw.is_finite() => {
            Ok(Pose::new(x, y, angle::radians(yaw)))
        }
        _ => Err(expected()),
    }
}

/// A pose as [`parse_pose`] reads it, to the last bit that decimals carry.
#[must_use]
pub fn format_pose(pose: &Pose) -> String {
    format!("{},{},{}", pose.x, pose.y, angle::degrees(pose.yaw))
}

/// Runs the simulated vehicle.
///
/// # Errors
/// [`Failure`] where one runs in the instance already, or the pseudo-terminal cannot be made.
pub fn run(args: &VehicleArgs, service: Service) -> Result<Exit, Failure> {
    if let Some(parent) = args.with_parent {
        crate::parent::die_with_parent(parent);
    }
    let plant = args.plant.load(&service)?;
    let stop = stop_flag()?;
    service.instance.create_folder()?;
    let _lock = take_lock(&service)?;
    let mut pty = Pty::create(&service.instance.vehicle_link()).map_err(Failure::internal)?;
    let reporter = Reporter::start(&service.instance)?;
    // After the reporter's thread, which need not be in time.
    life::enter_realtime(&service, Process::Vehicle);
    let mut stage = VehicleStage::new(&Making {
        vehicle: plant.vehicle,
        effects: plant.effects,
        start: args.start,
        seed: args.seed,
        boot: boot_id(),
        silence: service.safety().timeouts.vehicle_silence,
    });
    tracing::info!(line = %pty.name().display(), vehicle = service.vehicle.name, "simulated vehicle");
    let mut watch = args.with_stack.then(|| StackWatch::new(&service));
    let mut goes_on = |now| {
        !stop.load(Ordering::Relaxed) && watch.as_mut().is_none_or(|watch| watch.goes_on(now))
    };
    drive(&mut goes_on, &mut pty, &mut stage, &reporter);
    Ok(Exit::Good)
}

fn drive(
    goes_on: &mut dyn FnMut(Nanos) -> bool,
    pty: &mut Pty,
    stage: &mut VehicleStage,
    reporter: &Reporter,
) {
    let mut tick = Ticker::new(core::time::Duration::from_nanos(stage.period()));
    let mut clock = OwnClock { time: 0, seen: now() };
    let mut buffer = [0; 4096];
    while goes_on(clock.seen) {
        poll_readable(&[pty.as_fd()], tick.next());
        let host = now();
        let time = clock.advance(host, stage.period());
        match pty.read(&mut buffer) {
            Ok(length) => stage.receive(time, &buffer[..length]),
            Err(error) => tracing::error!(%error, "the pseudo-terminal broke"),
        }
        if tick.due(host) {
            stage.tick(time, |frame| {
                if let Err(error) = pty.write(frame) {
                    tracing::error!(%error, "the pseudo-terminal broke");
                }
            });
            let mut truth = Truth::default();
            stage.truth(host, &mut truth);
            reporter.tell(&truth);
        }
    }
}

/// A vehicle that belongs to a stack waits for the next supervisor when one was killed, but not for ever.
struct StackWatch {
    instance: Instance,
    supervised: Nanos,
    next: Nanos,
}

impl StackWatch {
    fn new(service: &Service) -> Self {
        Self { instance: service.instance.clone(), supervised: now(), next: 0 }
    }

    fn goes_on(&mut self, now: Nanos) -> bool {
        if now >= self.next {
            self.next = now + LOOK;
            if self.instance.supervisor().is_some() {
                self.supervised = now;
            }
        }
        now.saturating_sub(self.supervised) <= ABANDONED
    }
}

/// The vehicle's clock: it follows the host's, and stands still while the process is stopped.
struct OwnClock {
    time: Nanos,
    seen: Nanos,
}

impl OwnClock {
    fn advance(&mut self, host: Nanos, period: Nanos) -> Nanos {
        let passed = host.saturating_sub(self.seen);
        self.seen = host;
        self.time += if passed > PAUSE { period } else { passed };
        self.time
    }
}

/// Another one at each start.
#[allow(clippy::cast_possible_truncation)] // the low bits are those that differ
fn boot_id() -> u32 {
    (now() / 1000) as u32 ^ std::process::id().rotate_left(16)
}

fn take_lock(service: &Service) -> Result<FileLock, Failure> {
    FileLock::take(&service.instance.process_lock(Process::Vehicle)).map_err(|error| match error {
        LockError::Held { pid, .. } => {
            let name = service.instance.name();
            Failure::unavailable(format!(
                "instance {name} already has a simulated vehicle: process {pid}"
            ))
        }
        error @ LockError::File { .. } => Failure::unavailable(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_messages::nanos;

    #[test]
    fn the_vehicles_time_stands_still_while_it_is_stopped() {
        let mut clock = OwnClock { time: 0, seen: 1_000 };
        assert_eq!(clock.advance(1_000 + nanos(0.005), nanos(0.005)), nanos(0.005));
        assert_eq!(clock.advance(1_000 + nanos(3.0), nanos(0.005)), nanos(0.010));
        assert_eq!(clock.advance(1_000 + nanos(3.005), nanos(0.005)), nanos(0.015));
    }

    #[test]
    fn a_stack_s_vehicle_waits_a_minute_for_the_next_supervisor() {
        let base = tempfile::tempdir_in("/tmp").unwrap();
        let instance = Instance::below(base.path(), "one").unwrap();
        let mut watch = StackWatch { instance: instance.clone(), supervised: 0, next: 0 };
        assert!(watch.goes_on(ABANDONED));
        let lock = instance.lock().unwrap();
        assert!(watch.goes_on(ABANDONED + LOOK), "supervised again");
        drop(lock);
        assert!(watch.goes_on(2 * ABANDONED));
        assert!(!watch.goes_on(2 * ABANDONED + 2 * LOOK));
    }

    #[test]
    fn poses_are_read_as_they_are_written() {
        let pose = Pose::new(-1.003, 0.65, -0.0123);
        let back = parse_pose(&format_pose(&pose)).unwrap();
        assert!(pose.distance(&back) < 1e-12 && (pose.yaw - back.yaw).abs() < 1e-12);
        assert!(parse_pose("1,2").unwrap_err().contains("three numbers"));
        assert!(parse_pose("1,2,nan").is_err());
    }
}
