use super::*;
use kerbside_messages::text::from_str;
use kerbside_messages::{Mode, TrackingStop};

const MS: Nanos = 1_000_000;
const STEP: Nanos = 5 * MS;

const LIMITS: Limits =
    Limits { speed: 0.5, acceleration: 0.3, deceleration: 0.4, steering: 0.5, steering_rate: 1.0 };

fn header(sent: Nanos) -> Header {
    Header { sent, stamp: sent, origin: sent, sequence: 9, epoch: 1, ..Header::default() }
}

fn permit(arm: u64, granted: bool, sent: Nanos) -> Permit {
    Permit {
        header: header(sent),
        arm,
        expiry: sent + 150 * MS,
        mode: Mode::Driving.code(),
        granted: u8::from(granted),
        ..Permit::default()
    }
}

fn command(arm: u64, sent: Nanos) -> Command {
    let phase = TrackingPhase::Tracking.code();
    Command { header: header(sent), speed: 0.2, steering: 0.3, arm, phase, ..Command::default() }
}

/// A gate with its clock, fed with fresh samples unless a test says otherwise.
struct Bench {
    gate: Gate,
    now: Nanos,
    out: Actuator,
}

impl Bench {
    fn new() -> Self {
        let gate = Gate::new(&LIMITS, &SafetySettings::default());
        Self { gate, now: 1_000 * MS, out: Actuator::default() }
    }

    /// Has seen that nothing is permitted yet.
    fn closed() -> Self {
        let mut bench = Self::new();
        bench.step(None, Some(permit(0, false, bench.now)));
        bench
    }

    /// Follows commands of arm 1 at their speed.
    fn following() -> Self {
        let mut bench = Self::closed();
        bench.drive(1, 200);
        assert_eq!((bench.out.speed, bench.out.latch), (0.2, 0));
        bench
    }

    fn inputs(&mut self, inputs: GateInputs<'_>) -> Actuator {
        self.now += STEP;
        self.gate.step(self.now, inputs, &mut self.out);
        self.out
    }

    fn step(&mut self, command: Option<Command>, permit: Option<Permit>) -> Actuator {
        let (command, permit) = (command.as_ref(), permit.as_ref());
        self.inputs(GateInputs { command, permit, ..GateInputs::default() })
    }

    fn drive(&mut self, arm: u64, steps: u32) -> Actuator {
        for _ in 0..steps {
            let now = self.now + STEP;
            self.step(Some(command(arm, now)), Some(permit(arm, true, now)));
        }
        self.out
    }

    fn reason(&self) -> Option<AlterReason> {
        AlterReason::from_code(self.out.reason)
    }

    fn latch(&self) -> Option<AlterReason> {
        AlterReason::from_code(self.out.latch)
    }

    /// Shut for this reason: the ramp is that of the limits, the steering is held, and neither
    /// permit nor commands of the same arm open again; one of the next arm does.
    fn assert_latched(mut self, reason: AlterReason) {
        assert_eq!(self.latch(), Some(reason));
        let steering = self.out.steering;
        let ramp = LIMITS.deceleration * seconds(STEP);
        while self.out.speed > 0.0 {
            let before = self.out.speed;
            self.drive(1, 1);
            assert!((before - self.out.speed - ramp.min(before)).abs() < 1e-12);
            assert_eq!(self.out.steering, steering);
            assert_eq!((self.reason(), self.latch()), (Some(AlterReason::Latched), Some(reason)));
        }
        assert_eq!(self.drive(1, 100).speed, 0.0);
        assert_eq!((self.out.arm, self.out.command, self.out.header.origin), (1, 0, 0));
        assert_eq!(self.drive(2, 200).speed, 0.2);
        assert_eq!((self.out.arm, self.latch()), (2, Some(AlterReason::None)));
    }
}

