//! The supervised processes as children: started, reaped at once, ended.

use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::process::ExitStatusExt;
use std::process::{ExitStatus, Stdio};

use kerbside_messages::Process;
use kerbside_safety::Exit;
use tokio::process::Command;
use tokio::sync::mpsc;

use crate::life::Service;

/// The children of a supervisor.
pub struct Children {
    arguments: Vec<std::ffi::OsString>,
    pids: BTreeMap<Process, u32>,
    started: BTreeSet<Process>,
    sender: mpsc::UnboundedSender<(Process, Exit)>,
    receiver: mpsc::UnboundedReceiver<(Process, Exit)>,
}

impl Children {
    /// No children yet; all will run with `service`'s instance and configuration.
    pub fn new(service: &Service) -> Self {
        let (sender, receiver) = mpsc::unbounded_channel();
        Self {
            arguments: service.arguments(),
            pids: BTreeMap::new(),
            started: BTreeSet::new(),
            sender,
            receiver,
        }
    }

    /// Starts a process and watches for its end.
    pub fn spawn(&mut self, process: Process) -> std::io::Result<u32> {
        kerbside_runtime::close_inherited_on_exec();
        let restarted = !self.started.insert(process);
        let mut child = own_executable()
            .arg("service")
            .arg(process.name())
            .args(&self.arguments)
            .args(restarted.then_some("--restarted"))
            .args(["--supervisor", &std::process::id().to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            // A group of its own: Ctrl-C on the terminal reaches the supervisor alone, which ends the others in order.
            .process_group(0)
            .spawn()?;
        let pid = child.id().ok_or_else(|| std::io::Error::other("ended at once"))?;
        self.pids.insert(process, pid);
        let sender = self.sender.clone();
        tokio::task::spawn_local(async move {
            let exit = child.wait().await.map_or(Exit::Code(-1), exit_of);
            // The receiver is gone only after the supervisor.
            let _ = sender.send((process, exit));
        });
        tracing::info!(%process, pid, "started");
        Ok(pid)
    }

    /// The next child that ended.
    pub async fn exited(&mut self) -> Option<(Process, Exit)> {
        let (process, exit) = self.receiver.recv().await?;
        let pid = self.pids.remove(&process);
        tracing::info!(%process, pid, how = %exit, "ended");
        Some((process, exit))
    }

    /// Asks a child to end.
    pub fn terminate(&self, process: Process) {
        if let Some(pid) = self.pids.get(&process) {
            kerbside_runtime::terminate(*pid);
        }
    }

    /// Ends a child.
    pub fn kill(&self, process: Process) {
        if let Some(pid) = self.pids.get(&process) {
            kerbside_runtime::kill(*pid);
        }
    }

    /// Ends whoever is left, and waits for it: no orphan survives its supervisor's orderly end.
    pub async fn reap(&mut self) {
        for pid in self.pids.values() {
            kerbside_runtime::kill(*pid);
        }
        while !self.pids.is_empty() && self.exited().await.is_some() {}
    }
}

/// A command that runs this very executable, even where its file was replaced meanwhile.
pub fn own_executable() -> Command {
    let mut command = Command::new("/proc/self/exe");
    command.arg0("kerbside");
    command
}

fn exit_of(status: ExitStatus) -> Exit {
    status.signal().map_or_else(|| Exit::Code(status.code().unwrap_or(-1)), Exit::Signal)
}
