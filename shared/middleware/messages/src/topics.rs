//! The one table of topics.

use core::time::Duration;

use crate::header::layout_version;
use crate::layout::{Enumeration, Layout, Meaning, Meaningful, Variant};
use crate::payloads::{
    Actuator, Command, Fix, Heartbeat, Inhibit, Odometry, OperatorAnswer, OperatorRequest, Permit,
    Plan, PlanAnswer, PlanRequest, Raw, Restore, State, Travel, Truth, Uptake,
};
use crate::{Header, Message, Refusal};

/// The processes of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Process {
    /// The line to the vehicle.
    Interface = 0,
    /// Counts to travel.
    Ingest = 1,
    /// Travel to pose.
    Estimator = 2,
    /// Requests to plans.
    Planner = 3,
    /// Pose and plan to command.
    Tracker = 4,
    /// The gate.
    Actuation = 5,
    /// Samples to disk.
    Recorder = 6,
    /// Starts, watches, permits, restarts.
    Supervisor = 7,
    /// The simulated vehicle, outside the supervised set.
    Vehicle = 8,
    /// A person's command line.
    Operator = 9,
    /// The door for processes of other users.
    Gateway = 10,
}

impl Process {
    /// The processes a supervisor supervises, in the order of the sample's way.
    pub const SUPERVISED: [Self; 8] = [
        Self::Interface,
        Self::Ingest,
        Self::Estimator,
        Self::Planner,
        Self::Tracker,
        Self::Actuation,
        Self::Recorder,
        Self::Gateway,
    ];

    /// Every process.
    pub const ALL: [Self; 11] = [
        Self::Interface,
        Self::Ingest,
        Self::Estimator,
        Self::Planner,
        Self::Tracker,
        Self::Actuation,
        Self::Recorder,
        Self::Supervisor,
        Self::Vehicle,
        Self::Operator,
        Self::Gateway,
    ];

    /// The name used on the command line, in files and in logs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Interface => "interface",
            Self::Ingest => "ingest",
            Self::Estimator => "estimator",
            Self::Planner => "planner",
            Self::Tracker => "tracker",
            Self::Actuation => "actuation",
            Self::Recorder => "recorder",
            Self::Supervisor => "supervisor",
            Self::Vehicle => "vehicle",
            Self::Operator => "operator",
            Self::Gateway => "gateway",
        }
    }

    /// The process of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|process| process.name() == name)
    }

    /// The process of that number, as messages carry it.
    #[must_use]
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|process| *process as u8 == id)
    }

    /// Whether the car must stop when the process fails: it carries samples from the encoders to the vehicle.
    #[must_use]
    pub const fn on_control_path(self) -> bool {
        matches!(
            self,
            Self::Interface | Self::Ingest | Self::Estimator | Self::Tracker | Self::Actuation
        )
    }
}

impl Meaningful for Process {
    const MEANING: Meaning = Meaning::Code(&Enumeration {
        name: "Process",
        doc: " The processes of an instance.",
        variants: &{
            let mut variants = [Variant { name: "", code: 0, words: "" }; Self::ALL.len()];
            let mut index = 0;
            while index < variants.len() {
                let process = Self::ALL[index];
                variants[index] =
                    Variant { name: process.name(), code: process as u8, words: process.name() };
                index += 1;
            }
            variants
        },
    });
}

impl core::fmt::Display for Process {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

/// Who may publish a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Publisher {
    /// This process alone.
    One(Process),
    /// Every process of its own, one service each.
    Each,
    /// Any process of the instance's user.
    Any,
}

/// What reaches a subscriber that cannot keep up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Every sample in order, as long as it is no more than so many behind; what is lost is counted.
    InOrder {
        /// Samples kept for a subscriber.
        depth: usize,
    },
    /// The newest alone.
    Newest,
    /// A request and its answer.
    RequestResponse,
}

