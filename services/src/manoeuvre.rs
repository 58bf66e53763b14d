//! The operator's part of a parking manoeuvre: fix, arm, plan, watch; and after a fault, where asked to, once more.
//!
//! Pure: the live run and lockstep drive the same decisions, each with its own time.

use core::time::Duration;

use kerbside_geometry::{Vehicle, math};
use kerbside_messages::{
    Cause, EstimatorState, FixVerdict, Mode, Nanos, Odometry, OperatorAnswer, PlanAnswer,
    PlanVerdict, Process, State, text,
};

/// Nothing the operator waits for may take longer than this.
const PATIENCE: Duration = Duration::from_secs(30);
/// A request that nobody answers is sent again after so long.
const ANSWER: Duration = Duration::from_secs(1);
/// State that is older than this means that the supervisor is gone.
const STATE_AGE: Duration = Duration::from_secs(1);
/// The vehicle stands so long before the manoeuvre is judged \[s\]: besides the time its actuators take to rest.
const SETTLE: f64 = 0.5;
/// Speed below which a vehicle stands \[m/s\].
const REST: f64 = 1e-3;
/// Longest wait for a faulted stack to be whole again, before the manoeuvre is judged.
const RECOVERY: Duration = Duration::from_secs(5);
/// Longest drive beyond the plan's own duration.
const OVERTIME: Duration = Duration::from_secs(20);

/// What the operator sees at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Observation<'a> {
    /// The newest state.
    pub state: Option<&'a State>,
    /// The newest odometry.
    pub odometry: Option<&'a Odometry>,
    /// An answer to `arm` that came since the last look.
    pub armed: Option<&'a OperatorAnswer>,
    /// An answer to a plan request that came since the last look.
    pub planned: Option<&'a PlanAnswer>,
    /// The simulated vehicle ended.
    pub vehicle_lost: bool,
    /// The supervisor's process ended.
    pub supervisor_lost: bool,
    /// The person asked to stop.
    pub interrupted: bool,
}

/// What the operator does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Nothing for now.
    Watch,
    /// Publish the fix of the start.
    Fix,
    /// Ask for an arm.
    Arm,
    /// Ask for a plan under this count of arms.
    Plan {
        /// The count.
        arm: u64,
    },
    /// The manoeuvre is over.
    End(End),
}

/// How a manoeuvre ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The plan was completed and the vehicle stands.
    Completed,
    /// The stack stopped.
    Stopped(Cause),
    /// No plan was found.
    NoPlan(PlanVerdict),
    /// The pose is gone, and arming needs one.
    PoseLost,
    /// The supervisor is gone.
    SupervisorLost,
    /// The simulated vehicle is gone.
    VehicleLost,
    /// Something took longer than it may.
    TimedOut(&'static str),
    /// The person asked to stop.
    Interrupted,
}

impl core::fmt::Display for End {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Completed => f.write_str("plan completed"),
            Self::Stopped(cause) => f.write_str(cause.name()),
            Self::NoPlan(verdict) => f.write_str(verdict.name()),
            Self::PoseLost => f.write_str("pose lost"),
            Self::SupervisorLost => f.write_str("supervisor lost"),
            Self::VehicleLost => f.write_str("vehicle lost"),
            Self::TimedOut(what) => write!(f, "timed out: {what}"),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

/// Fixes that an estimate has taken: as jumps, and as the newest that was judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Taken {
    resets: u32,
    fix_sequence: u64,
}

impl Taken {
    fn of(odometry: &Odometry) -> Self {
        Self { resets: odometry.resets, fix_sequence: odometry.fix_sequence }
    }

    /// Whether the estimate has taken one since: a pose that a fix corrects does not jump.
    fn is_followed_by(self, odometry: &Odometry) -> bool {
        let verdict = FixVerdict::from_code(odometry.fix_verdict);
        let accepted = matches!(verdict, Some(FixVerdict::Accepted | FixVerdict::Widened));
        odometry.resets != self.resets || accepted && odometry.fix_sequence != self.fix_sequence
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The stack comes up, or recovers from a fault.
    Waiting,
    /// A fix was published.
    Fixing { before: Taken },
    /// An arm was asked for.
    Arming,
    /// A plan was asked for under this arm.
    Planning { arm: u64, planner_restarts: u32, refused: bool },
    /// A plan stands; the vehicle drives it.
    Driving { arm: u64 },
    /// The plan is completed; the vehicle settles.
    Settling,
    /// A fault ended the drive; what failed comes back.
    Recovering,
}

/// The operator of one manoeuvre.
#[derive(Clone, Debug)]
pub struct Manoeuvre {
    phase: Phase,
    since: Nanos,
    asked: Option<Nanos>,
    fixed: bool,
    rearm: bool,
    settle: Nanos,
    drive_limit: Nanos,
    heard: Option<(u64, Nanos)>,
}

impl Manoeuvre {
    /// A manoeuvre that begins at `now`; after a fault it is armed again where `rearm`.
    #[must_use]
    pub fn new(now: Nanos, vehicle: &Vehicle, rearm: bool) -> Self {
        Self {
            phase: Phase::Waiting,
            since: now,
            asked: None,
            fixed: false,
            rearm,
            settle: settling_time(vehicle),
            drive_limit: 0,
            heard: None,
        }
    }

