//! Every order of every kind of event, to a depth, from every mode.
//!
//! States are told apart by all they consist of, so a state reached twice is gone on from once.

use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use kerbside_messages::{
    Actuator, AlterReason, Command, EstimatorState, Header, Heartbeat, Inhibit, Mode, Odometry,
    ResetReason, TrackingPhase, Verb,
};

use super::watch::Life;
use super::world::{MS, stop_times};
use super::*;

/// One of each kind: control path of our own, control path started elsewhere, and a slow one.
const PROCESSES: [Supervised; 3] = [
    Supervised { process: Process::Estimator, external: false },
    Supervised { process: Process::Tracker, external: true },
    Supervised { process: Process::Planner, external: false },
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Beat {
    Good,
    Unready,
    Failed,
    Late,
    Disorder,
    NewLife,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Move {
    /// All that live beat and are ready, the vehicle stands or rolls, and a cycle is over.
    Cycle {
        standing: bool,
    },
    /// Nothing is heard for so many ms, then a cycle is over.
    Silence(Nanos),
    Spawned(Process),
    SpawnFailed(Process),
    Exited(Process),
    Beats(Process, Beat),
    Pose(EstimatorState, ResetReason, bool),
    Track(TrackingPhase, bool),
    Gate(AlterReason, bool),
    Inhibit,
    Ask(Verb),
}

fn moves() -> Vec<Move> {
    use EstimatorState::{Lost, Unset, Valid};
    use TrackingPhase::{Finished, Stopped, Tracking};
    let mut moves = vec![
        Move::Cycle { standing: true },
        Move::Cycle { standing: false },
        Move::Silence(10),
        Move::Silence(250),
        Move::Silence(2_500),
        Move::Silence(31_000),
        Move::Pose(Valid, ResetReason::Fix, false),
        Move::Pose(Lost, ResetReason::CounterReset, false),
        Move::Pose(Unset, ResetReason::None, true),
        Move::Pose(Valid, ResetReason::Restored, true),
        Move::Track(Tracking, true),
        Move::Track(Tracking, false),
        Move::Track(Finished, true),
        Move::Track(Stopped, true),
        Move::Track(Stopped, false),
        Move::Gate(AlterReason::None, true),
        Move::Gate(AlterReason::Inhibited, true),
        Move::Gate(AlterReason::CommandStale, true),
        Move::Gate(AlterReason::CommandStale, false),
        Move::Inhibit,
        Move::Ask(Verb::Arm),
        Move::Ask(Verb::Stop),
        Move::Ask(Verb::Down),
    ];
    for Supervised { process, .. } in PROCESSES {
        moves.extend([Move::Spawned(process), Move::SpawnFailed(process), Move::Exited(process)]);
        let beats =
            [Beat::Good, Beat::Unready, Beat::Failed, Beat::Late, Beat::Disorder, Beat::NewLife];
        moves.extend(beats.map(|beat| Move::Beats(process, beat)));
    }
    moves
}

fn fingerprint(s: &Supervisor) -> u64 {
    let mut hasher = DefaultHasher::new();
    (s.now, &s.watches, s.mode, s.since, s.why.cause, s.why.culprit).hash(&mut hasher);
    (s.after, s.arms, &s.motion, &s.inhibits, s.ending).hash(&mut hasher);
    hasher.finish()
}

fn header(s: &Supervisor, epoch: u64) -> Header {
    Header { sent: s.now, stamp: s.now, epoch, sequence: 1, ..Header::default() }
}

/// A heartbeat that follows the process's newest one.
fn beat(s: &Supervisor, process: Process, kind: Beat) -> Heartbeat {
    let watch = s.watches.iter().find(|watch| watch.process == process).expect("supervised");
    let new_life = u32::from(kind == Beat::NewLife);
    Heartbeat {
        header: header(s, watch.epoch),
        misses: watch.beats.misses + if kind == Beat::Late { 5 } else { 0 },
        disorders: u32::from(kind == Beat::Disorder),
        process: process as u8,
        pid: watch.pid + new_life,
        ready: u8::from(kind != Beat::Unready),
        failed: u8::from(kind == Beat::Failed),
        ..Heartbeat::default()
    }
}

fn odometry(s: &Supervisor, standing: bool) -> Odometry {
    let epoch = s.motion.epoch().unwrap_or(1);
    Odometry {
        header: header(s, epoch),
        state: EstimatorState::Valid.code(),
        reset_reason: ResetReason::Fix.code(),
        standstill: u8::from(standing),
        ..Odometry::default()
    }
}

/// Makes the move; returns the supervisor after it and all it asked for.
fn make(before: &Supervisor, event: Move) -> (Supervisor, Vec<Action>) {
    let mut s = before.clone();
    let (mut actions, mut all) = (Actions::default(), Vec::new());
    let mut step = |s: &mut Supervisor, event: Event<'_>| {
        let now = s.now;
        s.step(now, event, &mut actions);
        all.extend_from_slice(actions.as_slice());
    };
    match event {
        Move::Cycle { standing } => {
            s.now += 10 * MS;
            for Supervised { process, .. } in PROCESSES {
                let beat = beat(&s, process, Beat::Good);
                step(&mut s, Event::Heartbeat(&beat));
            }
            let odometry = odometry(&s, standing);
            step(&mut s, Event::Odometry(&odometry));
            step(&mut s, Event::Tick);
        }
        Move::Silence(ms) => {
            s.now += ms * MS;
            step(&mut s, Event::Tick);
        }
        Move::Spawned(process) => {
            let pid = 100 + s.watches.iter().map(|watch| watch.pid).max().unwrap_or(0);
            step(&mut s, Event::Spawned { process, pid });
        }
        Move::SpawnFailed(process) => step(&mut s, Event::SpawnFailed { process }),
        Move::Exited(process) => step(&mut s, Event::Exited { process, exit: Exit::Signal(9) }),
        Move::Beats(process, kind) => {
            let beat = beat(&s, process, kind);
            step(&mut s, Event::Heartbeat(&beat));
        }
        Move::Pose(state, reset, new_life) => {
            let mut odometry = odometry(&s, true);
            odometry.header.epoch += u64::from(new_life);
            (odometry.state, odometry.reset_reason) = (state.code(), reset.code());
            step(&mut s, Event::Odometry(&odometry));
        }
        Move::Track(phase, own) => {
            let arm = s.arms + u64::from(!own);
            let phase = phase.code();
            step(&mut s, Event::Command(&Command { arm, phase, ..Command::default() }));
        }
        Move::Gate(latch, own) => {
            let (header, arm) = (header(&s, 1), s.arms + u64::from(!own));
            let latch = latch.code();
            step(&mut s, Event::Actuator(&Actuator { header, arm, latch, ..Actuator::default() }));
        }
        Move::Inhibit => {
            let expiry = s.now + 1_000 * MS;
            step(&mut s, Event::Inhibit(&Inhibit { expiry, ..Inhibit::default() }));
        }
        Move::Ask(verb) => step(&mut s, Event::Operator { id: 1, verb }),
    }
    (s, all)
}

/// What a move means by the rules, told without the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    /// Nothing that forbids motion.
    Nothing,
    /// The vehicle stops; `ready` may follow.
    Stop,
    /// The vehicle stops; only an arm leads on.
    Fault,
}

