//! What stands in for shared memory and the serial line: the same seals and checks, in one thread.

use std::collections::VecDeque;

use kerbside_messages::{Admission, Admitted, Message, Nanos, seal};

/// A topic with one publisher and one reader.
#[derive(Debug)]
pub struct Channel<M: Message> {
    epoch: u64,
    sequence: u64,
    admission: Admission<M>,
    newest: Option<M>,
}

impl<M: Message> Channel<M> {
    /// A topic whose publisher began at `epoch`.
    pub fn new(epoch: Nanos) -> Self {
        Self { epoch, sequence: 0, admission: Admission::default(), newest: None }
    }

    /// The publisher starts anew.
    pub fn restart(&mut self, epoch: Nanos) {
        (self.epoch, self.sequence) = (epoch, 0);
    }

    /// Lets `fill` write a sample; it is sealed at `now`, checked as a receiver would, and kept as the newest.
    pub fn send(&mut self, now: Nanos, fill: impl FnOnce(&mut M) -> bool) -> Option<(M, Admitted)> {
        let mut message = M::default();
        if !fill(&mut message) {
            return None;
        }
        self.sequence += 1;
        seal(&mut message, &[], self.epoch, self.sequence, now);
        let admitted = self.admission.admit(&message, &[], now).ok()?;
        self.newest = Some(message);
        Some((message, admitted))
    }

    /// The newest sample.
    pub fn newest(&self) -> Option<&M> {
        self.newest.as_ref()
    }
}

/// One direction of the line: bytes that arrive a while later.
#[derive(Debug, Default)]
pub struct ByteQueue {
    delay: Nanos,
    pieces: VecDeque<(Nanos, usize)>,
    bytes: VecDeque<u8>,
}

impl ByteQueue {
    /// A line that takes `delay`.
    pub fn new(delay: Nanos) -> Self {
        Self { delay, ..Self::default() }
    }

    /// Puts bytes in at `now`.
    pub fn put(&mut self, now: Nanos, bytes: &[u8]) {
        self.pieces.push_back((now + self.delay, bytes.len()));
        self.bytes.extend(bytes);
    }

    /// Whether something has arrived at `now`.
    pub fn is_due(&self, now: Nanos) -> bool {
        self.pieces.front().is_some_and(|(due, _)| *due <= now)
    }

    /// Takes what has arrived at `now`.
    pub fn take(&mut self, now: Nanos, out: &mut Vec<u8>) {
        out.clear();
        while self.is_due(now) {
            let Some((_, length)) = self.pieces.pop_front() else { return };
            out.extend(self.bytes.drain(..length));
        }
    }
}