    /// What is going on, in words.
    #[must_use]
    pub fn phase(&self) -> &'static str {
        match self.phase {
            Phase::Waiting => "waiting for the stack",
            Phase::Fixing { .. } => "setting the pose",
            Phase::Arming => "arming",
            Phase::Planning { .. } => "planning",
            Phase::Driving { .. } => "driving",
            Phase::Settling => "settling",
            Phase::Recovering => "recovering",
        }
    }

    /// Looks at what is there at `now` and decides.
    pub fn step(&mut self, now: Nanos, seen: &Observation<'_>) -> Act {
        if let Some(end) = self.lost(now, seen) {
            return Act::End(end);
        }
        let Some(state) = seen.state else { return self.overdue(now, "the stack does not start") };
        if state.mode() == Mode::Faulted && state.cause == Cause::GaveUp.code() {
            return Act::End(End::Stopped(Cause::GaveUp));
        }
        match self.phase {
            Phase::Waiting => self.waiting(now, state, seen),
            Phase::Fixing { before } => self.fixing(now, before, seen),
            Phase::Arming => self.arming(now, state, seen),
            Phase::Planning { arm, planner_restarts, refused } => {
                self.planning(now, state, (arm, planner_restarts, refused), seen)
            }
            Phase::Driving { arm } => self.driving(now, state, arm),
            Phase::Settling => self.settling(now, seen),
            Phase::Recovering => self.recovering(now, state, seen),
        }
    }

    /// Losses that end the manoeuvre whatever it is at.
    fn lost(&mut self, now: Nanos, seen: &Observation<'_>) -> Option<End> {
        if seen.interrupted {
            return Some(End::Interrupted);
        }
        if seen.vehicle_lost {
            return Some(End::VehicleLost);
        }
        if seen.supervisor_lost || self.state_is_old(now, seen.state) {
            return Some(End::SupervisorLost);
        }
        None
    }

    /// Judged by when a new state was last seen, so that a slow start is no loss.
    fn state_is_old(&mut self, now: Nanos, state: Option<&State>) -> bool {
        let Some(state) = state else { return false };
        match self.heard {
            Some((sequence, at)) if sequence == state.header.sequence => {
                now.saturating_sub(at) > span(STATE_AGE)
            }
            _ => {
                self.heard = Some((state.header.sequence, now));
                false
            }
        }
    }

    fn waiting(&mut self, now: Nanos, state: &State, seen: &Observation<'_>) -> Act {
        let Some(odometry) = seen.odometry else { return self.overdue(now, "no odometry comes") };
        match state.mode() {
            // A fault before the first arm stopped nothing: what counts is that all is well again.
            Mode::Ready | Mode::Faulted if state.healthy == 1 => self.whole(now, odometry),
            _ => self.overdue(now, "the stack does not become ready"),
        }
    }

    /// All processes are well: the pose is next, or the arm.
    fn whole(&mut self, now: Nanos, odometry: &Odometry) -> Act {
        if odometry.standstill == 0 {
            return self.overdue(now, "the vehicle does not come to rest");
        }
        if !self.fixed {
            self.enter(now, Phase::Fixing { before: Taken::of(odometry) });
            self.asked = Some(now);
            return Act::Fix;
        }
        if odometry.state != EstimatorState::Valid.code() {
            return self.without_pose(now, odometry);
        }
        self.enter(now, Phase::Arming);
        self.asked = Some(now);
        Act::Arm
    }

    /// A restarted estimator is about to take up the pose it had, unless that was lost for good.
    fn without_pose(&mut self, now: Nanos, odometry: &Odometry) -> Act {
        let since = *self.asked.get_or_insert(now);
        let lost = odometry.state == EstimatorState::Lost.code();
        if lost || now.saturating_sub(since) > span(ANSWER) {
            return Act::End(End::PoseLost);
        }
        Act::Watch
    }