fn meaning(s: &Supervisor, event: Move) -> Meaning {
    let control = |process: Process| process.on_control_path();
    let watch = |process| s.watches.iter().find(|w| w.process == process).expect("supervised");
    let listened = |process| {
        let life = watch(process).life;
        control(process) && matches!(life, Life::Starting { .. } | Life::Running { .. })
    };
    let ran = |process| matches!(watch(process).life, Life::Running { .. });
    let fault = match event {
        Move::Exited(process) => control(process) && watch(process).is_child(),
        Move::Beats(process, Beat::Failed) => listened(process),
        Move::Beats(process, Beat::Disorder) => {
            listened(process) && watch(process).beats.last.is_some()
        }
        Move::Beats(process, Beat::Late | Beat::Unready) => {
            ran(process) && control(process) && watch(process).beats.ready
        }
        Move::Beats(process, Beat::NewLife) => {
            control(process) && watch(process).external && watch(process).pid != 0
        }
        Move::Silence(ms) => {
            let silent = |w: &Watch| w.beats.last.is_some_and(|l| s.now + ms * MS > l + 200 * MS);
            s.watches.iter().any(|w| ran(w.process) && control(w.process) && silent(w))
        }
        Move::Pose(state, _, new_life) => {
            (new_life && s.motion.epoch().is_some())
                || (state != EstimatorState::Valid && s.mode != Mode::Done)
        }
        Move::Track(TrackingPhase::Stopped, own) => own,
        Move::Gate(latch, own) => {
            own && !matches!(latch, AlterReason::None | AlterReason::Inhibited)
        }
        _ => false,
    };
    if fault {
        return Meaning::Fault;
    }
    match event {
        Move::Inhibit
        | Move::Gate(AlterReason::Inhibited, true)
        | Move::Ask(Verb::Stop | Verb::Down) => Meaning::Stop,
        _ => Meaning::Nothing,
    }
}

