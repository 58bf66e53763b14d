//! Schedules of faults: what happens to a simulated world besides its own course. Pure data.

use core::fmt;

use kerbside_messages::{Nanos, Process, seconds};

use super::mishap::Mishap;

/// Topics whose samples a schedule can touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wire {
    /// Readings.
    Raw,
    /// Travel.
    Travel,
    /// Estimates.
    Odometry,
    /// Commands.
    Command,
    /// Permits.
    Permit,
    /// What passed the gate.
    Actuator,
    /// Signs of life of this process.
    Heartbeat(Process),
}

impl Wire {
    /// The control path's topics.
    pub const PATH: [Self; 6] =
        [Self::Raw, Self::Travel, Self::Odometry, Self::Command, Self::Permit, Self::Actuator];

    /// Name of the topic.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Travel => "travel",
            Self::Odometry => "odometry",
            Self::Command => "command",
            Self::Permit => "permit",
            Self::Actuator => "actuator",
            Self::Heartbeat(_) => "heartbeat",
        }
    }

    /// Who publishes it.
    #[must_use]
    pub const fn publisher(self) -> Process {
        match self {
            Self::Raw => Process::Interface,
            Self::Travel => Process::Ingest,
            Self::Odometry => Process::Estimator,
            Self::Command => Process::Tracker,
            Self::Permit => Process::Supervisor,
            Self::Actuator => Process::Actuation,
            Self::Heartbeat(process) => process,
        }
    }

    /// Who reads it, of those that decide something.
    #[must_use]
    pub const fn readers(self) -> &'static [Process] {
        match self {
            Self::Raw => &[Process::Ingest],
            Self::Travel => &[Process::Estimator],
            Self::Odometry => &[Process::Tracker, Process::Supervisor, Process::Operator],
            Self::Command => &[Process::Actuation, Process::Supervisor],
            Self::Permit => &[Process::Tracker, Process::Actuation],
            Self::Actuator => &[Process::Interface, Process::Supervisor],
            Self::Heartbeat(_) => &[Process::Supervisor],
        }
    }
}

/// A direction of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Way {
    /// Readings.
    ToHost,
    /// Commands.
    ToVehicle,
}

/// What happens to bytes on the line.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum LineMishap {
    /// What arrives is lost.
    Silence,
    /// In every piece that arrives the byte of this number is turned over.
    Hurt(u32),
    /// These bytes come once, between two frames.
    Garbage(Vec<u8>),
}

/// What goes wrong. Spans are simulated time \[ns\].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// The process ends as by `kill -9`.
    Kill(Process),
    /// The process does nothing, as between SIGSTOP and SIGCONT; what comes meanwhile waits for it.
    Stall {
        /// Which; the vehicle's time stands still.
        process: Process,
        /// How long.
        span: Nanos,
    },
    /// Samples of a topic meet with something.
    Samples {
        /// Which.
        wire: Wire,
        /// On their way to whom; to everybody where that is none.
        reader: Option<Process>,
        /// What.
        mishap: Mishap,
        /// How long.
        span: Nanos,
    },
    /// Bytes on the line meet with something.
    Line {
        /// In which direction.
        way: Way,
        /// What.
        mishap: LineMishap,
        /// How long.
        span: Nanos,
    },
    /// The vehicle's board starts anew: another boot id, counters and clock at zero, and no motion until commanded.
    Reboot,
    /// The vehicle's counters are set to zero, and nothing says so.
    CounterReset,
    /// The vehicle's clock jumps by so much \[ns\].
    ClockStep(i64),
    /// Somebody forbids motion.
    Inhibit(Nanos),
}

