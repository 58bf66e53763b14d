//! `up`: the supervisor in the foreground.

use core::time::Duration;
use std::fs;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

use kerbside_geometry::Pose;
use kerbside_messages::Process;
use kerbside_runtime::{FileLock, Ticker, now};

use super::DEFAULT_INSTANCE;
use crate::exit::{Exit, Failure};
use crate::service::{Service, ServiceArgs};
use crate::vehicle::{PlantArgs, format_pose, parse_pose};
use crate::{parent, realtime, supervisor};

/// Longest wait for the vehicle's orderly end.
const VEHICLE_END: Duration = Duration::from_secs(2);
/// Time between looks whether it ended.
const LOOK: Duration = Duration::from_millis(5);

/// What `up` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct UpArgs {
    #[command(flatten)]
    service: ServiceArgs,
    /// Drive a simulated vehicle: the one that the instance still has, else a new one. It ends with the stack, but
    /// survives a supervisor that is killed, as a real vehicle does.
    #[arg(long)]
    simulate: bool,
    /// Where the simulated vehicle stands at first: x and y in metres, yaw in degrees.
    #[arg(long, value_name = "X,Y,YAW", default_value = "0,0,0", allow_hyphen_values = true, value_parser = parse_pose)]
    start: Pose,
    /// Seed of the simulated vehicle's noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    plant: PlantArgs,
    /// End together with the process that started this one.
    #[arg(long, value_name = "PID", hide = true)]
    with_parent: Option<u32>,
}

/// Runs the stack until it is told to end.
///
/// # Errors
/// [`Failure`] where the configuration is refused or the instance is busy.
pub fn run(args: &UpArgs, level: Option<&str>) -> Result<Exit, Failure> {
    if args.plant.is_given() && !args.simulate {
        return Err(Failure::new(Exit::Usage, "--effects and --plant are for --simulate"));
    }
    let mut service = Service::load(Process::Supervisor, &args.service, DEFAULT_INSTANCE)?;
    super::start_log(&service, level);
    if let Some(parent) = args.with_parent {
        parent::die_with_parent(parent);
    } else {
        // Whoever starts this one has decided, and said, already.
        crate::configuration::warn(&service.warnings);
        service.args.realtime = realtime::wanted(&service.stack)?;
    }
    service.args.simulated |= args.simulate;
    service.args.log = level.map(str::to_owned);
    let child = if args.simulate { start_vehicle(args, &service)? } else { None };
    let name = service.instance.name().to_owned();
    let exit = supervisor::run(&service, || {
        if args.with_parent.is_none() {
            // Nobody may read any more what this says; that is no reason to end.
            let _ = writeln!(std::io::stderr(), "instance {name} is ready; Ctrl-C ends it");
        }
    });
    if args.simulate {
        end_vehicle(&service, child)?;
    }
    exit
}

/// A vehicle that outlived an earlier supervisor is used as it is; else the one that was started.
fn start_vehicle(args: &UpArgs, service: &Service) -> Result<Option<Child>, Failure> {
    if let Some(pid) = service.instance.supervisor() {
        let name = service.instance.name();
        return Err(Failure::unavailable(format!(
            "instance {name} is already supervised by process {pid}"
        )));
    }
    // Refused here, where a person reads it.
    args.plant.load(service)?;
    if let Some(pid) = vehicle_of(service) {
        if args.plant.is_given() {
            return Err(Failure::with_help(
                Exit::Unavailable,
                format!(
                    "the instance still has a simulated vehicle, process {pid}, of its own kind"
                ),
                "kerbside up --simulate without --effects and --plant goes on with it; or end it first",
            ));
        }
        tracing::info!(pid, "the instance has a simulated vehicle");
        return Ok(None);
    }
    kerbside_runtime::close_inherited_on_exec();
    Command::new("/proc/self/exe")
        .arg0("kerbside")
        .args(["service", "vehicle"])
        .args(service.arguments())
        .args(["--start", &format_pose(&args.start), "--seed", &args.seed.to_string()])
        .args(args.plant.arguments())
        .arg("--with-stack")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .process_group(0)
        .spawn()
        .map(Some)
        .map_err(Failure::internal)
}

fn vehicle_of(service: &Service) -> Option<u32> {
    FileLock::holder(&service.instance.process_lock(Process::Vehicle))
}

/// Ends the vehicle, whoever started it; one that was stopped is woken for it, or killed.
fn end_vehicle(service: &Service, mut child: Option<Child>) -> Result<(), Failure> {
    if service.instance.supervisor().is_some() {
        // Another one was faster: vehicle and instance are its own.
        return Ok(());
    }
    let deadline = now() + crate::life::nanos(VEHICLE_END);
    let mut look = Ticker::new(LOOK);
    if let Some(pid) = vehicle_of(service).or(child.as_ref().map(Child::id)) {
        kerbside_runtime::terminate(pid);
        kerbside_runtime::resume(pid);
        // It gives its lock back before it is gone.
        let mut killed = false;
        while vehicle_of(service).is_some() || !is_gone(pid, &mut child) {
            if now() > deadline && !killed {
                kerbside_runtime::kill(pid);
                killed = true;
            }
            if now() > deadline + crate::life::nanos(VEHICLE_END) {
                return Err(Failure::internal(format!("the vehicle, process {pid}, does not end")));
            }
            look.wait();
        }
    }
    service.instance.remove()?;
    Ok(())
}

fn is_gone(pid: u32, child: &mut Option<Child>) -> bool {
    match child {
        Some(child) if child.id() == pid => !matches!(child.try_wait(), Ok(None)),
        // Somebody else's child stays a zombie until that one looks at it.
        _ => fs::read_to_string(format!("/proc/{pid}/stat")).map_or(true, |stat| {
            stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with(['Z', 'X']))
        }),
    }
}
