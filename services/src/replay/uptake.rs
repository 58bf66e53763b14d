//! How a reader of odometry tells a replay how far it has come.

use kerbside_messages::{Nanos, Process, Uptake};
use kerbside_runtime::{Publisher, Session, SessionError, now};

/// It is told after so many estimates ...
const STEP: u64 = 32;
/// ... and after so long without, so that one who came late hears it \[ns\].
const AGE: Nanos = 5_000_000;

/// A reader's voice.
#[derive(Debug)]
pub struct Uptaker {
    publisher: Publisher<Uptake>,
    reader: Process,
    told: Option<(u64, Nanos)>,
}

impl Uptaker {
    /// The voice of `reader`.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn open(session: &Session, reader: Process) -> Result<Self, SessionError> {
        Ok(Self { publisher: session.publisher(None)?, reader, told: None })
    }

    /// Tells, where it is time to, that the estimate with sequence `odometry` is the newest taken in.
    pub fn tell(&mut self, odometry: u64) {
        let now = now();
        let is_time = self
            .told
            .is_none_or(|(told, at)| odometry >= told.saturating_add(STEP) || now >= at + AGE);
        if !is_time {
            return;
        }
        self.told = Some((odometry, now));
        let sent = self.publisher.send(|uptake| {
            (uptake.odometry, uptake.reader) = (odometry, self.reader as u8);
            true
        });
        if let Err(error) = sent {
            tracing::warn!(%error, "uptake lost; it will be told again");
        }
    }
}
