//! After READY the processes of the control path allocate nothing but what the middleware makes: one small allocation
//! for each sample it loans.
//!
//! The five services run as threads of this process, whose allocator counts by thread; the supervisor awaits them as
//! external, and is a process of its own with the planner, the recorder and the simulated vehicle. How many samples
//! each of them loaned is read from the sequence numbers of what it published.

// The counting allocator is the point of this test; a test that cannot go on panics.
#![allow(unsafe_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use core::cell::Cell;
use core::time::Duration;
use std::alloc::{GlobalAlloc, Layout, System};
use std::hint::black_box;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

use kerbside::exit::{Exit, Failure};
use kerbside::service::{Service, ServiceArgs};
use kerbside::{actuation, configuration, estimator, ingest, interface, tracker};
use kerbside_messages::{
    Actuator, Command as Ask, EstimatorState, Fix, Header, Heartbeat, Message, Mode, Odometry,
    OperatorAnswer, OperatorRequest, PlanAnswer, PlanRequest, PlanVerdict, Process, Raw, State,
    Travel, Verb,
};
use kerbside_runtime::{
    BarePublisher, BareServices, Client, Instance, Newest, Publisher, Session, Subscriber, Ticker,
    now,
};

/// Size of what the middleware allocates for a loan.
const LOAN: usize = 48;
/// Readings of a window.
const READINGS: u64 = 1000;
/// Drives that may be stopped before the window's end.
const ATTEMPTS: usize = 4;
/// Longest wait for anything \[ns\].
const PATIENCE: u64 = 60_000_000_000;

type Body = fn(&Service) -> Result<Exit, Failure>;

const CONTROL_PATH: [(Process, Body); 5] = [
    (Process::Interface, interface::run),
    (Process::Ingest, ingest::run),
    (Process::Estimator, estimator::run),
    (Process::Tracker, tracker::run),
    (Process::Actuation, actuation::run),
];

/// Counts of one thread.
struct Counts {
    all: AtomicU64,
    other: AtomicU64,
}

static COUNTS: [Counts; 16] =
    [const { Counts { all: AtomicU64::new(0), other: AtomicU64::new(0) } }; 16];
/// Threads that are counted by nobody.
const NOBODY: usize = 15;

thread_local! {
    static SLOT: Cell<usize> = const { Cell::new(NOBODY) };
}

struct Counting;

fn count(size: usize) {
    // A thread that ends has no slot any more.
    let slot = SLOT.try_with(Cell::get).unwrap_or(NOBODY);
    COUNTS[slot].all.fetch_add(1, Ordering::Relaxed);
    COUNTS[slot].other.fetch_add(u64::from(size != LOAN), Ordering::Relaxed);
}

// SAFETY: every call is handed to the system's allocator as it is; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What a thread allocated: all, and of other sizes than a loan's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Allocated {
    all: u64,
    other: u64,
}

impl Allocated {
    fn by(slot: usize) -> Self {
        let counts = &COUNTS[slot];
        Self { all: counts.all.load(Ordering::SeqCst), other: counts.other.load(Ordering::SeqCst) }
    }

    fn since(self, before: Self) -> Self {
        Self { all: self.all - before.all, other: self.other - before.other }
    }
}

/// Why a thread allocated too much for the samples it loaned; none where it did not.
fn objection(allocated: Allocated, loans: u64) -> Option<String> {
    let Allocated { all, other } = allocated;
    (other > 0 || all > loans)
        .then(|| format!("{all} allocations for {loans} loans, {other} of another size"))
}

/// One test function: the middleware's configuration is per process.
#[test]
fn the_control_path_allocates_nothing_but_loans() {
    let folder = tempfile::Builder::new().prefix("kba").tempdir_in("/tmp").unwrap();
    let stack = Stack::start(folder.path());
    let session = stack.join();
    let mut watch = Watch::open(&session);
    let mut operator = Operator::open(&session);
    the_middleware_allocates_once_for_a_loan(&session);
    an_added_allocation_is_found(&session);

    watch.until("the stack is ready", |watch| watch.mode() == Some(Mode::Ready));
    operator.fix_until_known(&stack, &mut watch);
    assert!(watch.hold_window("standing", |_| true));
    // A machine that is busy otherwise may stop the car: the window is begun anew, never shortened.
    assert!((0..ATTEMPTS).any(|_| {
        operator.drive(&stack, &mut watch);
        watch.hold_window("driving", |watch| watch.mode() == Some(Mode::Driving))
    }));

    drop((operator, watch, session));
    stack.end();
}

