//! How far an experiment is.

use crate::error::ReproductionError;

/// Told after every trial: how many of how many are done, and of what. False ends the experiment.
pub type Watcher<'a> = &'a mut dyn FnMut(u64, u64, &str) -> bool;

/// Counts trials.
pub(crate) struct Progress<'a> {
    watcher: Watcher<'a>,
    done: u64,
    total: u64,
    /// What is being done.
    what: &'static str,
}

impl<'a> Progress<'a> {
    pub(crate) fn new(watcher: Watcher<'a>, total: u64) -> Self {
        Self { watcher, done: 0, total, what: "" }
    }

    /// Something else begins.
    pub(crate) fn begin(&mut self, what: &'static str) {
        self.what = what;
    }

    /// One trial is done.
    pub(crate) fn step(&mut self) -> Result<(), ReproductionError> {
        self.done += 1;
        let goes_on = (self.watcher)(self.done, self.total.max(self.done), self.what);
        if goes_on { Ok(()) } else { Err(ReproductionError::Interrupted) }
    }
}
