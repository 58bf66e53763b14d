//! Fuzzing: whatever a client sends to the gateway, it is a request or is refused with what is allowed; and whatever a
//! hostile peer publishes that passes the receivers' checks, the stages go on and what they say passes them too.

// A test may end loudly.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common_fuzz;

use kerbside::gateway::Lines;
use kerbside::gateway::request::{Request, parse};
use kerbside_messages::{
    Actuator, Command, Fix, Header, Inhibit, Message, Nanos, Odometry, Permit, Plan, PlanRequest,
    Restore, TrajectoryPoint, Travel,
};
use kerbside_odometry::{Estimator, EstimatorInputs};
use kerbside_planning::PlannerSettings;
use kerbside_safety::{Gate, GateInputs};
use kerbside_settings::{GatewaySettings, Stack};
use kerbside_tracking::{Tracker, TrackerInputs};
use serde_json::Value;

use common_fuzz::damaged;

/// When everything happens.
const NOW: Nanos = 5_000_000_000;
/// Longest complaint: it repeats what was sent, cut to what a person reads.
const COMPLAINT: usize = 600;

fn examples() -> Vec<Vec<u8>> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    common_fuzz::corpus(root, "gateway_lines")
}

/// The bytes as a client's, in pieces; every line in turn.
fn examine(bytes: &[u8]) {
    let mut settings = GatewaySettings::default();
    settings.line_length = 2048;
    let mut lines = Lines::new(settings.line_length as usize);
    let piece = 1 + bytes.first().map_or(0, |first| usize::from(*first));
    let mut rest = bytes;
    loop {
        match lines.take() {
            Ok(Some(line)) => {
                assert!(line.len() <= settings.line_length as usize && !line.contains(&b'\n'));
                judge(&line, &settings);
            }
            Ok(None) if rest.is_empty() => return,
            Ok(None) => {
                let (next, after) = rest.split_at(piece.min(lines.room()).min(rest.len()));
                assert!(!next.is_empty(), "no room, and no line");
                lines.push(next);
                rest = after;
            }
            Err(error) => return assert!(error.found > error.longest),
        }
    }
}

fn judge(line: &[u8], settings: &GatewaySettings) {
    let (id, request) = parse(line, NOW, settings);
    assert!(id.to_string().len() <= 64, "{id}");
    assert!(matches!(id, Value::Null | Value::String(_) | Value::Number(_)));
    match request {
        Ok(Request::Fix(fix)) => {
            assert_eq!(fix.validate(), Ok(()));
            assert!(fix.header.stamp <= NOW && fix.source == [0; 32]);
        }
        Ok(Request::Inhibit(inhibit)) => {
            assert!((NOW..=NOW + 10_000_000_000).contains(&inhibit.expiry));
            assert_eq!(inhibit.who, [0; 32]);
        }
        Ok(Request::Plan(plan)) => assert_eq!((plan.validate(), plan.id), (Ok(()), 0)),
        Ok(Request::Subscribe { rate, .. }) => {
            assert!(rate > 0.0 && rate <= settings.sample_rate);
        }
        Ok(_) => {}
        Err(complaint) => {
            assert!(!complaint.found.is_empty() && !complaint.allowed.is_empty(), "{complaint}");
            assert!(complaint.to_string().len() <= COMPLAINT, "{complaint}");
        }
    }
}

#[test]
fn gateway_lines() {
    let examples = examples();
    examples.iter().for_each(|example| examine(example));
    bolero::check!().for_each(|bytes: &[u8]| {
        examine(bytes);
        examine(&damaged(&examples, bytes));
    });
}

/// `bytes` laid over a sample of `M`; none where a receiver refuses it.
fn laid_over<M: Message>(bytes: &[u8]) -> Option<M> {
    let mut message = M::default();
    let room = bytemuck::bytes_of_mut(&mut message);
    let count = room.len().min(bytes.len());
    room[..count].copy_from_slice(&bytes[..count]);
    message.validate().is_ok().then_some(message)
}