/// A line of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Topic {
    /// Its number, as headers carry it.
    pub id: u16,
    /// Its name.
    pub name: &'static str,
    /// Name of the payload.
    pub payload: &'static str,
    /// Who publishes.
    pub publisher: Publisher,
    /// Who subscribes besides tools.
    pub subscribers: &'static [Process],
    /// Which subscriber is woken by each sample.
    pub wakes: Option<Process>,
    /// Expected samples per second \[Hz\]; 0 for topics that speak when there is something to say.
    pub rate: f64,
    /// How old a sample may be when used, without real-time rights; none where age says nothing.
    pub freshness: Option<Duration>,
    /// What reaches a slow subscriber.
    pub delivery: Delivery,
    /// Whether samples carry a check sum.
    pub protected: bool,
    /// Whether the recorder records it.
    pub recorded: bool,
    /// What it is, for people.
    pub doc: &'static str,
}

impl Topic {
    /// The topic of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        TABLE.iter().find(|topic| topic.name == name)
    }
}

/// Work that is the same for every topic, but for the type of the payload.
pub trait Visitor {
    /// What it gives.
    type Output;

    /// Does it for payloads of type `M`.
    fn visit<M: Message>(self) -> Self::Output;
}

macro_rules! topics {
    ($($id:literal $constant:ident $name:literal $payload:ident, $publisher:expr => [$($subscriber:ident),*],
       wakes $wakes:expr, $rate:literal Hz, fresh $freshness:expr, $delivery:expr, protected $protected:literal,
       recorded $recorded:literal, $doc:literal;)+) => {
        $(
            #[doc = $doc]
            pub const $constant: Topic = Topic {
                id: $id,
                name: $name,
                payload: stringify!($payload),
                publisher: $publisher,
                subscribers: &[$(Process::$subscriber),*],
                wakes: $wakes,
                rate: $rate,
                freshness: $freshness,
                delivery: $delivery,
                protected: $protected,
                recorded: $recorded,
                doc: $doc,
            };

            impl Message for $payload {
                const TOPIC: &'static Topic = &$constant;
                const TYPE_NAME: &'static str = concat!("kerbside.", stringify!($payload), ".v", layout_version!());

                fn header(&self) -> &Header {
                    &self.header
                }

                fn header_mut(&mut self) -> &mut Header {
                    &mut self.header
                }

                fn validate(&self) -> Result<(), Refusal> {
                    self.check_fields()
                }
            }
        )+

        /// Every topic, in the order of the table.
        pub const TABLE: &[Topic] = &[$($constant),+];

        /// The layout of a topic's payload.
        #[must_use]
        pub fn layout_of(topic: &Topic) -> Option<&'static Layout> {
            match topic.id {
                $($id => Some(<$payload as crate::layout::Described>::LAYOUT),)+
                _ => None,
            }
        }

        /// The name of a payload's type in shared memory.
        #[must_use]
        pub fn type_name_of(topic: &Topic) -> Option<&'static str> {
            match topic.id {
                $($id => Some(<$payload as Message>::TYPE_NAME),)+
                _ => None,
            }
        }

        /// Has `visitor` do its work with the type of a topic's payload; none for a topic that the table does not have.
        pub fn visit<V: Visitor>(topic: &Topic, visitor: V) -> Option<V::Output> {
            match topic.id {
                $($id => Some(visitor.visit::<$payload>()),)+
                _ => None,
            }
        }
    };
}

const fn one(process: Process) -> Publisher {
    Publisher::One(process)
}

const fn all(depth: usize) -> Delivery {
    Delivery::InOrder { depth }
}

const fn ms(limit: u64) -> Option<Duration> {
    Some(Duration::from_millis(limit))
}

/// Samples kept for a subscriber that takes every one of the control path.
pub const IN_ORDER: usize = 512;

