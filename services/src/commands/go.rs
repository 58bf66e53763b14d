//! `go`: arms, has a plan made to a goal, and watches until the vehicle is there or stops.

mod remote;

use core::time::Duration;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use kerbside_geometry::{Pose, Vehicle, math};
use kerbside_messages::{
    Cause, Message, Mode, Nanos, Odometry, PlanAnswer, PlanRequest, PlanVerdict, State, Verb, nanos,
};
use kerbside_runtime::{Newest, Ticker, now};
use serde_json::json;

use super::operator::{self, Desk, OperatorArgs};
use crate::configuration;
use crate::exit::{Exit, Failure};
use crate::gateway::remote::Remote;
use crate::life::stop_flag;
use crate::lockstep::words_of;
use crate::manoeuvre::cause_of;

/// For the end of the help.
pub const EXAMPLES: &str = "Examples: kerbside go garage
          kerbside go 1.5 0.6 0 --among garage";

/// Time between looks.
const LOOK: Duration = Duration::from_millis(20);
/// Longest wait for a plan \[s\].
const PLAN: f64 = 30.0;
/// Longest drive beyond the plan's own duration \[s\].
const OVERTIME: f64 = 20.0;

/// Part of the steering limit that a plan to a pose may use: the rest is the tracker's.
const STEERING: f64 = 28.0 / 30.0;
/// Top speed of a plan to a pose: wheelbases a second, and most \[m/s\].
const SPEED: (f64, f64) = (0.4, 1.0);
/// Room around start and goal, in turning radii.
const ROOM: f64 = 3.0;
/// Changes of direction on the way to a pose.
const GEAR_CHANGES: u32 = 4;

/// Where to go.
#[derive(Clone, Debug, clap::Args)]
#[command(
    override_usage = "kerbside go [OPTIONS] <SCENARIO>\n       kerbside go [OPTIONS] <X> <Y> <YAW>"
)]
pub struct GoArgs {
    #[command(flatten)]
    operator: OperatorArgs,
    /// A scenario, whose goal is meant: a name or a file; or a pose: x and y of the rear axle's
    /// centre in metres, heading in degrees. On the way to a pose nothing is held to be in the
    /// way, unless --among says what is.
    #[arg(value_name = "GOAL", required = true, num_args = 1..=3, allow_negative_numbers = true)]
    goal: Vec<String>,
    /// Scenario whose obstacles, bounds and limits hold on the way to a pose.
    #[arg(long, value_name = "SCENARIO")]
    among: Option<String>,
    /// Configuration: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH")]
    config: Option<PathBuf>,
    /// Vehicle, in place of the one the configuration names.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<String>,
}

/// A goal, with what holds on the way.
#[derive(Clone, Debug)]
enum Wish {
    /// All of it is known.
    Stated(Box<PlanRequest>),
    /// Nothing is in the way; how far the way leads depends on where it starts.
    Free { goal: Pose, vehicle: Box<Vehicle> },
}

impl Wish {
    fn of(args: &GoArgs) -> Result<Self, Failure> {
        let (config, vehicle) = (args.config.as_deref(), args.vehicle.as_deref());
        let among = |scenario: &str| {
            let parking = configuration::parking(config, scenario, vehicle)?;
            Ok::<_, Failure>(parking.scenario.value.plan_request(&parking.stack.value.vehicle))
        };
        match (&args.goal[..], &args.among) {
            ([scenario], None) => Ok(Self::Stated(Box::new(among(scenario)?))),
            ([_, _, _], Some(scenario)) => {
                let goal = pose(&args.goal)?;
                let request = PlanRequest { gear: 0, ..towards(&goal, among(scenario)?) };
                Ok(Self::Stated(Box::new(valid(request)?)))
            }
            ([_, _, _], None) => {
                let vehicle = Box::new(configuration::stack(config, vehicle)?.vehicle);
                let goal = pose(&args.goal)?;
                valid(free(&vehicle, &goal, &goal))?;
                Ok(Self::Free { goal, vehicle })
            }
            ([_], Some(_)) => Err(usage("--among goes with a pose; a scenario has its own")),
            (goal, _) => Err(usage(&format!("found {}, {ALLOWED}", goal.join(" ")))),
        }
    }

    fn request(&self, start: &Pose) -> PlanRequest {
        match self {
            Self::Stated(request) => **request,
            Self::Free { goal, vehicle } => free(vehicle, start, goal),
        }
    }
}