/// A drive whose samples are partly somebody else's.
fn drive(stack: &Stack, bytes: &[u8]) {
    let safety = stack.safety(false);
    let limits = stack.vehicle.limits;
    let mut estimator = Estimator::new(&stack.vehicle, &stack.estimator).unwrap();
    let mut tracker = Tracker::new(&stack.vehicle, &stack.tracker);
    let mut gate = Gate::new(&limits, safety);
    let (mut odometry, mut command) = (Odometry::default(), Command::default());
    let mut actuator = Actuator::default();
    for (step, at) in (0..bytes.len()).step_by(64).take(64).enumerate() {
        let now = NOW + step as Nanos * 5_000_000;
        let stamped =
            |header: &mut Header| (header.stamp, header.origin, header.sent) = (now, now, now);
        let piece = &bytes[at..];
        let mut travel: Travel = laid_over(piece).unwrap_or_default();
        stamped(&mut travel.header);
        let (fix, restore) = (laid_over::<Fix>(piece), laid_over::<Restore>(piece));
        let inputs = EstimatorInputs {
            travel: &travel,
            missing: 0,
            fix: fix.as_ref(),
            restore: restore.as_ref().filter(|_| step % 7 == 3),
        };
        estimator.step(inputs, &mut odometry);
        assert_eq!(odometry.validate(), Ok(()), "{odometry:?}");
        let permit =
            Permit { arm: 1, granted: 1, expiry: now + 1_000_000_000, ..Permit::default() };
        let points: Vec<TrajectoryPoint> = piece
            .chunks_exact(size_of::<TrajectoryPoint>())
            .map(bytemuck::pod_read_unaligned)
            .collect();
        let plan = laid_over::<Plan>(piece);
        let plan = plan.as_ref().filter(|plan| plan.validate_points(&points).is_ok());
        let theirs = laid_over::<Odometry>(piece).unwrap_or(odometry);
        let plan = plan.map(|plan| (plan, &points[..]));
        let inputs = TrackerInputs { odometry: &theirs, plan, permit: Some(&permit), now };
        if tracker.step(inputs, &mut command) {
            assert_eq!(command.validate(), Ok(()), "{command:?}");
        }
        let (command, inhibit) = (laid_over::<Command>(piece), laid_over::<Inhibit>(piece));
        let permit = laid_over::<Permit>(piece);
        let inputs = GateInputs {
            command: command.as_ref(),
            permit: permit.as_ref(),
            inhibit: inhibit.as_ref(),
            invalid_command: step % 5 == 4,
        };
        gate.step(now, inputs, &mut actuator);
        assert_eq!(actuator.validate(), Ok(()), "{actuator:?}");
        assert!(actuator.speed.abs() <= limits.speed && actuator.steering.abs() <= limits.steering);
    }
}

/// A goal that somebody else made up: there is a plan, or a reason.
fn look_for(stack: &Stack, bytes: &[u8]) {
    let Some(request) = laid_over::<PlanRequest>(bytes) else { return };
    let settings = PlannerSettings { search_nodes: 200, ..stack.planner.clone() };
    let start = kerbside_geometry::Pose::default();
    match kerbside_planning::plan(&stack.vehicle, &settings, start, &request, &mut |_| {}) {
        Ok(planned) => assert_eq!(planned.head.validate_points(&planned.points), Ok(())),
        Err(failure) => assert!(!failure.to_string().is_empty()),
    }
}

/// Samples in good order, one after the other, and what is hard to compute with.
fn samples(stack: &Stack) -> Vec<Vec<u8>> {
    let fix = Fix {
        x: 1.0,
        covariance: [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4],
        ..Fix::default()
    };
    let parking = kerbside::configuration::parking(None, "garage", None).unwrap();
    let request = parking.scenario.value.plan_request(&stack.vehicle);
    let command = Command { speed: 0.1, ..Command::default() };
    let huge = [f64::MAX, 1e8, -1e8, 1e-300, f64::MIN_POSITIVE, 0.0, -0.0, 1.0].repeat(64);
    vec![
        bytemuck::bytes_of(&fix).repeat(4),
        bytemuck::bytes_of(&request).to_vec(),
        bytemuck::bytes_of(&command).repeat(8),
        bytemuck::cast_slice(&huge).to_vec(),
        vec![0; 2048],
    ]
}

#[test]
fn hostile_samples() {
    let stack = kerbside::configuration::stack(None, None).unwrap();
    let examples = samples(&stack);
    for example in &examples {
        drive(&stack, example);
        look_for(&stack, example);
    }
    let stack = core::panic::AssertUnwindSafe(stack);
    bolero::check!().for_each(|bytes: &[u8]| {
        let damaged = damaged(&examples, bytes);
        for bytes in [bytes, &damaged] {
            drive(&stack, bytes);
            look_for(&stack, bytes);
        }
    });
}
