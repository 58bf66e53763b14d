//! What a process is started with: its instance, its configuration, and how to hand both on to children.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use kerbside_geometry::{Pose, Vehicle};
use kerbside_messages::Process;
use kerbside_odometry::{Estimator, InitialPose, Sensors};
use kerbside_runtime::Instance;
use kerbside_safety::SafetySettings;
use kerbside_settings::{InterfaceSettings, Problem, Stack, Start};

use crate::configuration;
use crate::exit::{Exit, Failure};
use crate::replay::{self, sensing};

/// Where a process finds its instance and its configuration.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct ServiceArgs {
    /// Name of the instance.
    #[arg(long, value_name = "NAME")]
    pub instance: Option<String>,
    /// Configuration: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH")]
    pub config: Option<PathBuf>,
    /// Scenario whose stack and vehicle are used: a file, or the name of a shipped one.
    #[arg(long, value_name = "NAME", hide = true)]
    pub scenario: Option<String>,
    /// Vehicle, in place of the one the configuration names: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<String>,
    /// File to record to.
    #[arg(long, value_name = "FILE")]
    pub recording: Option<PathBuf>,
    /// Feed this run folder or recording in place of a vehicle.
    #[arg(long, value_name = "PATH", hide = true)]
    pub input: Option<PathBuf>,
    /// What the readings of the input carry, as whoever read them found out.
    #[arg(long, value_name = "SENSORS", hide = true, value_parser = sensing::parse)]
    pub sensors: Option<Sensors>,
    /// Speed of the replay against real time; as fast as it goes where not given.
    #[arg(long, value_name = "FACTOR", hide = true)]
    pub speed: Option<f64>,
    /// An earlier life of this process ended: its pose comes from there, not from the configuration.
    #[arg(long, hide = true)]
    pub restarted: bool,
    /// The supervisor that started this process: where it dies before they met, nobody else is waited for.
    #[arg(long, value_name = "PID", hide = true)]
    pub supervisor: Option<u32>,
    /// The instance runs with real-time rights, and so with the shorter time-outs.
    #[arg(long, hide = true)]
    pub realtime: bool,
    /// The line leads to the instance's simulated vehicle, whatever device the configuration names.
    #[arg(long, hide = true)]
    pub simulated: bool,
    /// Level of the children's log, in place of the configured one.
    #[arg(skip)]
    pub log: Option<String>,
}

/// A process's instance and configuration, loaded and checked.
#[derive(Clone, Debug)]
pub struct Service {
    /// Which process this is.
    pub process: Process,
    /// The instance.
    pub instance: Instance,
    /// The configuration.
    pub stack: Stack,
    /// The same as a file, each value with where it comes from: for recordings.
    pub stack_text: String,
    /// The vehicle.
    pub vehicle: Vehicle,
    /// What the vehicle senses.
    pub sensors: Sensors,
    /// What is suspicious in the configuration: said by whoever a person started, not by each process.
    pub warnings: Vec<Problem>,
    /// What it was started with.
    pub args: ServiceArgs,
}

impl Service {
    /// Loads what `args` name, for `process`; `default_instance` where they name none.
    ///
    /// # Errors
    /// [`Failure`] where the configuration is refused or the name is none.
    pub fn load(
        process: Process,
        args: &ServiceArgs,
        default_instance: &str,
    ) -> Result<Self, Failure> {
        let instance = Instance::named(args.instance.as_deref().unwrap_or(default_instance))?;
        // A replay's vehicle is the input's: the stack is checked with its own.
        let named = args.vehicle.as_deref().filter(|_| args.input.is_none());
        let sources = configuration::sources(args.config.as_deref())?;
        let loaded = match &args.scenario {
            Some(scenario) => sources.parking(scenario, named)?.stack,
            None => sources.stack_for(named)?,
        };
        let (stack_text, warnings) = (loaded.show(), loaded.warnings);
        let mut stack = loaded.value;
        let sensors = match &args.input {
            Some(input) => take_input(&mut stack, args, input)?,
            None if stack.interface == InterfaceSettings::Replay => {
                return Err(Failure::with_help(
                    Exit::Configuration,
                    "interface.kind = \"replay\": nothing says what to replay",
                    "kerbside replay PATH starts a stack of its own",
                ));
            }
            None => Sensors::of(&stack.vehicle),
        };
        let vehicle = stack.vehicle.clone();
        if args.restarted {
            stack.estimator.initial_pose = None;
        }
        if let InterfaceSettings::Line { device, .. } = &mut stack.interface
            && args.simulated
        {
            *device = None;
        }
        let args = args.clone();
        Ok(Self { process, instance, stack, stack_text, vehicle, sensors, warnings, args })
    }