topics! {
    1 RAW "raw" Raw, one(Process::Interface) => [Ingest, Recorder], wakes Some(Process::Ingest), 200.0 Hz, fresh ms(100), all(IN_ORDER), protected true, recorded true,
        "What the vehicle reported: counts, steering and yaw rate as read, each with a mask.";
    2 TRAVEL "travel" Travel, one(Process::Ingest) => [Estimator, Recorder], wakes Some(Process::Estimator), 200.0 Hz, fresh ms(100), all(IN_ORDER), protected true, recorded true,
        "Each wheel's travel since the counter epoch, its increment and validity; a gap is a gap.";
    3 ODOMETRY "odometry" Odometry, one(Process::Estimator) => [Tracker, Planner, Interface, Supervisor, Recorder], wakes Some(Process::Tracker), 200.0 Hz, fresh ms(100), all(IN_ORDER), protected true, recorded true,
        "The pose estimate with twist, covariance and the filter's own statistics; one per travel.";
    4 RESTORE "restore" Restore, one(Process::Supervisor) => [Estimator, Recorder], wakes None, 0.0 Hz, fresh None, Delivery::Newest, protected true, recorded true,
        "The newest valid odometry, for an estimator that was restarted.";
    5 FIX "fix" Fix, Publisher::Any => [Estimator, Supervisor, Recorder], wakes None, 0.0 Hz, fresh ms(1000), all(16), protected true, recorded true,
        "An absolute pose with covariance, from any process.";
    6 PLAN "plan" Plan, one(Process::Planner) => [Tracker, Operator, Recorder], wakes None, 0.0 Hz, fresh None, Delivery::Newest, protected true, recorded true,
        "The standing trajectory with its certificate.";
    7 COMMAND "command" Command, one(Process::Tracker) => [Actuation, Supervisor, Recorder], wakes Some(Process::Actuation), 200.0 Hz, fresh ms(100), Delivery::Newest, protected true, recorded true,
        "What the tracker asks of the actuators; one per odometry while driving.";
    8 PERMIT "permit" Permit, one(Process::Supervisor) => [Actuation, Tracker, Recorder], wakes None, 100.0 Hz, fresh ms(150), Delivery::Newest, protected true, recorded true,
        "The supervisor's short-lived leave to move.";
    9 INHIBIT "inhibit" Inhibit, Publisher::Any => [Actuation, Supervisor, Recorder], wakes None, 0.0 Hz, fresh None, all(8), protected true, recorded true,
        "A demand from anyone to stop at the gate.";
    10 ACTUATOR "actuator" Actuator, one(Process::Actuation) => [Interface, Supervisor, Recorder], wakes Some(Process::Interface), 200.0 Hz, fresh ms(100), Delivery::Newest, protected true, recorded true,
        "What passed the gate, and why it was altered.";
    11 STATE "state" State, one(Process::Supervisor) => [Interface, Ingest, Estimator, Planner, Tracker, Actuation, Vehicle, Operator, Recorder], wakes None, 100.0 Hz, fresh ms(500), Delivery::Newest, protected false, recorded true,
        "Mode, cause, and a row per process.";
    12 HEARTBEAT "heartbeat" Heartbeat, Publisher::Each => [Supervisor, Operator, Recorder], wakes None, 50.0 Hz, fresh ms(200), all(16), protected false, recorded true,
        "Each process's sign of life with its loop timing.";
    13 TRUTH "truth" Truth, one(Process::Vehicle) => [Operator, Recorder], wakes None, 200.0 Hz, fresh None, all(64), protected false, recorded true,
        "The simulated vehicle's true pose: for recordings and reports alone.";
    14 PLAN_REQUEST "plan_request" PlanRequest, Publisher::Any => [Planner], wakes Some(Process::Planner), 0.0 Hz, fresh None, Delivery::RequestResponse, protected true, recorded false,
        "A goal among obstacles, asked of the planner.";
    15 PLAN_ANSWER "plan_answer" PlanAnswer, one(Process::Planner) => [], wakes None, 0.0 Hz, fresh None, Delivery::RequestResponse, protected true, recorded false,
        "The planner's answer: found, or why not.";
    16 OPERATOR_REQUEST "operator" OperatorRequest, Publisher::Any => [Supervisor], wakes Some(Process::Supervisor), 0.0 Hz, fresh None, Delivery::RequestResponse, protected true, recorded false,
        "What an operator asks of the supervisor: arm, stop, down.";
    17 OPERATOR_ANSWER "operator_answer" OperatorAnswer, one(Process::Supervisor) => [], wakes None, 0.0 Hz, fresh None, Delivery::RequestResponse, protected true, recorded false,
        "The supervisor's answer: done, or why not.";
    18 UPTAKE "uptake" Uptake, Publisher::Any => [Interface], wakes Some(Process::Interface), 0.0 Hz, fresh None, all(64), protected false, recorded false,
        "In a replay: how far each reader of odometry has come, so that the replay waits for it.";
}