const ALLOWED: &str = "allowed are a scenario, or three numbers: x and y in metres, yaw in degrees";

fn usage(words: &str) -> Failure {
    Failure::new(Exit::Usage, words)
}

fn pose(goal: &[String]) -> Result<Pose, Failure> {
    crate::vehicle::parse_pose(&goal.join(","))
        .map_err(|_| usage(&format!("found {}, {ALLOWED}", goal.join(" "))))
}

fn towards(goal: &Pose, request: PlanRequest) -> PlanRequest {
    PlanRequest { x: goal.x, y: goal.y, yaw: goal.yaw, ..request }
}

/// A request that the planner's side would refuse without a word is refused here, with words.
fn valid(request: PlanRequest) -> Result<PlanRequest, Failure> {
    request
        .validate()
        .map(|()| request)
        .map_err(|refusal| usage(&format!("no goal for a vehicle: {refusal}")))
}

/// A way through free space, with room to turn around start and goal.
fn free(vehicle: &Vehicle, start: &Pose, goal: &Pose) -> PlanRequest {
    let steering = STEERING * vehicle.limits.steering;
    let room = ROOM * vehicle.wheelbase / math::tan(steering) + vehicle.footprint.reach();
    let sides = |a: f64, b: f64| (a.min(b) - room, a.max(b) + room);
    let ((left, right), (low, high)) = (sides(start.x, goal.x), sides(start.y, goal.y));
    let request = PlanRequest {
        steering,
        speed: (SPEED.0 * vehicle.wheelbase).min(SPEED.1).min(vehicle.limits.speed),
        bounds: [left, low, right, high],
        gear_changes: GEAR_CHANGES,
        ..PlanRequest::default()
    };
    towards(goal, request)
}

/// How it ended.
struct Arrival {
    there: bool,
    cause: String,
    plan: Option<PlanAnswer>,
}

impl Arrival {
    fn short(cause: impl Into<String>, plan: Option<PlanAnswer>) -> Self {
        Self { there: false, cause: cause.into(), plan }
    }
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where there is no stack, or the goal is refused.
pub fn run(args: &GoArgs) -> Result<Exit, Failure> {
    let wish = Wish::of(args)?;
    let stop = stop_flag()?;
    if let Some(mut remote) = Remote::find(args.operator.instance.as_deref())? {
        return remote::run(args, &wish, &mut remote, &stop);
    }
    let mut desk = Desk::open(&args.operator)?;
    let mut odometry = Newest::of(desk.session.subscriber::<Odometry>(None, 1)?);
    let planner = desk.session.client::<PlanRequest, PlanAnswer>()?;
    let armed = desk.ask(Verb::Arm)?;
    if armed.accepted == 0 {
        let mode = Mode::from_code(armed.mode).unwrap_or(Mode::Faulted);
        return Ok(operator::tell(&args.operator, &desk, &armed, mode));
    }
    let start = wait_for_pose(&mut desk, &mut odometry)?;
    let mut request = wish.request(&start);
    (request.id, request.arm) = (now(), armed.arms);
    let arrival = drive(&mut desk, planner.send(request)?, armed.arms, &stop)?;
    let more = json!({
        "cause": arrival.cause,
        "duration_s": arrival.plan.map(|plan| plan.duration),
        "min_clearance_m": arrival.plan.map(|plan| plan.clearance).filter(|value| value.is_finite()),
        "gear_changes": arrival.plan.map(|plan| plan.gear_changes),
    });
    args.operator.tell("go", desk.instance.name(), arrival.there, more, &arrival.cause);
    Ok(if arrival.there { Exit::Good } else { Exit::Bad })
}

fn wait_for_pose(desk: &mut Desk, odometry: &mut Newest<Odometry>) -> Result<Pose, Failure> {
    let mut look = Ticker::new(LOOK);
    let deadline = now() + nanos(2.0);
    // A vehicle that is just coming to rest stands before the planner is asked: it refuses a moving one.
    while !(odometry.update() && odometry.get().is_some_and(|newest| newest.standstill == 1))
        && now() < deadline
    {
        desk.state()?;
        look.wait();
    }
    let newest = odometry.get().map(|odometry| Pose::new(odometry.x, odometry.y, odometry.yaw));
    newest.ok_or_else(|| Failure::unavailable("no estimate of the pose comes"))
}

type Pending = kerbside_runtime::Pending<PlanRequest, PlanAnswer>;

/// Sees the manoeuvre of this arm through; whatever ends it early leaves the vehicle stopped.
fn drive(
    desk: &mut Desk,
    mut pending: Pending,
    arm: u64,
    stop: &Arc<AtomicBool>,
) -> Result<Arrival, Failure> {
    let mut look = Ticker::new(LOOK);
    let mut plan = None;
    let mut deadline: Nanos = now() + nanos(PLAN);
    loop {
        if plan.is_none()
            && let Some(answer) = pending.poll()
        {
            if answer.verdict != PlanVerdict::Found.code() {
                desk.stop()?;
                return Ok(Arrival::short(format!("no plan: {}", words_of(&answer)), None));
            }
            deadline = now() + nanos(answer.duration + OVERTIME);
            plan = Some(answer);
        }
        if let Some(state) = desk.state()?.filter(|state| is_over(state, arm)) {
            let there = state.cause == Cause::Completed.code();
            return Ok(Arrival { there, cause: cause_of(&state), plan });
        }
        let overdue = if plan.is_some() { "longer under way than planned" } else { "no plan came" };
        let ended = [(stop.load(Ordering::Relaxed), "interrupted"), (now() > deadline, overdue)];
        if let Some((_, why)) = ended.into_iter().find(|(ended, _)| *ended) {
            desk.stop()?;
            return Ok(Arrival::short(why, plan));
        }
        look.wait();
    }
}

/// Whether the stack has left what this arm began; a state from before the arm says nothing.
fn is_over(state: &State, arm: u64) -> bool {
    state.arms >= arm && matches!(state.mode(), Mode::Ready | Mode::Faulted)
}

#[cfg(test)]
mod tests {
    use kerbside_geometry::angle;

