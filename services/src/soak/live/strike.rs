//! What is done to which process, and when: at random, or through every process, signal and mode.

use std::collections::VecDeque;

use kerbside_messages::{Mode, Nanos, Process};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::super::Faults;
use crate::lockstep::VICTIMS;

const MS: Nanos = 1_000_000;
/// Pauses between two faults \[ns\].
const PAUSE: (Nanos, Nanos) = (1_500 * MS, 9_000 * MS);
/// A process that is struck more often within the window is given up: the restart policy's own limit, less one.
const OFTEN: usize = 3;
/// See [`OFTEN`] \[ns\].
const WINDOW: Nanos = 35_000 * MS;
/// Stalls last from so long, beyond every time-out, to so long \[ns\].
const STALL: (Nanos, Nanos) = (450 * MS, 2_500 * MS);
/// Every fifth stall is shorter than any time-out \[ns\].
const SHORT: (Nanos, Nanos) = (10 * MS, 60 * MS);

/// What is done to a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Blow {
    /// SIGKILL.
    Kill,
    /// SIGSTOP, and SIGCONT so much later \[ns\].
    Stall(Nanos),
}

impl Blow {
    /// A word for counting.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kill => "kill",
            Self::Stall(_) => "stall",
        }
    }

    /// Whether the vehicle has to stop when it hits `process`.
    #[must_use]
    pub fn must_stop(self, process: Process) -> bool {
        let vital = process.on_control_path() || process == Process::Supervisor;
        vital && !matches!(self, Self::Stall(span) if span < STALL.0)
    }
}

/// A process, what is done to it, and in which mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Aim {
    /// Whom.
    pub process: Process,
    /// What.
    pub blow: Blow,
    /// When.
    pub mode: Mode,
}

/// What is to be done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Strike.
    Strike(Process, Blow),
    /// Have the operator stop the vehicle: the mode aimed at follows.
    Stop,
    /// Kill this one first: the mode aimed at follows.
    First(Process),
    /// Start the stack anew: the mode aimed at is its first.
    StartAnew,
    /// The mode aimed at did not come: nobody is struck.
    Miss(Process, Blow, Mode),
}

/// What is seen of the stack when a wish is made.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// The present.
    pub now: Nanos,
    /// The mode.
    pub mode: Mode,
    /// True speed \[m/s\].
    pub speed: f64,
    /// Every process beats.
    pub healthy: bool,
    /// A bit for each process that exists.
    pub alive: u16,
}

impl Sight {
    fn exists(&self, process: Process) -> bool {
        self.alive & (1 << process as u8) != 0
    }
}

/// Chooses what to strike.
#[derive(Debug)]
pub enum Choice {
    /// Nothing.
    Nothing,
    /// By chance.
    Random(Box<Random>),
    /// One after the other.
    Matrix(Matrix),
}

impl Choice {
    /// What to do now, while nothing else is under way.
    pub fn wish(&mut self, sight: &Sight) -> Option<Wish> {
        match self {
            Self::Nothing => None,
            Self::Random(random) => random.wish(sight),
            Self::Matrix(matrix) => matrix.wish(sight),
        }
    }

    /// Whether there is nothing left to do.
    #[must_use]
    pub fn is_done(&self) -> bool {
        matches!(self, Self::Matrix(matrix) if matrix.queue.is_empty())
    }
}

/// Strikes by chance: four times out of five a vehicle that drives.
#[derive(Debug)]
pub struct Random {
    random: Pcg64,
    faults: Faults,
    due: Nanos,
    driving: bool,
    struck: VecDeque<(Nanos, Process)>,
}

impl Random {
    /// A choice of `faults` by `seed`.
    #[must_use]
    pub fn new(faults: Faults, seed: u64) -> Self {
        let random = Pcg64::seed_from_u64(seed ^ 0x57a1_1ed0_0000);
        Self { random, faults, due: 0, driving: true, struck: VecDeque::new() }
    }

