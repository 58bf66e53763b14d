//! What stands in for shared memory and the serial line: the same seals and checks, in one thread.

use std::collections::VecDeque;
use std::sync::Arc;

use kerbside_messages::{Admission, Admitted, Message, Nanos, Process, Refusals, seal};

use super::mishap::{Mishap, Passing};

/// Samples that wait for a reader of every one; more push out the oldest.
const IN_ORDER: usize = 512;
/// The same for a reader of the newest: room for those that are under way.
const NEWEST: usize = 64;

/// Changes every sample of a topic on its way, in a test.
#[cfg(test)]
pub type Forge<M> = Box<dyn FnMut(Nanos, &mut M) + Send>;

/// A topic with one publisher and its readers, who share what nothing befalls.
pub struct Topic<M: Message> {
    epoch: u64,
    sequence: u64,
    readers: Vec<Reader<M>>,
    passing: Vec<Passing<M>>,
    #[cfg(test)]
    forge: Option<Forge<M>>,
}

impl<M: Message> Topic<M> {
    /// A topic whose publisher began at `epoch`, read by `readers`.
    pub fn new(epoch: Nanos, readers: &[Process]) -> Self {
        Self {
            epoch,
            sequence: 0,
            readers: readers.iter().map(|process| Reader::new(*process)).collect(),
            passing: Vec::new(),
            #[cfg(test)]
            forge: None,
        }
    }

    /// The publisher starts anew.
    pub fn restart(&mut self, epoch: Nanos) {
        (self.epoch, self.sequence) = (epoch, 0);
    }

    /// The reader's process starts anew: what waited for its earlier life is gone.
    pub fn reopen(&mut self, reader: Process) {
        if let Some(found) = self.readers.iter_mut().find(|known| known.process == reader) {
            *found = Reader::new(reader);
        }
    }

    /// Every sample is changed on its way from now on, as by a publisher with a defect: the seal is right.
    #[cfg(test)]
    pub fn forge(&mut self, forge: Forge<M>) {
        self.forge = Some(forge);
    }

    /// What is on its way to `reader` (all of them where that is none) meets with `mishap` until `until`.
    pub fn befall(&mut self, mishap: Mishap, reader: Option<Process>, until: Nanos) {
        for known in &self.readers {
            if reader.is_none_or(|reader| reader == known.process) {
                self.passing.push(Passing::new(mishap, known.process, until));
            }
        }
    }

    /// Lets `fill` write a sample; it is sealed at `now`, and on its way.
    pub fn send(&mut self, now: Nanos, fill: impl FnOnce(&mut M) -> bool) -> Option<Arc<M>> {
        let mut message = Arc::new(M::default());
        let sample = Arc::get_mut(&mut message)?;
        if !fill(sample) {
            return None;
        }
        #[cfg(test)]
        if let Some(forge) = &mut self.forge {
            forge(now, sample);
        }
        self.sequence += 1;
        seal(sample, &[], self.epoch, self.sequence, now);
        self.deliver(now, &message);
        Some(message)
    }

    fn deliver(&mut self, now: Nanos, message: &Arc<M>) {
        if !self.passing.is_empty() {
            self.passing.retain(|passing| passing.until > now);
        }
        for reader in &mut self.readers {
            let concerned =
                self.passing.iter_mut().find(|passing| passing.reader == reader.process);
            match concerned {
                Some(passing) => {
                    passing.pass(now, message, |due, sample| reader.put(due, Arc::new(*sample)));
                }
                None => reader.put(now, Arc::clone(message)),
            }
        }
    }

    /// The reader's end of the topic.
    pub fn reader(&mut self, process: Process) -> Option<&mut Reader<M>> {
        self.readers.iter_mut().find(|reader| reader.process == process)
    }

    /// The next sample for a reader of every one.
    pub fn take(&mut self, process: Process, now: Nanos) -> Option<(Arc<M>, Admitted)> {
        self.reader(process)?.take(now)
    }

    /// Lets a reader of the newest take in what came; whether something did.
    pub fn update(&mut self, process: Process, now: Nanos) -> bool {
        self.reader(process).is_some_and(|reader| reader.update(now))
    }

    /// The newest sample that a reader has taken in.
    pub fn newest(&self, process: Process) -> Option<&M> {
        self.readers.iter().find(|reader| reader.process == process)?.newest.as_deref()
    }

    /// What a reader refused.
    pub fn refusals(&self, process: Process) -> u64 {
        let reader = self.readers.iter().find(|reader| reader.process == process);
        reader.map_or(0, |reader| reader.counts().total())
    }
}

/// A reader's end of a topic.
#[derive(Debug)]
pub struct Reader<M: Message> {
    process: Process,
    admission: Admission<M>,
    queue: VecDeque<(Nanos, Arc<M>)>,
    newest: Option<Arc<M>>,
}

impl<M: Message> Reader<M> {
    fn new(process: Process) -> Self {
        Self { process, admission: Admission::default(), queue: VecDeque::new(), newest: None }
    }

    fn put(&mut self, due: Nanos, message: Arc<M>) {
        let in_order = matches!(M::TOPIC.delivery, kerbside_messages::Delivery::InOrder { .. });
        let depth = if in_order { IN_ORDER } else { NEWEST };
        if self.queue.len() >= depth {
            self.queue.pop_front();
        }
        self.queue.push_back((due, message));
    }

    /// The next sample that has come and may be used.
    fn take(&mut self, now: Nanos) -> Option<(Arc<M>, Admitted)> {
        loop {
            let message = self.arrived(now)?;
            if let Ok(admitted) = self.admission.admit(&message, &[], now) {
                return Some((message, admitted));
            }
        }
    }

    /// The next sample that has come: what is late lets others pass.
    fn arrived(&mut self, now: Nanos) -> Option<Arc<M>> {
        let due = |(due, _): &(Nanos, Arc<M>)| *due;
        let first = self.queue.iter().map(due).min().filter(|first| *first <= now)?;
        let index = self.queue.iter().position(|waiting| waiting.0 == first)?;
        self.queue.remove(index).map(|(_, message)| message)
    }

    fn update(&mut self, now: Nanos) -> bool {
        let mut came = false;
        while let Some((message, _)) = self.take(now) {
            self.newest = Some(message);
            came = true;
        }
        came
    }

    fn counts(&self) -> &Refusals {
        self.admission.counts()
    }
}

/// One direction of the line: bytes that arrive a while later.
#[derive(Debug, Default)]
pub struct ByteQueue {
    delay: Nanos,
    room: usize,
    pieces: VecDeque<(Nanos, usize)>,
    bytes: VecDeque<u8>,
}

impl ByteQueue {
    /// A line that takes `delay` and holds `room` bytes; what it has no room for is lost.
    pub fn new(delay: Nanos, room: usize) -> Self {
        Self { delay, room, ..Self::default() }
    }

    /// Puts bytes in at `now`.
    pub fn put(&mut self, now: Nanos, bytes: &[u8]) {
        if self.bytes.len() + bytes.len() > self.room {
            return;
        }
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
            let (front, back) = self.bytes.as_slices();
            let in_front = length.min(front.len());
            out.extend_from_slice(&front[..in_front]);
            out.extend_from_slice(&back[..length - in_front]);
            self.bytes.drain(..length);
        }
    }
}