/// The arrows of the mode diagram; `done` and `stopping` may end within the event that began them.
fn may_follow(from: Mode, to: Mode) -> bool {
    use Mode::{Armed, Done, Down, Driving, Faulted, Ready, Starting, Stopping};
    from == to
        || matches!(
            (from, to),
            (Starting, Ready | Faulted | Down)
                | (Ready, Armed | Faulted | Down)
                | (Armed, Driving | Done | Stopping | Ready | Faulted | Down)
                | (Driving, Done | Stopping | Ready | Faulted | Down)
                | (Done, Ready | Stopping | Faulted | Down)
                | (Stopping, Ready | Faulted | Down)
                | (Faulted, Armed | Down)
        )
}

fn check(before: &Supervisor, event: Move, after: &Supervisor, actions: &[Action]) {
    let context = || format!("{event:?}: {} to {} {:?}", before.mode, after.mode, after.why);
    assert!(may_follow(before.mode, after.mode), "{}", context());
    let moving = matches!(after.mode, Mode::Armed | Mode::Driving | Mode::Done);
    assert_eq!(after.permits(), moving, "{}", context());
    let armed = after.permits() && !before.permits();
    assert_eq!(armed, after.arms != before.arms, "{}", context());
    if armed {
        assert_eq!((event, after.mode), (Move::Ask(Verb::Arm), Mode::Armed));
        assert_eq!(after.arms, before.arms + 1);
        assert!(before.is_healthy() && after.motion.pose(after.now, 100 * MS).is_some());
    }
    if after.mode == Mode::Driving && before.mode != Mode::Driving {
        assert!(matches!(event, Move::Track(TrackingPhase::Tracking, true)), "{}", context());
    }
    let meaning = meaning(before, event);
    if before.permits() && meaning != Meaning::Nothing {
        assert!(!after.permits(), "{}", context());
    }
    let bound_to_fault = before.mode == Mode::Stopping && before.after == Mode::Faulted;
    if meaning == Meaning::Fault && before.permits() || bound_to_fault {
        let stopping = after.mode == Mode::Stopping && after.after == Mode::Faulted;
        let faulted = matches!(after.mode, Mode::Faulted | Mode::Down);
        assert!(stopping || faulted, "{}", context());
    }
    for action in actions {
        if let Action::Kill(process) | Action::Terminate(process) | Action::Spawn(process) = action
        {
            assert_ne!(*process, Process::Tracker, "external: {}", context());
        }
        assert!(before.mode != Mode::Down || !matches!(action, Action::Spawn(_)), "{}", context());
    }
}

/// Ticks alone: nothing hangs.
fn check_liveness(s: &Supervisor) {
    let mut s = s.clone();
    // Half a minute for a plan, a window of silence, and a stop.
    for _ in 0..340 {
        s.now += 100 * MS;
        s.step(s.now, Event::Tick, &mut Actions::default());
    }
    let steady = matches!(s.mode, Mode::Starting | Mode::Ready | Mode::Faulted);
    let ended = s.mode == Mode::Down && s.ending.is_some();
    assert!(steady || ended, "{s:?}");
    // Children that never end are the kernel's; that they were told to is ours.
    assert!(!ended || s.processes_end());
}