#[test]
fn stands_before_the_first_permit() {
    let mut bench = Bench::new();
    let now = bench.now;
    let out = bench.step(Some(command(0, now)), None);
    assert_eq!((out.speed, out.steering, out.arm, out.command), (0.0, 0.0, 0, 0));
    assert_eq!(bench.reason(), Some(AlterReason::NoPermit));
    bench.step(Some(command(0, bench.now)), Some(permit(0, true, bench.now)));
    assert_eq!(bench.reason(), Some(AlterReason::NoPermit), "arm 0 is no arm");
}

#[test]
fn waits_standing_for_the_first_command_of_the_arm_without_latching() {
    let mut bench = Bench::closed();
    for _ in 0..100 {
        let now = bench.now + STEP;
        let old = command(0, now);
        let out = bench.step(Some(old), Some(permit(1, true, now)));
        assert_eq!((out.speed, out.latch, out.arm), (0.0, 0, 1));
    }
    assert_eq!(bench.reason(), Some(AlterReason::CommandStale));
    let stale = command(1, bench.now - 200 * MS);
    assert_eq!(bench.step(Some(stale), Some(permit(1, true, bench.now))).latch, 0);
    let out = bench.drive(1, 1);
    assert!(out.speed > 0.0);
    assert_eq!((out.command, out.header.origin, out.header.stamp), (9, bench.now, bench.now));
}

#[test]
fn a_gate_that_starts_under_a_granted_permit_waits_for_the_next_arm() {
    let mut bench = Bench::new();
    assert_eq!(bench.drive(1, 100).speed, 0.0);
    bench.assert_latched(AlterReason::Latched);
}

#[test]
fn latches_when_the_permit_ends() {
    let mut bench = Bench::following();
    let old = permit(1, true, bench.now);
    for _ in 0..29 {
        let fresh = command(1, bench.now + STEP);
        assert_eq!(bench.step(Some(fresh), Some(old)).latch, 0);
    }
    let fresh = command(1, bench.now + STEP);
    bench.step(Some(fresh), Some(old));
    assert_eq!(bench.reason(), Some(AlterReason::PermitExpired), "over at its expiry");
    bench.assert_latched(AlterReason::PermitExpired);
}

#[test]
fn latches_when_the_permit_is_withdrawn_missing_or_endless() {
    let now = Bench::following().now + STEP;
    let endless = Permit { expiry: Nanos::MAX, ..permit(1, true, now - 151 * MS) };
    for bad in [Some(permit(1, false, now)), None, Some(endless), Some(permit(0, true, now))] {
        let mut bench = Bench::following();
        bench.step(Some(command(1, now)), bad);
        bench.assert_latched(AlterReason::PermitExpired);
    }
}

#[test]
fn a_permit_of_an_older_arm_is_none_and_an_arm_passed_over_does_not_open() {
    let mut bench = Bench::following();
    bench.drive(2, 100);
    bench.drive(1, 1);
    assert_eq!(bench.latch(), Some(AlterReason::PermitExpired));
    bench.step(None, Some(permit(3, false, bench.now)));
    assert_eq!(bench.drive(3, 200).speed, 0.0, "arm 3 was over when it was first seen");
    assert!(bench.drive(4, 1).speed > 0.0);
}

#[test]
fn an_arm_of_a_new_supervisor_is_newer_whatever_its_count() {
    let mut bench = Bench::following();
    bench.drive(7, 1);
    bench.step(None, None);
    let now = bench.now + STEP;
    let mut new = permit(1, true, now);
    new.header.epoch = 2;
    bench.step(Some(command(1, now)), Some(new));
    assert_eq!((bench.out.arm, bench.out.latch), (1, 0));
}

#[test]
fn latches_on_an_inhibit_until_the_next_arm_after_it() {
    let mut bench = Bench::following();
    let now = bench.now + STEP;
    let (command, permit) = (command(1, now), permit(1, true, now));
    let over = Inhibit { header: header(now), expiry: now, ..Inhibit::default() };
    let inputs = GateInputs {
        command: Some(&command),
        permit: Some(&permit),
        inhibit: Some(&over),
        invalid_command: false,
    };
    assert_eq!(bench.inputs(inputs).latch, 0, "an inhibit that is over is none");
    let inhibit = Inhibit { expiry: bench.now + 6 * MS, ..over };
    bench.inputs(GateInputs { inhibit: Some(&inhibit), ..inputs });
    assert_eq!(bench.reason(), Some(AlterReason::Inhibited));
    bench.assert_latched(AlterReason::Inhibited);
}