    /// The estimator of this vehicle, with what is known of it.
    ///
    /// # Errors
    /// [`Failure`] where the vehicle has nothing to compute motion from.
    pub fn estimator(&self) -> Result<Estimator, Failure> {
        let (settings, prior) = (&self.stack.estimator, self.stack.prior());
        Estimator::with_prior(&self.vehicle, &self.sensors, settings, &prior)
            .map_err(crate::ingest::no_model)
    }

    /// Whether the instance is fed from recorded readings.
    #[must_use]
    pub fn replays(&self) -> bool {
        self.stack.interface == InterfaceSettings::Replay
    }

    /// Whether the instance runs with real-time rights.
    #[must_use]
    pub fn realtime(&self) -> bool {
        self.args.realtime
    }

    /// Supervision and gate, as this instance's rights make them.
    #[must_use]
    pub fn safety(&self) -> &SafetySettings {
        self.stack.safety(self.realtime())
    }

    /// Whether somebody else than the supervisor starts `process`.
    #[must_use]
    pub fn is_external(&self, process: Process) -> bool {
        self.stack.start_of(process) == Start::External
    }

    /// The processes its supervisor answers for: a replay needs no plan and moves nothing.
    #[must_use]
    pub fn supervised(&self) -> Vec<Process> {
        let replay = self.replays();
        let takes_part = |process: &Process| match process {
            Process::Interface | Process::Ingest | Process::Estimator => true,
            Process::Recorder => self.stack.recorder.enabled,
            Process::Gateway => self.stack.gateway.enabled && !replay,
            _ => !replay,
        };
        Process::SUPERVISED.into_iter().filter(takes_part).collect()
    }

    /// The arguments that give a child the same instance and configuration.
    #[must_use]
    pub fn arguments(&self) -> Vec<OsString> {
        let mut arguments: Vec<OsString> = vec!["--instance".into(), self.instance.name().into()];
        let mut add = |flag: &str, value: Option<OsString>| {
            if let Some(value) = value {
                arguments.extend([flag.into(), value]);
            }
        };
        add("--config", self.args.config.clone().map(Into::into));
        add("--scenario", self.args.scenario.clone().map(Into::into));
        add("--vehicle", self.args.vehicle.clone().map(Into::into));
        add("--recording", self.args.recording.clone().map(Into::into));
        add("--input", self.args.input.clone().map(Into::into));
        add("--sensors", self.args.sensors.map(|sensors| sensing::format(&sensors).into()));
        add("--speed", self.args.speed.map(|speed| speed.to_string().into()));
        add("--log", self.args.log.clone().map(Into::into));
        if self.args.realtime {
            arguments.push("--realtime".into());
        }
        if self.args.simulated {
            arguments.push("--simulated".into());
        }
        arguments
    }
}

/// Has `stack` replay `input`: the vehicle is the input's, and its pose begins where the drive does. Returns what the
/// vehicle senses.
fn take_input(stack: &mut Stack, args: &ServiceArgs, input: &Path) -> Result<Sensors, Failure> {
    let described = replay::describe(input, args.vehicle.as_deref(), args.sensors)?;
    stack.vehicle = described.file.vehicle;
    stack.uncertainty = described.file.uncertainty;
    stack.calibration = described.file.calibration;
    stack.vehicle_file = described.origin;
    stack.vehicle_text = described.text;
    stack.interface = InterfaceSettings::Replay;
    stack.estimator.initial_pose =
        Some(InitialPose { pose: Pose::default(), position_noise: 0.0, yaw_noise: 0.0 });
    Ok(described.sensors)
}

/// Refuses a factor that is none.
///
/// # Errors
/// [`Failure`] with the usage exit code.
pub fn check_speed(speed: Option<f64>) -> Result<(), Failure> {
    match speed {
        Some(speed) if !(speed.is_finite() && speed > 0.0) => {
            Err(Failure::new(Exit::Usage, format!("--speed {speed}: a factor above 0 is allowed")))
        }
        _ => Ok(()),
    }
}