    use super::*;

    fn args(goal: &[&str], among: Option<&str>) -> GoArgs {
        GoArgs {
            operator: OperatorArgs::default(),
            goal: goal.iter().map(|word| (*word).to_owned()).collect(),
            among: among.map(str::to_owned),
            config: None,
            vehicle: None,
        }
    }

    #[test]
    fn goals_are_scenarios_or_poses() {
        assert!(matches!(Wish::of(&args(&["garage"], None)), Ok(Wish::Stated(_))));
        let Ok(Wish::Stated(request)) = Wish::of(&args(&["1", "0.5", "90"], Some("garage"))) else {
            panic!("a pose among obstacles");
        };
        assert!(request.obstacles().count() > 0 && (request.x, request.gear) == (1.0, 0));
        let free = Wish::of(&args(&["1", "0.5", "90"], None)).unwrap();
        let request = free.request(&Pose::new(-1.0, 0.0, 0.0));
        assert_eq!(request.obstacles().count(), 0);
        assert!(request.bounds[0] < -3.0 && request.bounds[2] > 3.0, "{:?}", request.bounds);
    }

    #[test]
    fn what_is_neither_is_refused_as_usage() {
        for goal in [&["1", "2"][..], &["1", "2", "x"], &["1", "2", "nan"], &["1e30", "0", "0"]] {
            let failure = Wish::of(&args(goal, None)).unwrap_err();
            assert_eq!(failure.exit, Exit::Usage, "{goal:?}: {:?}", failure.report);
        }
        assert_eq!(Wish::of(&args(&["garage"], Some("garage"))).unwrap_err().exit, Exit::Usage);
    }

    #[test]
    fn a_way_through_free_space_is_found_in_any_direction() {
        let stack = configuration::stack(None, None).unwrap();
        for (x, y, yaw) in
            [(2.0, 0.0, 0.0), (-1.0, 0.5, 90.0), (0.3, 1.2, 180.0), (0.0, 0.0, -90.0)]
        {
            let (start, goal) = (Pose::default(), Pose::new(x, y, angle::radians(yaw)));
            let request = free(&stack.vehicle, &start, &goal);
            let plan = kerbside_planning::plan(
                &stack.vehicle,
                &stack.planner,
                start,
                &request,
                &mut |_| {},
            );
            let points = plan.unwrap().points;
            let end = points.last().unwrap();
            assert!(Pose::new(end.x, end.y, end.yaw).distance(&goal) < 1e-3, "{goal:?}");
        }
    }
}