#[test]
fn an_inhibit_outlives_a_shorter_one_of_somebody_else() {
    let mut bench = Bench::closed();
    let long = Inhibit { expiry: Nanos::MAX, who: from_str("door"), ..Inhibit::default() };
    let short = Inhibit { expiry: 0, who: from_str("bumper"), ..Inhibit::default() };
    bench.gate.inhibit(&long);
    bench.gate.inhibit(&short);
    bench.drive(1, 1);
    assert_eq!(bench.latch(), Some(AlterReason::Inhibited));
}

#[test]
fn latches_on_stale_commands_once_one_was_followed() {
    for (sent, origin) in [(101, 0), (0, 101), (101, 101)] {
        let mut bench = Bench::following();
        let now = bench.now + STEP;
        let mut old = command(1, now);
        old.header.sent = now - sent * MS;
        old.header.origin = now - origin * MS;
        bench.step(Some(old), Some(permit(1, true, now)));
        assert_eq!(bench.reason(), Some(AlterReason::CommandStale));
        bench.assert_latched(AlterReason::CommandStale);
    }
    let mut bench = Bench::following();
    let now = bench.now + STEP;
    let limit = command(1, now - 100 * MS);
    assert_eq!(bench.step(Some(limit), Some(permit(1, true, now))).latch, 0, "fresh to the limit");
    bench.step(None, Some(permit(1, true, now)));
    bench.assert_latched(AlterReason::CommandStale);
}

#[test]
fn a_command_of_another_arm_or_of_the_far_future_does_not_keep_it_open() {
    let now = Bench::following().now + STEP;
    for other in [command(0, now), command(2, now), command(1, now + 200 * MS)] {
        let mut bench = Bench::following();
        bench.step(Some(other), Some(permit(1, true, now)));
        bench.assert_latched(AlterReason::CommandStale);
    }
}

#[test]
fn latches_on_invalid_commands() {
    let now = Bench::following().now + STEP;
    let good = command(1, now);
    let bad = [
        (good, true),
        (Command { speed: f64::NAN, ..good }, false),
        (Command { steering: f64::INFINITY, ..good }, false),
        (Command { phase: 77, ..good }, false),
    ];
    for (command, invalid_command) in bad {
        let mut bench = Bench::following();
        let permit = permit(1, true, now);
        let (command, permit) = (Some(&command), Some(&permit));
        bench.inputs(GateInputs { command, permit, invalid_command, inhibit: None });
        assert_eq!(bench.reason(), Some(AlterReason::CommandInvalid));
        bench.assert_latched(AlterReason::CommandInvalid);
    }
}

#[test]
fn latches_when_the_tracker_gives_up_even_while_waiting() {
    let stopped = |now| Command {
        phase: TrackingPhase::Stopped.code(),
        stop: TrackingStop::Corridor.code(),
        ..command(1, now)
    };
    for mut bench in [Bench::following(), Bench::closed()] {
        let now = bench.now + STEP;
        bench.step(Some(stopped(now)), Some(permit(1, true, now)));
        assert_eq!(bench.reason(), Some(AlterReason::TrackerStop));
        bench.assert_latched(AlterReason::TrackerStop);
    }
}

#[test]
fn a_finished_tracker_may_fall_silent_at_zero_speed_alone() {
    let finished =
        |speed, sent| Command { phase: TrackingPhase::Finished.code(), speed, ..command(1, sent) };
    let mut bench = Bench::following();
    let last = finished(0.0, bench.now + STEP);
    for _ in 0..300 {
        let now = bench.now + STEP;
        assert_eq!(bench.step(Some(last), Some(permit(1, true, now))).latch, 0);
    }
    assert_eq!((bench.out.speed, bench.out.command), (0.0, 0));
    let mut bench = Bench::following();
    let rolling = finished(0.1, bench.now - 101 * MS);
    bench.step(Some(rolling), Some(permit(1, true, bench.now)));
    assert_eq!(bench.latch(), Some(AlterReason::CommandStale));
}

