//! Diagnosing in processes of their own: each is given a folder with the data of one case, and nothing else of the trial.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use serde_json::Value;

use crate::exit::Failure;
use crate::output;

/// Processes at a time.
pub const AT_ONCE: usize = 2;
/// A diagnosis that takes longer is ended, and wrong \[s\].
const LONGEST: u64 = 300;
/// Why there is no diagnosis.
const FAILURE: &str = "failure.txt";
const DIAGNOSIS: &str = "diagnosis.json";

/// What came of one case: the document, or why there is none.
pub type Outcome = Result<Value, String>;

/// The outcome that `folder` holds from an earlier sitting; a failure counts as one, so that nobody tries again.
#[must_use]
pub fn kept(folder: &Path) -> Option<Outcome> {
    if let Ok(why) = fs::read_to_string(folder.join(FAILURE)) {
        return Some(Err(why.trim().to_owned()));
    }
    let text = fs::read_to_string(folder.join(DIAGNOSIS)).ok()?;
    Some(serde_json::from_str(&text).map_err(|error| error.to_string()))
}

/// Lets `program` diagnose the case folder `data` into `out`.
///
/// # Errors
/// [`Failure`] where the process cannot be started or nothing can be written; a diagnosis that fails is no error but an
/// answer.
pub fn diagnose(program: &Path, data: &Path, out: &Path) -> Result<Outcome, Failure> {
    output::make(out)?;
    let log = out.join("log.txt");
    let errors = fs::File::create(&log).map_err(Failure::internal)?;
    let child = Command::new(program)
        .arg("diagnose")
        .arg(data)
        .arg("--out")
        .arg(out)
        .current_dir(data)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(errors)
        .spawn()
        .map_err(Failure::internal)?;
    if let Some(why) = wait(child)? {
        let told = fs::read_to_string(&log).unwrap_or_default();
        let last = told.lines().rfind(|line| !line.trim().is_empty()).unwrap_or_default();
        // What it may have written before it failed is no answer.
        let _ = fs::remove_file(out.join(DIAGNOSIS));
        output::write(&out.join(FAILURE), &format!("{why}: {}\n", last.trim()))?;
    }
    let _ = fs::remove_file(&log);
    Ok(kept(out).unwrap_or_else(|| Err("it wrote no diagnosis.json".to_owned())))
}

/// Waits for a process; why it is no success, where it is none.
fn wait(mut child: Child) -> Result<Option<String>, Failure> {
    let pid = i32::try_from(child.id()).ok().and_then(rustix::process::Pid::from_raw);
    let (tell, told) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        // Nobody listens any more where the trial itself failed.
        let _ = tell.send(child.wait());
    });
    let ended = told.recv_timeout(Duration::from_secs(LONGEST));
    if let Ok(status) = ended {
        let status = status.map_err(Failure::internal)?;
        return Ok((!status.success()).then(|| status.to_string()));
    }
    if let Some(pid) = pid {
        // It may have ended by itself just now.
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::KILL);
        let _ = told.recv();
    }
    Ok(Some(format!("ended after {LONGEST} s")))
}

/// Does `work` on every job, [`AT_ONCE`] at a time, until all are done, one fails or `enough` says so; whether all are done.
///
/// # Errors
/// The first failure.
pub fn each<T: Sync>(
    jobs: &[T],
    enough: &(dyn Fn() -> bool + Sync),
    work: &(dyn Fn(&T) -> Result<(), Failure> + Sync),
) -> Result<bool, Failure> {
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<Failure>> = Mutex::new(None);
    let stop =
        || enough() || failed.lock().unwrap_or_else(std::sync::PoisonError::into_inner).is_some();
    let worker = || {
        while !stop() {
            let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
            if let Err(failure) = work(job) {
                failed
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner)
                    .get_or_insert(failure);
            }
        }
    };
    std::thread::scope(|scope| {
        (1..AT_ONCE).for_each(|_| {
            scope.spawn(worker);
        });
        worker();
    });
    let failed = failed.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    failed.map_or(Ok(next.into_inner() >= jobs.len()), Err)
}

/// The program that diagnoses: this one.
///
/// # Errors
/// [`Failure`] where the operating system does not say which it is.
pub fn program() -> Result<PathBuf, Failure> {
    std::env::current_exe().map_err(Failure::internal)
}