/// One supervisor in each mode, by the shortest way, checked on the way.
fn seeds() -> Vec<Supervisor> {
    let cycles = [Move::Cycle { standing: true }; 3];
    let start = [
        Move::Silence(10),
        Move::Spawned(Process::Estimator),
        Move::Spawned(Process::Planner),
        Move::Beats(Process::Tracker, Beat::NewLife),
    ];
    let ready: Vec<_> = start.into_iter().chain(cycles).collect();
    let and = |from: &[Move], more: &[Move]| [from, more].concat();
    let armed = and(&ready, &[Move::Ask(Verb::Arm)]);
    let track = Move::Track(TrackingPhase::Tracking, true);
    let driving = and(&armed, &[track, Move::Cycle { standing: false }]);
    let done = and(&driving, &[Move::Track(TrackingPhase::Finished, true)]);
    let stopping = and(&driving, &[Move::Ask(Verb::Stop)]);
    let failing = and(&driving, &[Move::Exited(Process::Estimator)]);
    let faulted = and(&driving, &[Move::Track(TrackingPhase::Stopped, true), cycles[0]]);
    let down = and(&driving, &[Move::Ask(Verb::Down)]);
    let ways =
        [vec![], start.to_vec(), ready, armed, driving, done, stopping, failing, faulted, down];
    ways.into_iter().map(|way| way.into_iter().fold(fresh_supervisor(), walk)).collect()
}

fn fresh_supervisor() -> Supervisor {
    let mut s = Supervisor::new(&SafetySettings::default(), &PROCESSES, stop_times(), 1);
    s.now = 1_000 * MS;
    s
}

fn walk(s: Supervisor, event: Move) -> Supervisor {
    let (after, actions) = make(&s, event);
    check(&s, event, &after, &actions);
    after
}

#[test]
fn the_seeds_stand_in_every_mode() {
    let modes: Vec<_> = seeds().iter().map(|s| s.mode).collect();
    for mode in Mode::ALL {
        assert!(modes.contains(mode), "{mode}: {modes:?}");
    }
}

/// All orders of `depth` of these moves from every mode; returns how many transitions were checked.
fn explore(moves: &[Move], depth: u32) -> u64 {
    let mut known = HashSet::new();
    let mut frontier = seeds();
    let mut transitions = 0;
    for left in (0..depth).rev() {
        let mut next = Vec::new();
        for (before, event) in frontier.iter().flat_map(|s| moves.iter().map(move |m| (s, *m))) {
            let (after, actions) = make(before, event);
            check(before, event, &after, &actions);
            transitions += 1;
            if left > 0 && known.insert(fingerprint(&after)) {
                next.push(after);
            }
        }
        // One in so many is enough to run on alone: neighbours differ by an event.
        next.iter().step_by(11).for_each(check_liveness);
        frontier = next;
    }
    transitions
}

#[test]
fn every_order_of_events_keeps_the_rules() {
    let transitions = explore(&moves(), 3);
    assert!(transitions > 250_000, "{transitions}");
}

#[test]
fn longer_orders_of_the_events_that_lead_far_keep_them_too() {
    use TrackingPhase::{Finished, Stopped, Tracking};
    let far = [
        Move::Cycle { standing: true },
        Move::Silence(2_500),
        Move::Exited(Process::Estimator),
        Move::Spawned(Process::Estimator),
        Move::Beats(Process::Tracker, Beat::NewLife),
        Move::Track(Tracking, true),
        Move::Track(Finished, true),
        Move::Track(Stopped, true),
        Move::Gate(AlterReason::Inhibited, true),
        Move::Ask(Verb::Arm),
        Move::Ask(Verb::Stop),
    ];
    let transitions = explore(&far, 6);
    assert!(transitions > 300_000, "{transitions}");
}