fn the_middleware_allocates_once_for_a_loan(session: &Session) {
    let mut services = BareServices::default();
    services.create::<Raw>(session).unwrap();
    let bare = BarePublisher::<Raw>::open(session).unwrap();
    let message = Raw::default();
    bare.send(&message).unwrap();
    let allocated = by_this_thread(|| (0..READINGS).for_each(|_| bare.send(&message).unwrap()));
    assert_eq!(allocated, Allocated { all: READINGS, other: 0 });
}

/// The control: what this test is for.
fn an_added_allocation_is_found(session: &Session) {
    let mut publisher = session.publisher::<Fix>(None).unwrap();
    let mut send = |every: u64| {
        by_this_thread(|| {
            for round in 0..READINGS {
                if every > 0 && round % every == 0 {
                    black_box(Box::new(black_box(round)));
                }
                // Looked at and not sent: a loan all the same.
                publisher.send(|_| false).unwrap();
            }
        })
    };
    assert_eq!(objection(send(0), READINGS), None);
    assert!(objection(send(1), READINGS).is_some());
    assert!(objection(send(READINGS), READINGS).is_some());
    // Of a loan's size it is found by the number.
    let boxed = by_this_thread(|| drop(black_box(Box::new([0_u8; LOAN]))));
    assert!(boxed == Allocated { all: 1, other: 0 } && objection(boxed, 0).is_some());
}

/// What `work` allocates on this thread.
fn by_this_thread(work: impl FnOnce()) -> Allocated {
    const SLOT_OF_TEST: usize = CONTROL_PATH.len();
    SLOT.set(SLOT_OF_TEST);
    let before = Allocated::by(SLOT_OF_TEST);
    work();
    let allocated = Allocated::by(SLOT_OF_TEST).since(before);
    SLOT.set(NOBODY);
    allocated
}

/// The services as threads, and everything else as processes.
struct Stack {
    service: Service,
    supervisor: Child,
    services: Vec<(Process, JoinHandle<Result<Exit, Failure>>)>,
}

