//! The processes of a verb that runs a stack of its own: a supervisor, and a simulated vehicle where one is driven.

use core::time::Duration;
use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use kerbside_messages::{OperatorAnswer, OperatorRequest, Process};
use kerbside_runtime::{FileLock, Instance, Session, Ticker, now};

use crate::exit::Failure;
use crate::life::nanos;
use crate::service::Service;

/// Time between looks for an end.
const LOOK: Duration = Duration::from_millis(20);
/// Time between looks for the instance's services.
const RETRY: Duration = Duration::from_millis(5);
/// Longest wait for the instance's services after the supervisor was started.
const START: Duration = Duration::from_secs(10);
/// Longest wait for an orderly end.
const END: Duration = Duration::from_secs(10);

/// The supervisor, which has children of its own, and perhaps a simulated vehicle.
#[derive(Debug)]
pub struct Children {
    supervisor: Child,
    vehicle: Option<Child>,
    instance: Instance,
}

impl Children {
    /// Starts them; the vehicle, if there is to be one, with these arguments besides.
    ///
    /// # Errors
    /// [`Failure`] where a process cannot be started.
    pub fn start(service: &Service, vehicle: Option<&[OsString]>) -> Result<Self, Failure> {
        service.instance.create_folder()?;
        let vehicle = vehicle
            .map(|own| spawn(own_executable().args(["service", "vehicle"]).args(own), service))
            .transpose()?;
        let supervisor = match spawn(own_executable().arg("up"), service) {
            Ok(supervisor) => supervisor,
            Err(failure) => {
                if let Some(vehicle) = vehicle {
                    kerbside_runtime::kill(vehicle.id());
                }
                return Err(failure);
            }
        };
        Ok(Self { supervisor, vehicle, instance: service.instance.clone() })
    }

    /// Whether the simulated vehicle ended by itself; where there is none, it cannot.
    pub fn vehicle_ended(&mut self) -> bool {
        self.vehicle.as_mut().is_some_and(has_ended)
    }

    /// Whether the supervisor ended by itself.
    pub fn supervisor_ended(&mut self) -> bool {
        has_ended(&mut self.supervisor)
    }

    /// Joins the instance once its services are there.
    ///
    /// # Errors
    /// [`Failure`] where they do not come, or `stop` is set meanwhile.
    pub fn join(&mut self, stop: &AtomicBool) -> Result<Session, Failure> {
        let deadline = now() + nanos(START);
        let mut look = Ticker::new(RETRY);
        loop {
            // The configuration is there before the services are: the last one that is created decides.
            let joined = Session::join(&self.instance, Process::Operator).and_then(|session| {
                session.client::<OperatorRequest, OperatorAnswer>().map(|_| session)
            });
            match joined {
                Ok(session) => return Ok(session),
                Err(error) if !error.is_missing() => return Err(error.into()),
                Err(error) if now() > deadline => return Err(Failure::unavailable(error)),
                Err(_) => {}
            }
            if self.supervisor_ended() {
                return Err(Failure::unavailable(
                    "the supervisor ended at its start; its messages are above",
                ));
            }
            if stop.load(Ordering::Relaxed) {
                return Err(Failure::unavailable("interrupted"));
            }
            look.wait();
        }
    }

    /// Ends all: in order, but a lost supervisor hears nothing any more.
    pub fn end(&mut self, supervisor_lost: bool) {
        let how =
            if supervisor_lost { kerbside_runtime::kill } else { kerbside_runtime::terminate };
        if !has_ended(&mut self.supervisor) {
            how(self.supervisor.id());
            wait_or_kill(&mut self.supervisor);
        }
        end_orphans(&self.instance);
        if let Some(vehicle) = &mut self.vehicle
            && !has_ended(vehicle)
        {
            kerbside_runtime::terminate(vehicle.id());
            kerbside_runtime::resume(vehicle.id());
            wait_or_kill(vehicle);
        }
        if let Err(error) = self.instance.remove() {
            tracing::warn!(%error, "something of the instance is left");
        }
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        let vehicle_runs = self.vehicle.as_mut().is_some_and(|vehicle| !has_ended(vehicle));
        if vehicle_runs || !self.supervisor_ended() {
            self.end(false);
        }
    }
}

fn has_ended(child: &mut Child) -> bool {
    matches!(child.try_wait(), Ok(Some(_)) | Err(_))
}

/// Processes whose supervisor was killed end by themselves after two seconds; nobody waits for that here. They are gone
/// when this returns: what of the instance is removed next, none of them makes anew.
fn end_orphans(instance: &Instance) {
    let deadline = now() + nanos(END);
    let mut look = Ticker::new(RETRY);
    for process in Process::SUPERVISED {
        let path = instance.process_lock(process);
        while let Some(pid) = FileLock::holder(&path)
            && now() < deadline
        {
            kerbside_runtime::kill(pid);
            look.wait();
        }
    }
}

/// A command that runs this very executable, even where its file was replaced meanwhile.
fn own_executable() -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0("kerbside");
    command
}

/// Starts `command` for `service`'s instance; it ends together with this process.
fn spawn(command: &mut Command, service: &Service) -> Result<Child, Failure> {
    kerbside_runtime::close_inherited_on_exec();
    command
        .args(service.arguments())
        .args(["--with-parent", &std::process::id().to_string()])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .process_group(0)
        .spawn()
        .map_err(Failure::internal)
}

fn wait_or_kill(child: &mut Child) {
    let deadline = now() + nanos(END);
    let mut look = Ticker::new(LOOK);
    while matches!(child.try_wait(), Ok(None)) {
        if now() > deadline {
            tracing::warn!(pid = child.id(), "does not end; killed");
            kerbside_runtime::kill(child.id());
        }
        look.wait();
    }
}
