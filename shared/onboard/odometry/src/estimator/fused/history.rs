//! The newest past, to be gone through again: records, and states between them.

use kerbside_messages::Nanos;

use super::axles::Axle;
use super::fix::Sighting;
use super::record::Record;
use super::setup::Setup;
use super::state::{Applied, State};

/// Records kept, and records from one kept state to the next.
const RECORDS: usize = 512;
const STRIDE: u64 = 8;
const STATES: usize = RECORDS / STRIDE as usize;

/// Fixes kept.
const FIXES: usize = 32;

/// A state before a record.
#[derive(Clone, Copy, Debug)]
struct Kept {
    number: u64,
    state: State,
}

/// Rings of fixed capacity, allocated once.
#[derive(Clone, Debug)]
pub(crate) struct History {
    records: Vec<Record>,
    states: Vec<Kept>,
    fixes: [Sighting; FIXES],
    fix_count: usize,
    /// Numbers of the first record and of the next.
    first: u64,
    next: u64,
}

impl History {
    pub(crate) fn new(state: &State) -> Self {
        Self {
            records: vec![Record::default(); RECORDS],
            states: vec![Kept { number: u64::MAX, state: *state }; STATES],
            fixes: [Sighting::default(); FIXES],
            fix_count: 0,
            first: 0,
            next: 0,
        }
    }

    /// Another pose begins: what was before is not gone through again.
    pub(crate) fn forget(&mut self) {
        self.first = self.next;
        self.fix_count = 0;
    }

    /// Number of the oldest record that is kept.
    pub(crate) fn oldest(&self) -> u64 {
        self.first.max(self.next.saturating_sub(RECORDS as u64))
    }

    /// Number of the next record.
    pub(crate) fn next(&self) -> u64 {
        self.next
    }

    pub(crate) fn record(&self, number: u64) -> Option<&Record> {
        let kept = number >= self.oldest() && number < self.next;
        kept.then(|| &self.records[slot(number, RECORDS)])
    }

    /// Wheels are not believed from record `from` on.
    pub(crate) fn exclude(&mut self, from: u64, wheels: [bool; 4]) {
        for number in from.max(self.oldest())..self.next {
            let excluded = &mut self.records[slot(number, RECORDS)].excluded;
            (0..4).for_each(|wheel| excluded[wheel] |= wheels[wheel]);
        }
    }

    /// From record `from` on it is `axle` that slips.
    pub(crate) fn slip(&mut self, from: u64, axle: Axle) {
        for number in from.max(self.oldest())..self.next {
            self.records[slot(number, RECORDS)].slipping = Some(axle);
        }
    }

    /// A new record, before which the state was `state`.
    pub(crate) fn push(&mut self, record: &Record, state: &State) -> u64 {
        let number = self.next;
        self.next += 1;
        self.records[slot(number, RECORDS)] = *record;
        self.keep(number, state);
        number
    }

    /// The record that was pushed last did not tell: it never was.
    pub(crate) fn drop_newest(&mut self) {
        self.next = self.next.saturating_sub(1).max(self.first);
    }

    fn keep(&mut self, number: u64, state: &State) {
        if number.is_multiple_of(STRIDE) || number == self.first {
            self.states[slot(number / STRIDE, STATES)] = Kept { number, state: *state };
        }
    }

    /// Keeps `fix` among the others by its stamp; the oldest goes where there are too many.
    pub(crate) fn insert(&mut self, fix: &Sighting) {
        if self.fix_count == FIXES {
            self.fixes.copy_within(1.., 0);
            self.fix_count -= 1;
        }
        let kept = &self.fixes[..self.fix_count];
        let place = kept.partition_point(|other| other.stamp <= fix.stamp);
        self.fixes.copy_within(place..self.fix_count, place + 1);
        self.fixes[place] = *fix;
        self.fix_count += 1;
    }

    /// What was believed at any time was believed too surely: see [`super::joint::Joint::widen`].
    pub(crate) fn widen(&mut self, factor: f64) {
        self.states.iter_mut().for_each(|kept| kept.state.joint.widen(factor));
    }

    /// The fix under judgement is good, or it never was.
    pub(crate) fn settle(&mut self, good: bool) {
        let kept = &self.fixes[..self.fix_count];
        let Some(place) = kept.iter().position(|fix| fix.judged) else { return };
        self.fixes[place].judged = false;
        if !good {
            self.fixes.copy_within(place + 1..self.fix_count, place);
            self.fix_count -= 1;
        }
    }

    /// Number of the newest kept state that satisfies `good`.
    fn find(&self, good: impl Fn(&Kept) -> bool) -> Option<Kept> {
        let oldest = self.oldest();
        let groups = (oldest / STRIDE..=self.next.saturating_sub(1) / STRIDE).rev();
        let kept = groups.map(|group| &self.states[slot(group, STATES)]);
        kept.filter(|kept| kept.number >= oldest && kept.number < self.next)
            .find(|kept| good(kept))
            .copied()
    }

    /// Whether record `number` can be gone through again.
    pub(crate) fn reaches(&self, number: u64) -> bool {
        self.find(|kept| kept.number <= number).is_some()
    }

    /// The present state, gone through again from record `number` on; none where nothing that old
    /// is kept.
    pub(crate) fn again_from(&mut self, setup: &Setup, number: u64) -> Option<State> {
        let kept = self.find(|kept| kept.number <= number)?;
        Some(self.again(setup, kept))
    }

    /// The same from before the stamp on.
    pub(crate) fn again_before(&mut self, setup: &Setup, stamp: Nanos) -> Option<State> {
        let kept = self.find(|kept| kept.state.time < stamp)?;
        Some(self.again(setup, kept))
    }

    fn again(&mut self, setup: &Setup, kept: Kept) -> State {
        let mut state = kept.state;
        for number in kept.number..self.next {
            if number > kept.number {
                self.keep(number, &state);
            }
            self.apply(setup, &mut state, number, false);
        }
        for fix in self.fixes_until(state.time, Nanos::MAX) {
            state.correct(setup, fix);
        }
        state
    }

    /// Carries `state` over record `number` and the fixes of its time.
    pub(crate) fn apply(
        &self,
        setup: &Setup,
        state: &mut State,
        number: u64,
        hold: bool,
    ) -> Option<Applied> {
        let record = &self.records[slot(number, RECORDS)];
        // Fixes while the vehicle stood before this record.
        for fix in self.fixes_until(state.time, record.start) {
            state.correct(setup, fix);
        }
        let fixes = self.fixes_until(state.time, record.end);
        state.apply(setup, number, record, fixes, hold)
    }

    /// Fixes after `after` up to and with `until`.
    fn fixes_until(&self, after: Nanos, until: Nanos) -> &[Sighting] {
        let kept = &self.fixes[..self.fix_count];
        let begin = kept.partition_point(|fix| fix.stamp <= after);
        let end = kept.partition_point(|fix| fix.stamp <= until).max(begin);
        &kept[begin..end]
    }
}

#[allow(clippy::cast_possible_truncation)] // Below the length.
fn slot(number: u64, length: usize) -> usize {
    (number % length as u64) as usize
}
