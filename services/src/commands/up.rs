//! `up`: the supervisor in the foreground.

use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

use kerbside_messages::Process;
use kerbside_runtime::FileLock;

use super::DEFAULT_INSTANCE;
use crate::exit::{Exit, Failure};
use crate::service::{Service, ServiceArgs};
use crate::{parent, realtime, supervisor};

/// What `up` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct UpArgs {
    #[command(flatten)]
    service: ServiceArgs,
    /// Start a simulated vehicle too, unless the instance has one.
    #[arg(long)]
    simulate: bool,
    /// Where the simulated vehicle stands at first: x and y in metres, yaw in degrees.
    #[arg(long, value_name = "X,Y,YAW", default_value = "0,0,0", allow_hyphen_values = true)]
    start: String,
    /// Seed of the simulated vehicle's noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// End together with the process that started this one.
    #[arg(long, value_name = "PID", hide = true)]
    with_parent: Option<u32>,
}

/// Runs the stack until it is told to end.
///
/// # Errors
/// [`Failure`] where the configuration is refused or the instance is busy.
pub fn run(args: &UpArgs, level: Option<&str>) -> Result<Exit, Failure> {
    let mut service = Service::load(Process::Supervisor, &args.service, DEFAULT_INSTANCE)?;
    super::start_log(&service, level);
    if let Some(parent) = args.with_parent {
        parent::die_with_parent(parent);
    } else {
        // Whoever starts this one has decided already.
        service.args.realtime = realtime::wanted(&service.stack)?;
    }
    crate::vehicle::parse_pose(&args.start)
        .map_err(|error| Failure::new(Exit::Usage, format!("--start: {error}")))?;
    let vehicle = args.simulate.then(|| start_vehicle(args, &service)).transpose()?.flatten();
    let name = service.instance.name().to_owned();
    let exit = supervisor::run(&service, || eprintln!("instance {name} is ready; Ctrl-C ends it"));
    if let Some(mut vehicle) = vehicle {
        kerbside_runtime::terminate(vehicle.id());
        let _ = vehicle.wait();
        service.instance.remove()?;
    }
    exit
}

/// A vehicle that outlived an earlier supervisor is used as it is.
fn start_vehicle(args: &UpArgs, service: &Service) -> Result<Option<Child>, Failure> {
    if let Some(pid) = FileLock::holder(&service.instance.process_lock(Process::Vehicle)) {
        tracing::info!(pid, "the instance has a simulated vehicle");
        return Ok(None);
    }
    if let Some(pid) = service.instance.supervisor() {
        let name = service.instance.name();
        return Err(Failure::unavailable(format!(
            "instance {name} is already supervised by process {pid}"
        )));
    }
    kerbside_runtime::close_inherited_on_exec();
    let child = Command::new("/proc/self/exe")
        .arg0("kerbside")
        .args(["service", "vehicle"])
        .args(service.arguments())
        .args(["--start", &args.start, "--seed", &args.seed.to_string()])
        .args(["--with-parent", &std::process::id().to_string()])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .process_group(0)
        .spawn()
        .map_err(Failure::internal)?;
    Ok(Some(child))
}