    fn wish(&mut self, sight: &Sight) -> Option<Wish> {
        if self.due == 0 {
            self.plan(sight.now);
        }
        let drives = sight.mode == Mode::Driving && sight.speed.abs() > 0.05;
        if sight.now < self.due || (self.driving && !drives) || !sight.healthy {
            return None;
        }
        self.plan(sight.now);
        let (process, blow) = (self.victim(sight.now), self.blow());
        self.struck.push_back((sight.now, process));
        Some(Wish::Strike(process, blow))
    }

    fn plan(&mut self, now: Nanos) {
        self.due = now + self.random.random_range(PAUSE.0..PAUSE.1);
        self.driving = self.random.random_range(0..5) > 0;
    }

    fn victim(&mut self, now: Nanos) -> Process {
        while self.struck.front().is_some_and(|(at, _)| now - at > WINDOW) {
            self.struck.pop_front();
        }
        let drawn = match self.random.random_range(0..40) {
            0 => Process::Supervisor,
            1 => Process::Vehicle,
            other => VICTIMS[other % VICTIMS.len()],
        };
        let often = |process| self.struck.iter().filter(|(_, hit)| *hit == process).count();
        if often(drawn) < OFTEN {
            return drawn;
        }
        VICTIMS.into_iter().min_by_key(|process| often(*process)).unwrap_or(drawn)
    }

    fn blow(&mut self) -> Blow {
        let kills = match self.faults {
            Faults::Kill => true,
            Faults::Stall => false,
            Faults::All | Faults::None => self.random.random_bool(0.5),
        };
        if kills {
            return Blow::Kill;
        }
        let range = if self.random.random_range(0..5) == 0 { SHORT } else { STALL };
        Blow::Stall(self.random.random_range(range.0..range.1))
    }
}

/// Every process, killed and stopped, in every mode.
#[derive(Debug)]
pub struct Matrix {
    queue: VecDeque<Aim>,
    /// What had to come first was done at.
    prepared: Option<Nanos>,
    /// The first of the queue is waited for since.
    since: Option<Nanos>,
    /// A mode that was given up: done, where the vehicle stands at its plan's end, lasts a cycle.
    absent: Option<Mode>,
}

/// The modes of a running stack.
pub const MODES: [Mode; 7] = [
    Mode::Starting,
    Mode::Ready,
    Mode::Armed,
    Mode::Driving,
    Mode::Done,
    Mode::Stopping,
    Mode::Faulted,
];

/// What is waited for at most so long after what had to come first \[ns\].
const PATIENCE: Nanos = 4_000 * MS;
/// A mode that has not come for so long is given up: several manoeuvres \[ns\].
const GIVEN_UP: Nanos = 120_000 * MS;

impl Matrix {
    /// The whole matrix.
    #[must_use]
    pub fn whole() -> Self {
        let mut processes = VICTIMS.to_vec();
        processes.push(Process::Supervisor);
        let aims = MODES.into_iter().flat_map(|mode| {
            processes.clone().into_iter().flat_map(move |process| {
                [Blow::Kill, Blow::Stall(1_500 * MS)].map(|blow| Aim { process, blow, mode })
            })
        });
        Self { queue: aims.collect(), prepared: None, since: None, absent: None }
    }

    /// How many there are to go.
    #[cfg(test)]
    fn left(&self) -> usize {
        self.queue.len()
    }

