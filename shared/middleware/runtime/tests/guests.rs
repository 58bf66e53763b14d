//! Tools are guests: they never take a place that the instance's own processes need.

// The helpers of a test unwrap as its functions do.
#![allow(clippy::unwrap_used, clippy::panic)]

use kerbside_messages::topics::{OPERATOR_ANSWER, PLAN, PLAN_REQUEST, RAW};
use kerbside_messages::{Fix, PlanAnswer, PlanRequest, Process, Raw};
use kerbside_runtime::{FileLock, GUESTS, Instance, Services, Session, SessionError};

/// One test function: the middleware's configuration is per process, so an instance is too.
#[test]
fn guests_find_no_place_once_theirs_are_taken_and_processes_still_do() {
    let base = tempfile::tempdir_in("/tmp").unwrap();
    let instance = Instance::below(base.path(), "guests").unwrap();
    let lock = instance.lock().unwrap();
    let services = Services::create(&instance).unwrap();
    let session = Session::join(&instance, Process::Operator).unwrap();
    assert!(session.is_live());
    requests_and_plans_are_counted_too(&session);
    let guests = guests_come_until_their_places_are_taken(&session);
    processes_still_find_a_place(&session);
    who_finds_its_place_taken_by_the_dead_waits(&session);
    drop(guests);
    assert_eq!(session.admit_guest(&RAW, None).map_err(|error| error.to_string()), Ok(()));
    // Who holds the lock of a process is no guest.
    let ingest = FileLock::take(&instance.process_lock(Process::Ingest)).unwrap();
    let subscriber = session.subscriber::<Raw>(None, 1).unwrap();
    let census = session.census(&RAW, None).unwrap();
    assert_eq!((census.guests(&RAW).count(), census.subscribers.len()), (0, 1));
    assert_eq!(census.subscribers[0].to_string(), "ingest");
    drop((subscriber, ingest));
    drop(services);
    instance.wipe().unwrap();
    assert!(!session.is_live());
    drop(session);
    drop(lock);
    instance.remove().unwrap();
}

fn guests_come_until_their_places_are_taken(session: &Session) -> Vec<impl Sized + use<>> {
    let mut guests = Vec::new();
    for _ in 0..GUESTS {
        session.admit_guest(&RAW, None).unwrap();
        guests.push(session.subscriber::<Raw>(None, 1).unwrap());
    }
    let refused = session.admit_guest(&RAW, None).unwrap_err();
    assert!(matches!(refused, SessionError::Full { places: GUESTS, .. }));
    let said = refused.to_string();
    assert!(
        said.contains("topic raw: all 6 places for tools and other guests are taken"),
        "{said}"
    );
    assert!(said.contains(&format!("by process {}", std::process::id())), "{said}");
    session.admit_guest(&PLAN, None).unwrap();
    guests
}

fn processes_still_find_a_place(session: &Session) {
    // Those of the table, the gateway, and two whose predecessors are not swept yet.
    let places = RAW.subscribers.len() + 3;
    let own: Vec<_> = (0..places).map(|_| session.subscriber::<Raw>(None, 1).unwrap()).collect();
    let refused = session.subscriber::<Raw>(None, 1).unwrap_err().to_string();
    let all = places + GUESTS;
    assert_eq!(refused, format!("topic raw: all {all} places for subscribers are taken"));
    assert_eq!(session.census(&RAW, None).unwrap().subscribers.len(), all);
    drop(own);
}

/// What a topic's only publisher finds in its place is left by the dead, and goes; a topic of all and sundry is full.
fn who_finds_its_place_taken_by_the_dead_waits(session: &Session) {
    let mut left: Vec<_> = (0..4).map(|_| session.publisher::<Raw>(None).unwrap()).collect();
    let awaited = session.publisher::<Raw>(None).unwrap_err();
    assert!(awaited.is_missing(), "{awaited}");
    assert!(awaited.to_string().starts_with("a free place for a publisher of topic raw"));
    drop(left.pop());
    left.push(session.publisher::<Raw>(None).unwrap());
    let servers: Vec<_> =
        (0..4).map(|_| session.server::<PlanRequest, PlanAnswer>().unwrap()).collect();
    assert!(session.server::<PlanRequest, PlanAnswer>().unwrap_err().is_missing());
    drop(servers);
    let fixes: Vec<_> = (0..16).map(|_| session.publisher::<Fix>(None).unwrap()).collect();
    let refused = session.publisher::<Fix>(None).unwrap_err();
    assert!(matches!(refused, SessionError::Full { role: "publishers", places: 16, .. }));
    drop(fixes);
}

fn requests_and_plans_are_counted_too(session: &Session) {
    let server = session.server::<PlanRequest, PlanAnswer>().unwrap();
    let plans = session.plan_subscriber().unwrap();
    let requests = session.census(&PLAN_REQUEST, None).unwrap();
    assert_eq!((requests.publishers.len(), requests.subscribers.len()), (0, 1));
    let answers = session.census(&OPERATOR_ANSWER, None).unwrap();
    assert_eq!((answers.publishers.len(), answers.subscribers.len()), (0, 0));
    assert_eq!(session.census(&PLAN, None).unwrap().subscribers.len(), 1);
    drop((server, plans));
}
