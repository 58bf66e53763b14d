//! `arm`, `stop`, `down`, `fix`, `go`: what an operator asks of a running stack.

use core::time::Duration;
use std::path::PathBuf;

use kerbside_geometry::angle;
use kerbside_messages::{
    Fix, FixVerdict, Header, Mode, Odometry, OperatorAnswer, OperatorRequest, PlanAnswer,
    PlanRequest, PlanVerdict, Process, State, Verb, text,
};
use kerbside_runtime::{Instance, Newest, Session, Ticker, now};
use serde_json::json;

use super::status::instance_of;
use crate::configuration;
use crate::exit::{Exit, Failure};
use crate::lockstep::words_of;

/// Longest wait for the supervisor's answer.
const PATIENCE: Duration = Duration::from_secs(1);
/// Longest wait for a plan.
const PLAN: Duration = Duration::from_secs(30);
/// Longest wait for an estimate that tells what became of a fix.
const FIX: u64 = 1_000_000_000;

/// Which stack, and how to answer.
#[derive(Clone, Debug, clap::Args)]
pub struct OperatorArgs {
    /// Name of the instance; the only live one where not given.
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A pose for the estimator.
#[derive(Clone, Debug, clap::Args)]
pub struct FixArgs {
    #[command(flatten)]
    operator: OperatorArgs,
    /// Position along x [m].
    #[arg(allow_hyphen_values = true)]
    x: f64,
    /// Position along y [m].
    #[arg(allow_hyphen_values = true)]
    y: f64,
    /// Heading [degrees].
    #[arg(allow_hyphen_values = true)]
    yaw: f64,
    /// Standard deviation of the position [m].
    #[arg(long, default_value_t = 0.002)]
    position_noise: f64,
    /// Standard deviation of the heading [degrees].
    #[arg(long, default_value_t = 0.1)]
    yaw_noise: f64,
}

/// A goal.
#[derive(Clone, Debug, clap::Args)]
pub struct GoArgs {
    #[command(flatten)]
    operator: OperatorArgs,
    /// Scenario whose goal and obstacles are meant: a name or a file.
    scenario: String,
    /// Configuration: a stack's file, or a folder like config/.
    #[arg(long, value_name = "PATH")]
    config: Option<PathBuf>,
    /// Vehicle, in place of the scenario's.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<String>,
}

/// Asks the supervisor for `verb`.
///
/// # Errors
/// [`Failure`] where there is no stack or it does not answer.
pub fn ask(args: &OperatorArgs, verb: Verb) -> Result<Exit, Failure> {
    let instance = instance_of(args.instance.as_deref())?;
    let session = Session::join(&instance, Process::Operator)?;
    let answer = request(&session, verb)?;
    if verb == Verb::Down && answer.accepted == 1 {
        wait_for_end(&instance);
    }
    tell(args, &instance, &answer);
    Ok(if answer.accepted == 1 { Exit::Good } else { Exit::Bad })
}

fn request(session: &Session, verb: Verb) -> Result<OperatorAnswer, Failure> {
    let client = session.client::<OperatorRequest, OperatorAnswer>()?;
    let id = now();
    let request = OperatorRequest {
        id,
        pid: std::process::id(),
        verb: verb.code(),
        ..OperatorRequest::default()
    };
    let answer = client.ask(request, PATIENCE)?;
    answer.ok_or_else(|| {
        Failure::unavailable(format!("the supervisor did not answer {verb} within 1 s"))
    })
}

fn wait_for_end(instance: &Instance) {
    let mut look = Ticker::new(Duration::from_millis(10));
    let deadline = now() + 10_000_000_000;
    while instance.supervisor().is_some() && now() < deadline {
        look.wait();
    }
}

fn tell(args: &OperatorArgs, instance: &Instance, answer: &OperatorAnswer) {
    let mode = Mode::from_code(answer.mode).map_or("unknown", Mode::name);
    let (accepted, words) = (answer.accepted == 1, text::as_str(&answer.text));
    if args.json {
        let object = json!({
            "schema": "kerbside.operator.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null, "passed": accepted,
            "figures": [], "instance": instance.name(), "mode": mode, "arms": answer.arms, "text": words,
        });
        println!("{object}");
    } else if accepted {
        println!("{}: {mode}", instance.name());
    } else {
        println!("{}: refused: {words}", instance.name());
    }
}

/// Publishes a fix and tells what became of it.
///
/// # Errors
/// [`Failure`] where there is no stack, or no estimate comes.
pub fn fix(args: &FixArgs) -> Result<Exit, Failure> {
    let numbers = [args.x, args.y, args.yaw, args.position_noise, args.yaw_noise];
    if numbers.iter().any(|number| !number.is_finite())
        || args.position_noise <= 0.0
        || args.yaw_noise <= 0.0
    {
        return Err(Failure::new(
            Exit::Usage,
            "a fix takes finite numbers, and deviations above 0",
        ));
    }
    let instance = instance_of(args.operator.instance.as_deref())?;
    let session = Session::join(&instance, Process::Operator)?;
    let mut odometry = Newest::of(session.subscriber::<Odometry>(None, 1)?);
    let mut publisher = session.publisher::<Fix>(None)?;
    let before = newest_odometry(&mut odometry, |_| true)?;
    let (position, yaw) = (args.position_noise.powi(2), angle::radians(args.yaw_noise).powi(2));
    publisher.send(|fix| {
        *fix = Fix {
            header: Header::stamped(now(), 0),
            x: args.x,
            y: args.y,
            yaw: angle::radians(args.yaw),
            covariance: [position, 0.0, 0.0, 0.0, position, 0.0, 0.0, 0.0, yaw],
            source: text::from_str("operator"),
        };
        true
    })?;
    let judged = |odometry: &Odometry| {
        odometry.resets != before.resets || odometry.fix_sequence != before.fix_sequence
    };
    let after = newest_odometry(&mut odometry, judged)?;
    let verdict = FixVerdict::from_code(after.fix_verdict).unwrap_or(FixVerdict::None);
    let accepted = verdict == FixVerdict::Accepted;
    if args.operator.json {
        let object = json!({
            "schema": "kerbside.fix.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null, "passed": accepted,
            "figures": [], "instance": instance.name(), "verdict": verdict.name(),
        });
        println!("{object}");
    } else {
        println!("{}: fix {verdict}", instance.name());
    }
    Ok(if accepted { Exit::Good } else { Exit::Bad })
}

fn newest_odometry(
    odometry: &mut Newest<Odometry>,
    wanted: impl Fn(&Odometry) -> bool,
) -> Result<Odometry, Failure> {
    let mut look = Ticker::new(Duration::from_millis(2));
    let deadline = now() + FIX;
    loop {
        if odometry.update()
            && let Some(newest) = odometry.get()
            && wanted(newest)
        {
            return Ok(*newest);
        }
        if now() > deadline {
            return Err(Failure::unavailable(
                "no estimate came within 1 s: is the vehicle's line up?",
            ));
        }
        look.wait();
    }
}

/// Arms, asks for a plan to the scenario's goal, and watches until the vehicle is there or stops.
///
/// # Errors
/// [`Failure`] where there is no stack, or the scenario is refused.
pub fn go(args: &GoArgs) -> Result<Exit, Failure> {
    let parking =
        configuration::parking(args.config.as_deref(), &args.scenario, args.vehicle.as_deref())?;
    let instance = instance_of(args.operator.instance.as_deref())?;
    let session = Session::join(&instance, Process::Operator)?;
    let mut state = Newest::of(session.subscriber::<State>(None, 1)?);
    let planner = session.client::<PlanRequest, PlanAnswer>()?;
    let answer = request(&session, Verb::Arm)?;
    if answer.accepted == 0 {
        tell(&args.operator, &instance, &answer);
        return Ok(Exit::Bad);
    }
    let mut request = parking.scenario.value.plan_request(&parking.stack.value.vehicle);
    (request.id, request.arm) = (now(), answer.arms);
    let planned = planner.ask(request, PLAN)?;
    let planned =
        planned.ok_or_else(|| Failure::unavailable("the planner did not answer within 30 s"))?;
    if planned.verdict != PlanVerdict::Found.code() {
        return Err(Failure::new(Exit::Bad, format!("no plan: {}", words_of(&planned))));
    }
    let cause = watch(&mut state, answer.arms)?;
    let completed = cause.0;
    if args.operator.json {
        let object = json!({
            "schema": "kerbside.go.v1", "version": env!("CARGO_PKG_VERSION"), "seed": null, "passed": completed,
            "figures": [], "instance": instance.name(), "cause": cause.1, "duration_s": planned.duration,
            "min_clearance_m": planned.clearance, "gear_changes": planned.gear_changes,
        });
        println!("{object}");
    } else {
        println!("{}: {}", instance.name(), cause.1);
    }
    Ok(if completed { Exit::Good } else { Exit::Bad })
}

/// Waits until the stack has left `driving` under this arm.
fn watch(state: &mut Newest<State>, arm: u64) -> Result<(bool, String), Failure> {
    let mut look = Ticker::new(Duration::from_millis(20));
    let mut heard = now();
    loop {
        if state.update() {
            heard = now();
        }
        if let Some(state) = state.get()
            && state.arms >= arm
            && matches!(state.mode(), Mode::Ready | Mode::Faulted)
        {
            let completed = state.cause == kerbside_messages::Cause::Completed.code();
            return Ok((completed, crate::manoeuvre::cause_of(state)));
        }
        if now().saturating_sub(heard) > 1_000_000_000 {
            return Err(Failure::unavailable("supervisor lost"));
        }
        look.wait();
    }
}