    fn wish(&mut self, sight: &Sight) -> Option<Wish> {
        let aim = *self.queue.front()?;
        if sight.mode == aim.mode && sight.exists(aim.process) && self.is_reached(&aim, sight) {
            self.queue.pop_front();
            (self.prepared, self.since) = (None, None);
            return Some(Wish::Strike(aim.process, aim.blow));
        }
        let waited = sight.now - *self.since.get_or_insert(sight.now);
        if waited > GIVEN_UP || self.absent == Some(aim.mode) {
            self.absent = Some(aim.mode);
            self.queue.pop_front();
            (self.prepared, self.since) = (None, None);
            return Some(Wish::Miss(aim.process, aim.blow, aim.mode));
        }
        if self.prepared.is_some_and(|at| sight.now - at < PATIENCE) {
            return None;
        }
        let drives = sight.mode == Mode::Driving && sight.speed.abs() > 0.05;
        let wish = match aim.mode {
            Mode::Starting if sight.healthy => Wish::StartAnew,
            Mode::Stopping if drives => Wish::Stop,
            Mode::Faulted if drives => {
                let another = aim.process == Process::Tracker;
                Wish::First(if another { Process::Ingest } else { Process::Tracker })
            }
            _ => return None,
        };
        self.prepared = Some(sight.now);
        Some(wish)
    }

    fn is_reached(&self, aim: &Aim, sight: &Sight) -> bool {
        match aim.mode {
            Mode::Starting => true,
            Mode::Driving => sight.speed.abs() > 0.05 && sight.healthy,
            Mode::Stopping | Mode::Faulted => self.prepared.is_some(),
            _ => sight.healthy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(now: Nanos, mode: Mode) -> Sight {
        Sight { now, mode, speed: 0.2, healthy: true, alive: u16::MAX }
    }

    #[test]
    fn the_matrix_has_every_process_signal_and_mode_once() {
        let mut matrix = Matrix::whole();
        assert_eq!(matrix.left(), 8 * 2 * 7);
        let mut now = MS;
        let mut struck = Vec::new();
        while matrix.left() > 0 {
            for mode in MODES {
                now += MS;
                if let Some(Wish::Strike(process, blow)) = matrix.wish(&sight(now, mode)) {
                    struck.push((process, blow.name(), mode));
                }
            }
        }
        struck.sort_by_key(|(process, blow, mode)| (*process, *blow, *mode as u8));
        struck.dedup();
        assert_eq!(struck.len(), 8 * 2 * 7);
    }

    #[test]
    fn a_mode_that_never_comes_is_given_up_and_said() {
        let mut matrix = Matrix::whole();
        let first = sight(MS, Mode::Driving);
        assert_eq!(matrix.wish(&first), Some(Wish::StartAnew));
        let later = Sight { now: 2 * MS + GIVEN_UP, ..first };
        assert!(matches!(matrix.wish(&later), Some(Wish::Miss(_, Blow::Kill, Mode::Starting))));
        assert_eq!(matrix.left(), 8 * 2 * 7 - 1);
        // Its other aims are not waited for.
        let rest = (0..15).filter_map(|_| matrix.wish(&later));
        assert!(rest.into_iter().all(|wish| matches!(wish, Wish::Miss(_, _, Mode::Starting))));
        assert_eq!(matrix.left(), 8 * 2 * 6);
    }

    #[test]
    fn chance_strikes_nobody_so_often_that_it_is_given_up() {
        let mut random = Random::new(Faults::All, 3);
        let mut struck: Vec<(Nanos, Process)> = Vec::new();
        let mut now = MS;
        while struck.len() < 400 {
            now += 20 * MS;
            if let Some(Wish::Strike(process, _)) = random.wish(&sight(now, Mode::Driving)) {
                struck.push((now, process));
            }
        }
        for (index, (at, process)) in struck.iter().enumerate() {
            let within = |(earlier, other): &&(Nanos, Process)| {
                other == process && at - earlier <= 30_000 * MS
            };
            let often = struck[..index].iter().filter(within).count();
            assert!(often < 4, "{process} for the {often}th time");
        }
    }

    #[test]
    fn short_stalls_need_not_stop_anything() {
        assert!(Blow::Kill.must_stop(Process::Tracker));
        assert!(Blow::Stall(500 * MS).must_stop(Process::Supervisor));
        assert!(!Blow::Stall(50 * MS).must_stop(Process::Tracker));
        assert!(!Blow::Kill.must_stop(Process::Recorder));
        assert!(!Blow::Kill.must_stop(Process::Vehicle));
    }
}