    fn fixing(&mut self, now: Nanos, before: Taken, seen: &Observation<'_>) -> Act {
        let taken = |odometry: &Odometry| {
            before.is_followed_by(odometry) && odometry.state == EstimatorState::Valid.code()
        };
        if seen.odometry.is_some_and(taken) {
            self.fixed = true;
            self.enter(now, Phase::Arming);
            self.asked = Some(now);
            return Act::Arm;
        }
        if self.answer_is_late(now) {
            self.asked = Some(now);
            return Act::Fix;
        }
        self.overdue(now, "the fix is not taken")
    }

    fn arming(&mut self, now: Nanos, state: &State, seen: &Observation<'_>) -> Act {
        if let Some(answer) = seen.armed
            && answer.accepted == 1
        {
            let planner_restarts = restarts_of(state, Process::Planner);
            let arm = answer.arms;
            self.enter(now, Phase::Planning { arm, planner_restarts, refused: false });
            self.asked = Some(now);
            return Act::Plan { arm };
        }
        if self.answer_is_late(now) {
            let lost = |odometry: &Odometry| odometry.state != EstimatorState::Valid.code();
            if seen.odometry.is_some_and(lost) {
                return Act::End(End::PoseLost);
            }
            self.asked = Some(now);
            return Act::Arm;
        }
        self.overdue(now, "the stack refuses to arm")
    }

    fn planning(
        &mut self,
        now: Nanos,
        state: &State,
        (arm, planner_restarts, mut refused): (u64, u32, bool),
        seen: &Observation<'_>,
    ) -> Act {
        if let Some(act) = self.halted(now, state, arm) {
            return act;
        }
        if let Some(answer) = seen.planned {
            let verdict = PlanVerdict::from_code(answer.verdict).unwrap_or(PlanVerdict::Malformed);
            match verdict {
                PlanVerdict::Found => {
                    self.drive_limit = kerbside_messages::nanos(answer.duration) + span(OVERTIME);
                    self.enter(now, Phase::Driving { arm });
                    return Act::Watch;
                }
                // The vehicle may still roll out, or a predecessor's request be under way: ask again.
                PlanVerdict::Moving | PlanVerdict::Busy | PlanVerdict::NoPose => refused = true,
                other => return Act::End(End::NoPlan(other)),
            }
        }
        let restarts = restarts_of(state, Process::Planner);
        let restarted = restarts != planner_restarts && row_is_healthy(state, Process::Planner);
        if restarted || (refused && self.answer_is_late(now)) {
            self.phase = Phase::Planning { arm, planner_restarts: restarts, refused: false };
            self.asked = Some(now);
            return Act::Plan { arm };
        }
        self.phase = Phase::Planning { arm, planner_restarts, refused };
        self.overdue(now, "no plan comes")
    }

    fn driving(&mut self, now: Nanos, state: &State, arm: u64) -> Act {
        let completed = state.cause == Cause::Completed.code()
            && matches!(state.mode(), Mode::Done | Mode::Ready);
        if completed && state.arms == arm {
            self.enter(now, Phase::Settling);
            return Act::Watch;
        }
        if let Some(act) = self.halted(now, state, arm) {
            return act;
        }
        if now.saturating_sub(self.since) > self.drive_limit {
            return Act::End(End::TimedOut("the manoeuvre takes longer than its plan"));
        }
        Act::Watch
    }

    fn settling(&mut self, now: Nanos, seen: &Observation<'_>) -> Act {
        let stands = seen.odometry.is_some_and(|odometry| odometry.standstill == 1);
        if stands && now.saturating_sub(self.since) >= self.settle {
            return Act::End(End::Completed);
        }
        self.overdue(now, "the vehicle does not come to rest")
    }

    /// The stack stopped by itself: try again where asked to, else end with the cause.
    fn halted(&mut self, now: Nanos, state: &State, arm: u64) -> Option<Act> {
        let cause = Cause::from_code(state.cause).unwrap_or(Cause::None);
        // The state may be older than our arm: judge only what came after it.
        if state.arms != arm || !matches!(state.mode(), Mode::Faulted | Mode::Ready) {
            return None;
        }
        if cause == Cause::PoseLost {
            return Some(Act::End(End::PoseLost));
        }
        if cause == Cause::Operator {
            return Some(Act::End(End::Stopped(cause)));
        }
        let goes_on = self.rearm;
        self.enter(now, if goes_on { Phase::Waiting } else { Phase::Recovering });
        Some(Act::Watch)
    }

