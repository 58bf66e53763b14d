//! What a parking report is made from.

use kerbside_geometry::{Footprint, Pose};

use crate::{Motion, Provenance, svg::Tone};

/// A parking manoeuvre, from the start to the verdict. Samples of each kind are in the order of
/// their times.
#[derive(Clone, Debug, PartialEq)]
pub struct ParkReport {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the vehicle.
    pub vehicle: String,
    /// How it was run, for people: as processes, or in lockstep.
    pub run: String,
    /// The verdict.
    pub outcome: Outcome,
    /// Where it took place.
    pub scene: Scene,
    /// Figures of the whole.
    pub figures: Figures,
    /// Latency from encoder reading to command; none where nothing was measured.
    pub latency: Option<Latency>,
    /// Every plan that was followed.
    pub plans: Vec<Plan>,
    /// What the estimator published.
    pub estimate: Vec<EstimateSample>,
    /// The true motion, where it is known.
    pub truth: Vec<Motion>,
    /// What the tracker asked for.
    pub commands: Vec<CommandSample>,
    /// Modes of the stack, shaded in the charts.
    pub phases: Vec<Phase>,
    /// What happened.
    pub events: Vec<Event>,
    /// The processes.
    pub processes: Vec<ProcessFigures>,
    /// What it takes to repeat it.
    pub provenance: Provenance,
}

/// What the end pose was judged on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JudgedOn {
    /// The true pose.
    Truth,
    /// The estimate, there being no truth.
    Estimate,
}

/// The verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Parked within the tolerance and without a collision.
    pub parked: bool,
    /// Something was touched.
    pub collision: bool,
    /// Why not, or what else there is to say.
    pub cause: Option<String>,
    /// What it was judged on.
    pub judged_on: JudgedOn,
}

/// Where it took place, in the scenario's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Ground that may be driven on: least x, least y, greatest x, greatest y \[m\].
    pub bounds: [f64; 4],
    /// Obstacles, each by its corners \[m\].
    pub obstacles: Vec<Vec<[f64; 2]>>,
    /// Corners of the slot \[m\]; empty where there is none.
    pub slot: Vec<[f64; 2]>,
    /// Where the rear-axle centre was to start.
    pub start: Pose,
    /// Where it was to end.
    pub goal: Pose,
    /// Greatest |x|, |y| \[m\] and |yaw| \[rad\] of the end pose in the goal frame.
    pub tolerance: Pose,
    /// The vehicle's outline.
    pub footprint: Footprint,
}

/// Figures of the whole. What is not known is not a number, or none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// True end pose seen from the goal.
    pub end_error: Option<Pose>,
    /// Estimated end pose seen from the true one; without a truth, seen from the goal.
    pub estimate_error: Option<Pose>,
    /// Changes of the travel direction.
    pub gear_changes: u32,
    /// From the first command to the verdict \[s\].
    pub duration: f64,
    /// Length of the driven path, both directions added \[m\].
    pub path_length: f64,
    /// Least distance to an obstacle that the plan's certificate states \[m\].
    pub planned_clearance: Option<f64>,
    /// Least distance to an obstacle that was driven \[m\]; below zero: a collision.
    pub driven_clearance: Option<f64>,
    /// Steps that ended too late, all processes.
    pub deadline_misses: u64,
    /// Processes that were started again.
    pub restarts: u32,
}

/// A distribution of times \[s\].
#[derive(Clone, Debug, PartialEq)]
pub struct Latency {
    /// Median.
    pub p50: f64,
    /// 99 of 100 are no longer.
    pub p99: f64,
    /// 999 of 1000 are no longer.
    pub p999: f64,
    /// The longest.
    pub max: f64,
    /// What a step may take before it counts as late; none where nothing is asked.
    pub deadline: Option<f64>,
    /// (time \[s\], how often); any resolution, any order.
    pub counts: Vec<(f64, u64)>,
}

/// A plan as it was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Its points; times are of the run, not of the plan.
    pub points: Vec<Motion>,
}

/// An estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateSample {
    /// Time, pose, speed and steering.
    pub motion: Motion,
    /// Covariance of (x, y, yaw) in the scenario's frame, row by row \[m^2, m rad, rad^2\].
    pub covariance: [f64; 9],
}

/// A command and what the tracker saw when it gave it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandSample {
    /// Since the run's start \[s\].
    pub time: f64,
    /// Speed \[m/s\].
    pub speed: f64,
    /// Road-wheel angle \[rad\].
    pub steering: f64,
    /// Plan minus estimate along the plan's heading \[m\].
    pub error_along: f64,
    /// Across it \[m\].
    pub error_across: f64,
    /// Of the heading \[rad\].
    pub error_yaw: f64,
}

/// A stretch of time in one mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    /// Beginning \[s\].
    pub start: f64,
    /// End \[s\].
    pub end: f64,
    /// The mode's name.
    pub mode: String,
    /// How it is shaded.
    pub tone: Tone,
}

/// Kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// The mode changed.
    Mode,
    /// The operator armed.
    Arm,
    /// A plan was taken up.
    Plan,
    /// A fault.
    Fault,
    /// A process was started again.
    Restart,
    /// Anything else.
    Note,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// When \[s\].
    pub time: f64,
    /// What kind.
    pub kind: EventKind,
    /// In words.
    pub text: String,
}

/// Figures of a process.
#[derive(Clone, Debug, PartialEq)]
pub struct ProcessFigures {
    /// Name.
    pub name: String,
    /// Its last pid; none in lockstep.
    pub pid: Option<u32>,
    /// How often it was started again.
    pub restarts: u32,
    /// Deadlines it missed.
    pub misses: u64,
    /// Mean time of a step \[s\].
    pub work_mean: f64,
    /// Longest time of a step \[s\].
    pub work_max: f64,
}
