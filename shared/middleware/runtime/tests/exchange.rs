//! Ports exchange samples within an instance of their own.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used)]

use core::time::Duration;

use kerbside_messages::{
    Heartbeat, Mode, OperatorAnswer, OperatorRequest, Permit, Plan, Process, Raw, State,
    TrajectoryPoint, Verb,
};
use kerbside_runtime::{Instance, Newest, Services, Session, now};

/// One test function: the middleware's configuration is per process, so an instance is too.
#[test]
fn samples_plans_requests_and_notifications_arrive() {
    let base = tempfile::tempdir_in("/tmp").unwrap();
    let instance = Instance::below(base.path(), "exchange").unwrap();
    assert!(Session::join(&instance, Process::Ingest).unwrap_err().is_missing());
    let lock = instance.lock().unwrap();
    let services = Services::create(&instance).unwrap();
    let session = Session::join(&instance, Process::Ingest).unwrap();

    raw_samples_arrive_in_order(&session);
    the_newest_permit_counts(&session);
    a_late_subscriber_gets_the_standing_plan(&session);
    a_request_is_answered(&services, &session);
    each_process_has_its_own_heartbeat(&session);

    assert_eq!(Services::nodes(&instance).unwrap(), (2, 0));
    drop(session);
    drop(services);
    drop(lock);
    instance.remove().unwrap();
    let prefix = instance.prefix();
    let left: Vec<_> = std::fs::read_dir("/dev/shm")
        .unwrap()
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

fn raw_samples_arrive_in_order(session: &Session) {
    let mut publisher = session.publisher::<Raw>(None).unwrap();
    let mut subscriber = session.subscriber::<Raw>(None, 512).unwrap();
    let listener = session.listener::<Raw>().unwrap();
    for frame in 1..=10 {
        publisher
            .send(|raw| {
                raw.frame = frame;
                raw.header.stamp = now();
                true
            })
            .unwrap();
    }
    listener.wait_until(now() + 1_000_000_000);
    let frames: Vec<u32> =
        core::iter::from_fn(|| subscriber.receive()).map(|raw| raw.frame).collect();
    assert_eq!(frames, (1..=10).collect::<Vec<_>>());
    assert!(!publisher.send(|_| false).unwrap());
    assert!(subscriber.receive().is_none());
    assert_eq!(subscriber.refusals().total(), 0);
}

fn the_newest_permit_counts(session: &Session) {
    let mut publisher = session.publisher::<Permit>(None).unwrap();
    let mut newest = Newest::of(session.subscriber::<Permit>(None, 1).unwrap());
    assert!(!newest.update());
    for arm in 1..=5 {
        publisher
            .send(|permit| {
                permit.arm = arm;
                permit.mode = Mode::Armed.code();
                true
            })
            .unwrap();
    }
    assert!(newest.update());
    assert_eq!(newest.get().unwrap().arm, 5);
    assert!(newest.age(now()).unwrap() < 1_000_000_000);
    let mut broken = *newest.get().unwrap();
    broken.arm = 6;
    publisher.send_sealed(&broken).unwrap();
    assert!(!newest.update(), "a sample with a wrong check sum was used");
    assert_eq!(newest.refusals().total(), 1);
}

fn a_late_subscriber_gets_the_standing_plan(session: &Session) {
    let mut publisher = session.plan_publisher().unwrap();
    let points: Vec<TrajectoryPoint> = (0..4096)
        .map(|index| TrajectoryPoint { time: f64::from(index) * 0.02, ..Default::default() })
        .collect();
    let head = Plan { id: 7, interval: 0.02, points: 4096, ..Default::default() };
    publisher.send(&head, &points).unwrap();
    let mut late = session.plan_subscriber().unwrap();
    assert!(!late.update());
    publisher.refresh().unwrap();
    assert!(late.update());
    let (plan, received) = late.get().unwrap();
    assert_eq!((plan.id, received.len()), (7, 4096));
    assert_eq!(received[4095], points[4095]);
    assert!(publisher.send(&head, &vec![TrajectoryPoint::default(); 4097]).is_err());
}

fn a_request_is_answered(services: &Services, session: &Session) {
    let mut server = services.session().server::<OperatorRequest, OperatorAnswer>().unwrap();
    let client = session.client::<OperatorRequest, OperatorAnswer>().unwrap();
    let request = OperatorRequest { id: 3, verb: Verb::Arm.code(), ..Default::default() };
    assert!(client.ask(request, Duration::from_millis(20)).unwrap().is_none());
    while server.receive().is_some() {}
    std::thread::scope(|scope| {
        // The ports belong to their threads; the asking side is the one that may move.
        let asked = scope.spawn({
            let instance = session.instance().clone();
            move || {
                let session = Session::join(&instance, Process::Operator).unwrap();
                let client = session.client::<OperatorRequest, OperatorAnswer>().unwrap();
                client.ask(request, Duration::from_secs(5)).unwrap()
            }
        });
        let deadline = now() + 5_000_000_000;
        let asked_request = loop {
            if let Some(asked) = server.receive() {
                break asked;
            }
            assert!(now() < deadline, "no request came");
            std::thread::yield_now();
        };
        let id = asked_request.request().id;
        let mode = Mode::Armed.code();
        asked_request
            .answer(OperatorAnswer { id, mode, accepted: 1, ..Default::default() })
            .unwrap();
        assert_eq!(asked.join().unwrap().unwrap().id, 3);
    });
}

fn each_process_has_its_own_heartbeat(session: &Session) {
    let mut ingest = session.publisher::<Heartbeat>(Some(Process::Ingest)).unwrap();
    let mut of_ingest = session.subscriber::<Heartbeat>(Some(Process::Ingest), 16).unwrap();
    let mut of_tracker = session.subscriber::<Heartbeat>(Some(Process::Tracker), 16).unwrap();
    ingest
        .send(|beat| {
            beat.steps = 1;
            true
        })
        .unwrap();
    assert_eq!(of_ingest.receive().unwrap().steps, 1);
    assert!(of_tracker.receive().is_none());
    let mut state = session.subscriber::<State>(None, 1).unwrap();
    assert!(state.receive().is_none());
}
