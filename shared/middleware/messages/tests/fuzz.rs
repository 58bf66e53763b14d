//! Fuzzing: any bytes are a sample of any topic; a receiver refuses it or can use every field of it.

#[allow(clippy::unwrap_used, clippy::panic)] // The helpers of a test end loudly.
#[path = "../../../../tests/common_fuzz/mod.rs"]
mod common_fuzz;

use kerbside_messages::schema::{decode_cdr, encode_cdr};
use kerbside_messages::topics::{TABLE, layout_of};
use kerbside_messages::{
    Actuator, Admission, Command, Fix, Header, Heartbeat, Inhibit, Message, Odometry,
    OperatorAnswer, OperatorRequest, Permit, Plan, PlanAnswer, PlanRequest, Raw, Restore, State,
    TrajectoryPoint, Travel, Truth, Uptake, check_sum, text,
};

use common_fuzz::damaged;

/// `bytes` laid over a sample of `M`, all zero where they end.
fn laid_over<M: Message>(bytes: &[u8]) -> M {
    let mut message = M::default();
    let room = bytemuck::bytes_of_mut(&mut message);
    let count = room.len().min(bytes.len());
    room[..count].copy_from_slice(&bytes[..count]);
    message
}

/// A receiver's part: samples as they are, then with a seal that fits, as a hostile peer makes it.
fn receive<M: Message>(bytes: &[u8]) {
    let mut admission = Admission::<M>::default();
    let (mut refused, mut seen) = (0, 0);
    for piece in bytes.chunks(size_of::<M>().max(1)) {
        let mut message: M = laid_over(piece);
        for sealed in [false, true] {
            if sealed {
                let Header { epoch, sequence, .. } = *message.header();
                kerbside_messages::seal(&mut message, &[], epoch, sequence, 1);
            }
            seen += 1;
            match admission.admit(&message, &[], 2) {
                Ok(_) => assert_eq!(message.validate(), Ok(())),
                Err(_) => refused += 1,
            }
        }
        if M::TOPIC.protected {
            assert_eq!(message.header().check_sum, check_sum(&message, &[]));
        }
    }
    assert_eq!(admission.counts().total(), refused);
    assert!(refused <= seen);
}

/// What a receiver does with the parts of a sample that passed.
fn use_fields(bytes: &[u8]) {
    let state: State = laid_over(bytes);
    if state.validate().is_ok() {
        let _ = (state.mode(), state.rows().len(), text::as_str(&state.text));
        state.rows().iter().for_each(|row| drop(text::as_str(&row.waiting_for).to_owned()));
    }
    let request: PlanRequest = laid_over(bytes);
    if request.validate().is_ok() {
        let mut again = PlanRequest::default();
        for obstacle in request.obstacles() {
            assert!(obstacle.len() >= 3, "{}", obstacle.len());
            assert!(obstacle.iter().flatten().all(|number| number.is_finite()));
            assert!(again.push_obstacle(obstacle));
        }
    }
    let plan: Plan = laid_over(bytes);
    let points: Vec<TrajectoryPoint> = bytes
        .chunks_exact(size_of::<TrajectoryPoint>())
        .map(bytemuck::pod_read_unaligned)
        .collect();
    if plan.validate().is_ok() && plan.validate_points(&points).is_ok() {
        assert!(points.windows(2).all(|pair| pair[0].time < pair[1].time));
    }
}

/// CDR that is read is what would be written.
fn decode(bytes: &[u8]) {
    for topic in TABLE {
        if let Some((message, tail)) = decode_cdr(topic, bytes) {
            assert_eq!(message.len(), layout_of(topic).map_or(0, |layout| layout.size));
            let mut again = Vec::new();
            encode_cdr(topic, message, tail, &mut again);
            assert_eq!(again.len(), bytes.len());
        }
    }
}

fn examine(bytes: &[u8]) {
    receive::<Raw>(bytes);
    receive::<Travel>(bytes);
    receive::<Odometry>(bytes);
    receive::<Restore>(bytes);
    receive::<Fix>(bytes);
    receive::<Plan>(bytes);
    receive::<Command>(bytes);
    receive::<Permit>(bytes);
    receive::<Inhibit>(bytes);
    receive::<Actuator>(bytes);
    receive::<State>(bytes);
    receive::<Heartbeat>(bytes);
    receive::<Truth>(bytes);
    receive::<PlanRequest>(bytes);
    receive::<PlanAnswer>(bytes);
    receive::<OperatorRequest>(bytes);
    receive::<OperatorAnswer>(bytes);
    receive::<Uptake>(bytes);
    use_fields(bytes);
    decode(bytes);
}

fn examples() -> Vec<Vec<u8>> {
    let mut state = State { rows: 8, ..State::default() };
    state.text = text::from_str("a text");
    let mut request = PlanRequest { speed: 0.2, steering: 0.5, ..PlanRequest::default() };
    assert!(request.push_obstacle(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]));
    let mut raw = [Raw::default(); 3];
    for (sequence, raw) in raw.iter_mut().enumerate() {
        kerbside_messages::seal(raw, &[], 1, 1 + sequence as u64, 1);
    }
    let plan = Plan { interval: 0.1, points: 4, ..Plan::default() };
    let point = |index| TrajectoryPoint { time: f64::from(index), ..TrajectoryPoint::default() };
    let points = [0, 1, 2, 3].map(point);
    let mut cdr = Vec::new();
    let plan_topic = Plan::TOPIC;
    encode_cdr(plan_topic, bytemuck::bytes_of(&plan), bytemuck::cast_slice(&points), &mut cdr);
    vec![
        bytemuck::bytes_of(&state).to_vec(),
        bytemuck::bytes_of(&request).to_vec(),
        bytemuck::cast_slice(&raw).to_vec(),
        cdr,
        vec![0; 4096],
        vec![0xff; 4096],
    ]
}

#[test]
fn samples() {
    let examples = examples();
    examples.iter().for_each(|example| examine(example));
    bolero::check!().for_each(|bytes: &[u8]| {
        examine(bytes);
        examine(&damaged(&examples, bytes));
    });
}