#[test]
fn cuts_to_the_limits_and_says_so() {
    let mut bench = Bench::closed();
    for wild in [
        Command { speed: 9.0, steering: 3.0, ..command(1, 0) },
        Command { speed: -9.0, steering: -3.0, ..command(1, 0) },
        Command { speed: 0.0, steering: 0.0, ..command(1, 0) },
    ] {
        for step in 0..700 {
            let now = bench.now + STEP;
            let before = bench.out;
            let asked = Command { header: header(now), ..wild };
            let out = bench.step(Some(asked), Some(permit(1, true, now)));
            let braking = out.speed.abs() < before.speed.abs();
            let rate = if braking { LIMITS.deceleration } else { LIMITS.acceleration };
            assert!((out.speed - before.speed).abs() <= rate * seconds(STEP) + 1e-12);
            let turn = (out.steering - before.steering).abs();
            assert!(turn <= LIMITS.steering_rate * seconds(STEP) + 1e-12);
            assert!(out.speed.abs() <= LIMITS.speed && out.steering.abs() <= LIMITS.steering);
            let as_asked = out.speed == wild.speed && out.steering == wild.steering;
            let reason = if as_asked { AlterReason::None } else { AlterReason::Limited };
            assert_eq!(bench.reason(), Some(reason), "step {step}");
        }
        let end = (wild.speed.clamp(-0.5, 0.5), wild.steering.clamp(-0.5, 0.5));
        assert_eq!((bench.out.speed, bench.out.steering), end);
    }
}

#[test]
fn a_long_pause_between_steps_is_no_leave_for_a_jump() {
    let mut bench = Bench::closed();
    bench.drive(1, 1);
    bench.now += 10_000 * MS;
    let before = bench.out.speed;
    let jump = bench.drive(1, 1).speed - before;
    assert!(jump <= LIMITS.acceleration * 0.1 + 1e-12, "{jump}");
}

#[test]
fn time_running_backwards_neither_panics_nor_moves() {
    let mut bench = Bench::following();
    let before = bench.out;
    let now = bench.now;
    bench.now = 0;
    let fast = Command { speed: 0.5, ..command(1, now) };
    let out = bench.step(Some(fast), Some(permit(1, true, now)));
    assert_eq!((out.speed, out.header.stamp), (before.speed, now));
}

/// What a step may see, as classes. `arm` counts from the arm under test.
#[derive(Clone, Copy, Debug)]
struct Class {
    permit: Option<(u64, bool, Nanos)>,
    command: Option<(u64, Nanos, TrackingPhase, f64)>,
    inhibit: bool,
    invalid: bool,
    pause: Nanos,
}

fn classes() -> Vec<Class> {
    use TrackingPhase::{Finished, Stopped, Tracking};
    let permits =
        [None, Some((0, true, 0)), Some((1, true, 0)), Some((2, true, 0)), Some((1, false, 0))];
    let commands = [
        None,
        Some((1, 0, Tracking, 0.5)),
        Some((2, 0, Tracking, -0.5)),
        Some((1, 101, Tracking, 0.5)),
        Some((1, 0, Stopped, 0.5)),
        Some((1, 101, Finished, 0.0)),
    ];
    let base = Class { permit: None, command: None, inhibit: false, invalid: false, pause: 5 };
    let mut classes: Vec<Class> = permits
        .iter()
        .flat_map(|permit| commands.map(|command| Class { permit: *permit, command, ..base }))
        .collect();
    let driving = Class { permit: permits[2], command: commands[1], ..base };
    classes.extend([
        Class { inhibit: true, ..driving },
        Class { invalid: true, ..driving },
        Class { pause: 0, ..driving },
        Class { pause: 400, ..driving },
        Class { permit: Some((1, true, 150)), ..driving },
        Class { permit: Some((2, false, 0)), ..driving },
        Class { command: Some((1, 0, Tracking, f64::NAN)), ..driving },
    ]);
    classes
}