impl Stack {
    fn start(folder: &Path) -> Self {
        let run_time = folder.join("run");
        std::fs::create_dir(&run_time).unwrap();
        let config = folder.join("stack.toml");
        std::fs::write(&config, configuration_text()).unwrap();
        let instance = Instance::below(&run_time.join("kerbside"), "counted").unwrap();
        let args = ServiceArgs {
            instance: Some("counted".to_owned()),
            config: Some(config),
            scenario: Some("garage".to_owned()),
            ..ServiceArgs::default()
        };
        let supervisor = Command::new(env!("CARGO_BIN_EXE_kerbside"))
            .args(["--log", "error", "up", "--simulate", "--start=-1.0,0.65,0"])
            .args(["--instance", "counted", "--scenario", "garage", "--config"])
            .arg(args.config.as_ref().unwrap())
            .args(["--with-parent", &std::process::id().to_string()])
            .env("XDG_RUNTIME_DIR", &run_time)
            .env("XDG_STATE_HOME", folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .process_group(0)
            .spawn()
            .unwrap();
        let service_of = |process| {
            let service = Service::load(process, &args, "counted").unwrap();
            Service { instance: instance.clone(), ..service }
        };
        let start = |(slot, (process, body)): (usize, (Process, Body))| {
            let service = service_of(process);
            let thread = std::thread::spawn(move || {
                SLOT.set(slot);
                body(&service)
            });
            (process, thread)
        };
        let services = CONTROL_PATH.into_iter().enumerate().map(start).collect();
        Self { service: service_of(Process::Operator), supervisor, services }
    }

    fn join(&self) -> Session {
        let mut look = Ticker::new(Duration::from_millis(10));
        let deadline = now() + PATIENCE;
        loop {
            let joined =
                Session::join(&self.service.instance, Process::Operator).and_then(|session| {
                    session.client::<OperatorRequest, OperatorAnswer>().map(|_| session)
                });
            match joined {
                Ok(session) => return session,
                Err(error) => assert!(error.is_missing() && now() < deadline, "{error}"),
            }
            look.wait();
        }
    }

    /// Ends everything as a person would, and holds it against having left anything.
    fn end(mut self) {
        // The services took the signal over; nothing else in this process minds it.
        signal_hook::low_level::raise(signal_hook::consts::SIGTERM).unwrap();
        for (process, thread) in self.services.drain(..) {
            let exit = thread.join().unwrap();
            assert!(matches!(exit, Ok(Exit::Good)), "{process}: {exit:?}");
        }
        kerbside_runtime::terminate(self.supervisor.id());
        self.supervisor.wait().unwrap();
        let prefix = self.service.instance.prefix();
        let names = std::fs::read_dir("/dev/shm").unwrap().flatten();
        let left: Vec<_> = names
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .filter(|name| name.starts_with(&prefix))
            .collect();
        assert!(left.is_empty(), "{left:?}");
    }
}

impl Drop for Stack {
    fn drop(&mut self) {
        // Only after a failure it is still there; the other threads end with this process.
        if matches!(self.supervisor.try_wait(), Ok(None)) {
            kerbside_runtime::terminate(self.supervisor.id());
            let _ = self.supervisor.wait();
            let _ = self.service.instance.remove();
        }
    }
}

fn configuration_text() -> String {
    let external =
        |(process, _): &(Process, Body)| format!("[process.{process}]\nstart = \"external\"\n");
    let externals: String = CONTROL_PATH.iter().map(external).collect();
    format!(
        "vehicle = \"paper-1-6\"\n[safety]\nstop_distance = 0.65\n[realtime]\nenabled = \"off\"\n\
         [recorder]\nenabled = false\n{externals}"
    )
}

/// Everything the five services publish, and the state.
struct Watch {
    state: Newest<State>,
    odometry: Newest<Odometry>,
    raw: Counter<Raw>,
    travel: Counter<Travel>,
    estimates: Counter<Odometry>,
    actuator: Counter<Actuator>,
    command: Counter<Ask>,
    beats: Vec<Counter<Heartbeat>>,
}

/// Counts what a publisher sent by its sequence.
struct Counter<M: Message> {
    subscriber: Subscriber<M>,
    sent: u64,
}

impl<M: Message> Counter<M> {
    fn open(session: &Session, process: Option<Process>) -> Self {
        Self { subscriber: session.subscriber(process, 16).unwrap(), sent: 0 }
    }

    fn take_in(&mut self) -> u64 {
        while let Some(sample) = self.subscriber.receive() {
            self.sent = sample.header().sequence;
        }
        self.sent
    }
}

/// How many samples each service loaned, and what it allocated, at an instant at which none of them ran.
#[derive(Debug, PartialEq, Eq)]
struct Account {
    loans: [u64; CONTROL_PATH.len()],
    allocated: [Allocated; CONTROL_PATH.len()],
}

impl Watch {
    fn open(session: &Session) -> Self {
        let beats = |(process, _)| Counter::open(session, Some(process));
        Self {
            state: Newest::of(session.subscriber(None, 1).unwrap()),
            odometry: Newest::of(session.subscriber(None, 1).unwrap()),
            raw: Counter::open(session, None),
            travel: Counter::open(session, None),
            estimates: Counter::open(session, None),
            actuator: Counter::open(session, None),
            command: Counter::open(session, None),
            beats: CONTROL_PATH.into_iter().map(beats).collect(),
        }
    }

    fn mode(&self) -> Option<Mode> {
        self.state.get().map(State::mode)
    }

    fn has_pose(&self) -> bool {
        let valid = EstimatorState::Valid.code();
        self.odometry.get().is_some_and(|odometry| odometry.state == valid)
    }

    fn until(&mut self, what: &str, met: impl Fn(&Self) -> bool) {
        let deadline = now() + PATIENCE;
        let mut look = Ticker::new(Duration::from_millis(5));
        while !met(self) {
            assert!(now() < deadline, "not in time: {what}; {:?}", self.state.get());
            look.wait();
            self.state.update();
            self.odometry.update();
            self.take_in();
        }
    }

    /// Samples that each service loaned so far: one per reading, of which the tracker does not send every one; one per
    /// heartbeat.
    fn take_in(&mut self) -> [u64; CONTROL_PATH.len()] {
        self.command.take_in();
        let estimates = self.estimates.take_in();
        let mut loans = [
            self.raw.take_in(),
            self.travel.take_in(),
            estimates,
            estimates,
            self.actuator.take_in(),
        ];
        loans.iter_mut().zip(&mut self.beats).for_each(|(loans, beats)| *loans += beats.take_in());
        loans
    }