impl Kind {
    /// A word for counting.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Kill(_) => "kill",
            Self::Stall { .. } => "stall",
            Self::Samples { mishap, .. } => mishap.name(),
            Self::Line { mishap: LineMishap::Silence, .. } => "line silent",
            Self::Line { mishap: LineMishap::Hurt(_), .. } => "line hurt",
            Self::Line { mishap: LineMishap::Garbage(_), .. } => "line garbage",
            Self::Reboot => "vehicle reboot",
            Self::CounterReset => "counter reset",
            Self::ClockStep(_) => "clock step",
            Self::Inhibit(_) => "inhibit",
        }
    }

    /// Whom it befalls first.
    #[must_use]
    pub const fn process(&self) -> Process {
        match self {
            Self::Kill(process) | Self::Stall { process, .. } => *process,
            Self::Samples { wire, .. } => wire.publisher(),
            Self::Line { .. } => Process::Interface,
            Self::Reboot | Self::CounterReset | Self::ClockStep(_) => Process::Vehicle,
            Self::Inhibit(_) => Process::Operator,
        }
    }

    /// How long it lasts by itself \[ns\].
    #[must_use]
    pub const fn span(&self) -> Nanos {
        match self {
            Self::Stall { span, .. }
            | Self::Samples { span, .. }
            | Self::Line { span, .. }
            | Self::Inhibit(span) => *span,
            Self::Kill(_) | Self::Reboot | Self::CounterReset | Self::ClockStep(_) => 0,
        }
    }

    /// The same, lasting so long; none where it has no length.
    #[must_use]
    pub fn lasting(&self, to: Nanos) -> Option<Self> {
        let mut changed = self.clone();
        match &mut changed {
            Self::Stall { span, .. }
            | Self::Samples { span, .. }
            | Self::Line { span, .. }
            | Self::Inhibit(span) => *span = to,
            Self::Kill(_) | Self::Reboot | Self::CounterReset | Self::ClockStep(_) => return None,
        }
        Some(changed)
    }
}

/// Something that goes wrong at a time.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Fault {
    /// When, in simulated time since the beginning \[ns\].
    pub at: Nanos,
    /// What.
    pub kind: Kind,
}

impl Fault {
    /// When it is over by itself \[ns\].
    #[must_use]
    pub fn end(&self) -> Nanos {
        self.at.saturating_add(self.kind.span())
    }
}

/// Faults in the order of their times.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Schedule(Vec<Fault>);

impl Schedule {
    /// These faults, put in order; those of one time keep theirs.
    #[must_use]
    pub fn new(mut faults: Vec<Fault>) -> Self {
        faults.sort_by_key(|fault| fault.at);
        Self(faults)
    }

    /// Processes that end as by `kill -9`.
    #[must_use]
    pub fn kills(kills: &[(Nanos, Process)]) -> Self {
        let fault =
            |(at, process): &(Nanos, Process)| Fault { at: *at, kind: Kind::Kill(*process) };
        Self::new(kills.iter().map(fault).collect())
    }

    /// The faults.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.0
    }

    /// When the last of them is over by itself \[ns\].
    #[must_use]
    pub fn end(&self) -> Nanos {
        self.0.iter().map(Fault::end).max().unwrap_or(0)
    }
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ToHost => "from the vehicle",
            Self::ToVehicle => "to the vehicle",
        })
    }
}

impl fmt::Display for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Heartbeat(process) => write!(f, "heartbeats of {process}"),
            other => f.write_str(other.name()),
        }
    }
}

impl fmt::Display for Mishap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Late(by) => write!(f, "late by {:.3} s", seconds(*by)),
            Self::NotFinite(which) => write!(f, "not finite in number {which}"),
            Self::OutOfRange(which) => write!(f, "out of range in number {which}"),
            Self::Flipped(bit) => write!(f, "with bit {bit} flipped"),
            other => f.write_str(other.name()),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let span = seconds(self.kind.span());
        write!(f, "{:.3} s: ", seconds(self.at))?;
        match &self.kind {
            Kind::Kill(process) => write!(f, "kill {process}"),
            Kind::Stall { process, .. } => write!(f, "stall {process} for {span:.3} s"),
            Kind::Samples { wire, reader, mishap, .. } => {
                write!(f, "{wire} {mishap}")?;
                if let Some(reader) = reader {
                    write!(f, " on the way to {reader}")?;
                }
                write!(f, " for {span:.3} s")
            }
            Kind::Line { way, mishap, .. } => match mishap {
                LineMishap::Silence => write!(f, "line {way} silent for {span:.3} s"),
                LineMishap::Hurt(byte) => {
                    write!(f, "line {way}: byte {byte} of each piece hurt for {span:.3} s")
                }
                LineMishap::Garbage(bytes) => {
                    write!(f, "line {way}: {} bytes of garbage", bytes.len())
                }
            },
            Kind::Reboot => f.write_str("the vehicle's board starts anew"),
            Kind::CounterReset => f.write_str("the vehicle's counters are reset"),
            Kind::ClockStep(by) => {
                #[allow(clippy::cast_precision_loss)] // a few seconds
                let by = *by as f64 / 1e9;
                write!(f, "the vehicle's clock jumps by {by:+.3} s")
            }
            Kind::Inhibit(_) => write!(f, "motion is inhibited for {span:.3} s"),
        }
    }
}