/// What the rules say of a history, written down apart from the gate.
#[derive(Clone, Copy, Default)]
struct Rule {
    /// The newest arm of any permit so far; none before the first.
    newest: Option<u64>,
    /// The arm that is open.
    open: Option<u64>,
}

impl Rule {
    /// Whether the step may move the vehicle.
    fn allows(&mut self, class: &Class) -> bool {
        let live = class.permit.filter(|(arm, granted, age)| *arm > 0 && *granted && *age < 150);
        if let (Some((arm, ..)), Some(newest)) = (live, self.newest)
            && arm > newest
        {
            self.open = Some(arm);
        }
        self.newest = self.newest.max(class.permit.map(|(arm, ..)| arm));
        let Some(open) = self.open else { return false };
        let own = class.command.filter(|(arm, ..)| *arm == open);
        let bad = own.is_some_and(|(_, _, phase, speed)| {
            phase == TrackingPhase::Stopped || !speed.is_finite()
        });
        let permitted = live.is_some_and(|(arm, ..)| arm == open);
        if !permitted || class.inhibit || class.invalid || bad {
            self.open = None;
        }
        self.open.is_some() && own.is_some_and(|(_, age, ..)| age <= 100)
    }
}

/// Every history of so many steps: what must not move brakes and holds the steering.
fn explore(gate: &Gate, now: Nanos, before: &Actuator, rule: Rule, depth: u32) -> u64 {
    if depth == 0 {
        return 1;
    }
    let mut histories = 0;
    for class in classes() {
        let (mut gate, mut rule, mut out) = (gate.clone(), rule, Actuator::default());
        let now = now + class.pause * MS;
        let permit = class.permit.map(|(arm, granted, age)| permit(arm, granted, now - age * MS));
        let command = class.command.map(|(arm, age, phase, speed)| Command {
            speed,
            phase: phase.code(),
            ..command(arm, now - age * MS)
        });
        let inhibit = Inhibit { expiry: now + 1, ..Inhibit::default() };
        let inputs = GateInputs {
            command: command.as_ref(),
            permit: permit.as_ref(),
            inhibit: class.inhibit.then_some(&inhibit),
            invalid_command: class.invalid,
        };
        gate.step(now, inputs, &mut out);
        let allowed = rule.allows(&class);
        if !allowed {
            let ramp = LIMITS.deceleration * seconds(class.pause * MS);
            let expected = (before.speed.abs() - ramp).max(0.0) * before.speed.signum();
            assert!((out.speed - expected).abs() < 1e-12, "{class:?}: {before:?} {out:?}");
            assert_eq!(out.steering, before.steering, "{class:?}");
            assert_eq!(out.command, 0);
        }
        // A stop by staleness is the gate's alone to know: its latch is believed.
        if out.latch == AlterReason::CommandStale.code() {
            rule.open = None;
        }
        assert_eq!(rule.open.is_some(), out.latch == 0 && out.arm != 0, "{class:?} {out:?}");
        histories += explore(&gate, now, &out, rule, depth - 1);
    }
    histories
}

#[test]
fn without_a_live_permit_of_an_open_arm_only_a_stop_ramp_comes_out() {
    let mut from_start = Bench::new();
    let histories = explore(&from_start.gate, 1_000 * MS, &Actuator::default(), Rule::default(), 4);
    let bench = Bench::following();
    let rule = Rule { newest: Some(1), open: Some(1) };
    let histories = histories + explore(&bench.gate, bench.now, &bench.out, rule, 4);
    assert_eq!(histories, 2 * 37_u64.pow(4));
    assert_eq!(from_start.step(None, None).speed, 0.0);
}