    /// The verdict is given once what failed is back: it names the cause, and what became of it.
    fn recovering(&mut self, now: Nanos, state: &State, seen: &Observation<'_>) -> Act {
        let cause = Cause::from_code(state.cause).unwrap_or(Cause::None);
        let valid = |odometry: &Odometry| odometry.state == EstimatorState::Valid.code();
        let whole = state.healthy == 1 && seen.odometry.is_some_and(valid);
        let over = now.saturating_sub(self.since) > span(RECOVERY);
        if whole || over || state.mode() == Mode::Ready {
            Act::End(End::Stopped(cause))
        } else {
            Act::Watch
        }
    }

    fn answer_is_late(&self, now: Nanos) -> bool {
        self.asked.is_none_or(|asked| now.saturating_sub(asked) > span(ANSWER))
    }

    fn overdue(&self, now: Nanos, what: &'static str) -> Act {
        if now.saturating_sub(self.since) > span(PATIENCE) {
            Act::End(End::TimedOut(what))
        } else {
            Act::Watch
        }
    }

    fn enter(&mut self, now: Nanos, phase: Phase) {
        self.phase = phase;
        self.since = now;
        self.asked = None;
    }
}

/// A lag comes to rest like an exponential: from full speed to what counts as rest.
fn settling_time(vehicle: &Vehicle) -> Nanos {
    let response = vehicle.response();
    let decay = math::ln((vehicle.limits.speed / REST).max(1.0));
    kerbside_messages::nanos(SETTLE + response.speed_delay + decay * response.speed_lag)
}

fn span(duration: Duration) -> Nanos {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn restarts_of(state: &State, process: Process) -> u32 {
    state.rows().iter().find(|row| row.process == process as u8).map_or(0, |row| row.restarts)
}

fn row_is_healthy(state: &State, process: Process) -> bool {
    let healthy = kerbside_messages::ProcessState::Healthy.code();
    state.rows().iter().any(|row| row.process == process as u8 && row.state == healthy)
}

/// What an operator asked for when it led to this mode.
fn asked_for(mode: Mode) -> &'static str {
    match mode {
        Mode::Armed | Mode::Driving => "armed",
        Mode::Down => "ended",
        _ => "stopped",
    }
}

/// The cause of the state in words, with the process it names; empty where there is none.
#[must_use]
pub fn cause_of(state: &State) -> String {
    let words = text::as_str(&state.text);
    match Cause::from_code(state.cause) {
        Some(Cause::None) => String::new(),
        Some(Cause::Operator) => format!("{} by an operator", asked_for(state.mode())),
        // The words often name the cause themselves.
        Some(cause) if words.contains(cause.name()) => words.to_owned(),
        Some(cause) if words.is_empty() => cause.name().to_owned(),
        Some(cause) => format!("{cause}: {words}"),
        None => "unknown".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(resets: u32, fix_sequence: u64, verdict: FixVerdict) -> Odometry {
        let (state, fix_verdict) = (EstimatorState::Valid.code(), verdict.code());
        let mut odometry = Odometry { resets, fix_sequence, fix_verdict, ..Odometry::default() };
        (odometry.state, odometry.standstill) = (state, 1);
        odometry
    }

    /// What the operator does after its fix, when the estimate becomes `after`.
    fn after_a_fix(after: &Odometry) -> Act {
        let before = estimate(1, 7, FixVerdict::Accepted);
        let mut state = State { healthy: 1, ..State::default() };
        state.mode = Mode::Ready.code();
        let mut manoeuvre = Manoeuvre::new(1, &Vehicle::paper_car(), true);
        let mut step = |now, odometry| {
            state.header.sequence += 1;
            let seen = Observation {
                state: Some(&state),
                odometry: Some(odometry),
                ..Observation::default()
            };
            manoeuvre.step(now, &seen)
        };
        assert_eq!(step(2, &before), Act::Fix);
        assert_eq!(step(3, &before), Act::Watch);
        step(4, after)
    }

    #[test]
    fn a_fix_that_sets_the_pose_and_one_that_corrects_it_are_taken() {
        assert_eq!(after_a_fix(&estimate(2, 1, FixVerdict::Accepted)), Act::Arm);
        assert_eq!(after_a_fix(&estimate(1, 1, FixVerdict::Accepted)), Act::Arm);
        assert_eq!(after_a_fix(&estimate(2, 1, FixVerdict::Widened)), Act::Arm);
        assert_eq!(after_a_fix(&estimate(1, 8, FixVerdict::Moving)), Act::Watch);
        assert_eq!(after_a_fix(&estimate(1, 7, FixVerdict::Accepted)), Act::Watch);
    }
}
