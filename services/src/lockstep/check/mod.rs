//! The invariants that no fault may break, checked at every tick of a simulated world from the vehicle's truth and
//! from what the processes published; never from what they believe.

mod clearance;
mod permit;
mod pose;
mod stop;

use core::fmt;

use kerbside_messages::{Mode, Nanos, State, seconds};

use super::drive::{Task, Watcher};
use super::schedule::Schedule;
use super::world::World;
use clearance::ClearanceWatch;
use permit::PermitWatch;
use pose::PoseWatch;
pub use stop::Stop;
use stop::StopWatch;

/// A manoeuvre is over at the latest so long after the last fault of its schedule \[ns\].
const VERDICT: Nanos = 180_000_000_000;

/// What no fault may break.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Invariant {
    /// Without a live permit of the current arm nothing but the stop ramp or zero reaches the vehicle.
    Permit,
    /// A stop within the distance and the time of the stop-distance inequality.
    Stop,
    /// No motion resumed without a new arm.
    Rearm,
    /// No collision.
    Collision,
    /// The estimate never jumps without an announced reset.
    Jump,
    /// Every manoeuvre ends in a verdict.
    Hang,
}

impl Invariant {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Permit, Self::Stop, Self::Rearm, Self::Collision, Self::Jump, Self::Hang];

    /// In a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Permit => "no motion without a permit",
            Self::Stop => "stop within the bound",
            Self::Rearm => "no motion resumed without an arm",
            Self::Collision => "no collision",
            Self::Jump => "no jump of the estimate unannounced",
            Self::Hang => "nothing hangs",
        }
    }
}

impl fmt::Display for Invariant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An invariant that was broken.
#[derive(Clone, Debug, PartialEq)]
pub struct Broken {
    /// Which.
    pub invariant: Invariant,
    /// When, in simulated time since the beginning \[ns\].
    pub at: Nanos,
    /// How.
    pub words: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} broken after {:.3} s: {}", self.invariant, seconds(self.at), self.words)
    }
}

/// Watches a manoeuvre; the first broken invariant ends it.
#[derive(Debug)]
pub struct Checker<'a> {
    deadline: Nanos,
    permit: PermitWatch,
    stop: StopWatch,
    clearance: ClearanceWatch<'a>,
    pose: PoseWatch,
    recovery: Recovery,
    broken: Option<Broken>,
}

impl<'a> Checker<'a> {
    /// A checker of `task` under `schedule`.
    #[must_use]
    pub fn new(task: &Task<'a>, schedule: &Schedule) -> Self {
        Self {
            deadline: schedule.end().saturating_add(VERDICT),
            permit: PermitWatch::new(task.service),
            stop: StopWatch::new(task.service),
            clearance: ClearanceWatch::new(task.scenario, &task.service.vehicle),
            pose: PoseWatch::new(&task.service.vehicle),
            recovery: Recovery::default(),
            broken: None,
        }
    }

    /// The invariant that was broken.
    #[must_use]
    pub fn broken(&self) -> Option<&Broken> {
        self.broken.as_ref()
    }

    /// Whether a stop is under way that has to be seen to its end.
    #[must_use]
    pub fn waits(&self) -> bool {
        self.broken.is_none() && self.stop.is_pending()
    }

    /// A manoeuvre that ended because something took too long hangs.
    pub fn timed_out(&mut self, world: &World, what: &str) {
        let words = format!("timed out: {what}");
        self.broken.get_or_insert(Broken {
            invariant: Invariant::Hang,
            at: world.elapsed(),
            words,
        });
    }

    /// The stops that were seen.
    #[must_use]
    pub fn stops(&self) -> &[Stop] {
        self.stop.done()
    }

    /// Times from a process's failure, as the supervisor saw it, to a stack that was whole again \[s\].
    #[must_use]
    pub fn recoveries(&self) -> &[f64] {
        &self.recovery.done
    }

    /// The least distance to anything solid \[m\].
    #[must_use]
    pub fn clearance(&self) -> f64 {
        self.clearance.least()
    }

    fn judge(&mut self, world: &World) -> Result<(), (Invariant, String)> {
        self.permit.look(world)?;
        self.stop.look(world, self.permit.grant())?;
        self.clearance.look(world).map_err(|words| (Invariant::Collision, words))?;
        self.pose.look(world).map_err(|words| (Invariant::Jump, words))?;
        if world.elapsed() > self.deadline {
            let mode = world.state().map_or("no state", |state| state.mode().name());
            return Err((Invariant::Hang, format!("no verdict, the mode is {mode}")));
        }
        Ok(())
    }
}

impl Watcher for Checker<'_> {
    fn tick(&mut self, world: &World) -> bool {
        if let Some(state) = &world.fresh.state {
            self.recovery.look(state);
        }
        if self.broken.is_none()
            && let Err((invariant, words)) = self.judge(world)
        {
            self.broken = Some(Broken { invariant, at: world.elapsed(), words });
        }
        self.broken.is_none()
    }

    fn planned(&mut self, _: &World) {}
}

/// Measures how long the stack is not whole.
#[derive(Debug, Default)]
struct Recovery {
    since: Option<Nanos>,
    done: Vec<f64>,
}

impl Recovery {
    fn look(&mut self, state: &State) {
        let at = state.header.sent;
        match (state.healthy == 1, self.since) {
            (true, Some(since)) => {
                self.done.push(seconds(at - since));
                self.since = None;
            }
            (false, None) if state.mode() != Mode::Starting => self.since = Some(at),
            _ => {}
        }
    }
}