    /// Waits for a moment at which everybody sleeps, so that counts and sequences belong together.
    fn account(&mut self) -> Account {
        let deadline = now() + PATIENCE;
        let mut pause = Ticker::new(Duration::from_micros(700));
        loop {
            let mut look = || Account {
                loans: self.take_in(),
                allocated: core::array::from_fn(Allocated::by),
            };
            let before = look();
            pause.wait();
            let after = look();
            if before == after {
                return after;
            }
            assert!(now() < deadline, "the services never rest");
        }
    }

    /// Holds the services against their loans over a window, during which `meanwhile` has to be; false where it was not.
    fn hold_window(&mut self, what: &str, meanwhile: impl Fn(&Self) -> bool) -> bool {
        // The first samples after a change connect and log; what counts is that it goes on without.
        let settled = self.raw.take_in() + READINGS / 10;
        self.until("some readings pass", |watch| watch.raw.sent >= settled);
        let before = self.account();
        let end = self.raw.sent + READINGS;
        self.until("the readings of a window", |watch| watch.raw.sent >= end || !meanwhile(watch));
        if !meanwhile(self) {
            return false;
        }
        let after = self.account();
        for (slot, (process, _)) in CONTROL_PATH.into_iter().enumerate() {
            let loans = after.loans[slot] - before.loans[slot];
            let allocated = after.allocated[slot].since(before.allocated[slot]);
            assert!(loans >= READINGS * 9 / 10, "{process} loaned {loans} samples while {what}");
            assert_eq!(objection(allocated, loans), None, "{process} while {what}");
        }
        true
    }
}

/// A person at the stack.
struct Operator {
    fix: Publisher<Fix>,
    door: Client<OperatorRequest, OperatorAnswer>,
    planner: Client<PlanRequest, PlanAnswer>,
}

impl Operator {
    fn open(session: &Session) -> Self {
        Self {
            fix: session.publisher(None).unwrap(),
            door: session.client().unwrap(),
            planner: session.client().unwrap(),
        }
    }

    /// Says where the car stands until the estimator takes it up: it does so at standstill only.
    fn fix_until_known(&mut self, stack: &Stack, watch: &mut Watch) {
        let start = scenario(stack).start;
        let deadline = now() + PATIENCE;
        while !watch.has_pose() {
            let content = Fix {
                header: Header::stamped(now(), 0),
                x: start.x,
                y: start.y,
                yaw: start.yaw,
                covariance: [1e-6, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-6],
                ..Fix::default()
            };
            let write = |fix: &mut Fix| {
                *fix = content;
                true
            };
            assert!(self.fix.send(write).unwrap() && now() < deadline);
            let heard = watch.raw.take_in() + 100;
            watch.until("the fix is weighed", |watch| watch.has_pose() || watch.raw.sent >= heard);
        }
    }

    /// Arms and plans until the car drives.
    fn drive(&mut self, stack: &Stack, watch: &mut Watch) {
        let healthy = |watch: &Watch| watch.state.get().is_some_and(|state| state.healthy == 1);
        let halted = |watch: &Watch| matches!(watch.mode(), Some(Mode::Ready | Mode::Faulted));
        watch.until("it may be armed", |watch| healthy(watch) && halted(watch));
        let request = OperatorRequest { id: 1, verb: Verb::Arm.code(), ..Default::default() };
        let answer = self.door.ask(request, Duration::from_secs(2)).unwrap().expect("an answer");
        assert_eq!(answer.accepted, 1, "{answer:?}");
        self.plan(stack, answer.arms);
        watch.until("the car drives or stops", |watch| {
            watch.mode() == Some(Mode::Driving) || halted(watch)
        });
    }

    fn plan(&self, stack: &Stack, arm: u64) {
        let mut request = scenario(stack).plan_request(&stack.service.vehicle);
        (request.id, request.arm) = (arm, arm);
        let answer = self.planner.ask(request, Duration::from_secs(25)).unwrap().expect("a plan");
        assert_eq!(answer.verdict, PlanVerdict::Found.code(), "{answer:?}");
    }
}

fn scenario(stack: &Stack) -> kerbside_settings::Scenario {
    let config = stack.service.args.config.as_deref();
    configuration::parking(config, "garage", None).unwrap().scenario.value
}
