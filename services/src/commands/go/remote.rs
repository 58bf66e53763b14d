//! `go` through the gateway of another user's instance.

use core::time::Duration;
use std::sync::atomic::{AtomicBool, Ordering};

use kerbside_geometry::Pose;
use kerbside_messages::{Cause, Message, Odometry, PlanRequest, State, nanos};
use kerbside_runtime::now;
use serde_json::{Value, json};

use super::{GoArgs, LOOK, OVERTIME, PLAN, Wish, is_over};
use crate::exit::{Exit, Failure};
use crate::gateway::remote::Remote;
use crate::life;
use crate::manoeuvre::cause_of;

/// Longest wait for an answer.
const ANSWER: Duration = Duration::from_secs(2);
/// Longest wait for a vehicle to stand and for a pose \[s\].
const STAND: f64 = 2.0;

/// Runs the verb.
pub(super) fn run(
    args: &GoArgs,
    wish: &Wish,
    remote: &mut Remote,
    stop: &AtomicBool,
) -> Result<Exit, Failure> {
    let armed = remote.ask(&json!({ "request": "arm" }), ANSWER)?;
    let arm = armed["arms"].as_u64().filter(|_| armed["ok"] == true);
    let Some(arm) = arm else { return Err(remote.refused(&armed)) };
    let start = pose(remote)?;
    let mut request = wish.request(&start);
    request.arm = arm;
    remote.watch(State::TOPIC.name)?;
    let asked = remote.send(&json!({ "request": "plan", "plan": as_json(&request) }))?;
    let (there, cause, plan) = drive(remote, asked, arm, stop)?;
    let more = json!({
        "cause": cause, "duration_s": plan["duration"], "min_clearance_m": plan["clearance"],
        "gear_changes": plan["gear_changes"],
    });
    args.operator.tell("go", remote.instance(), there, more, &cause);
    Ok(if there { Exit::Good } else { Exit::Bad })
}

/// Where the vehicle stands; where it believes to be, if it does not come to rest.
fn pose(remote: &mut Remote) -> Result<Pose, Failure> {
    let deadline = now() + nanos(STAND);
    let mut newest: Option<Odometry> = None;
    remote.watch(Odometry::TOPIC.name)?;
    while newest.is_none_or(|newest| newest.standstill == 0) && remote.receive(deadline)? {
        newest = remote.sample()?.or(newest);
    }
    let request = json!({ "request": "unsubscribe", "topic": Odometry::TOPIC.name });
    remote.ask(&request, ANSWER)?;
    newest
        .map(|newest| Pose::new(newest.x, newest.y, newest.yaw))
        .ok_or_else(|| Failure::unavailable("no estimate of the pose comes"))
}

/// A goal as the gateway takes it: obstacles as polygons.
fn as_json(request: &PlanRequest) -> Value {
    let obstacles: Vec<Vec<[f64; 2]>> = request.obstacles().map(<[_]>::to_vec).collect();
    json!({
        "arm": request.arm, "x": request.x, "y": request.y, "yaw": request.yaw,
        "clearance": request.clearance, "steering": request.steering, "speed": request.speed,
        "bounds": request.bounds, "gear_changes": request.gear_changes, "gear": request.gear,
        "obstacles": obstacles,
    })
}

/// Sees the manoeuvre of this arm through: whether it got there, why not, and the plan's figures. Whatever ends it early
/// leaves the vehicle stopped.
fn drive(
    remote: &mut Remote,
    asked: u64,
    arm: u64,
    stop: &AtomicBool,
) -> Result<(bool, String, Value), Failure> {
    let mut plan = Value::Null;
    let mut deadline = now() + nanos(PLAN);
    loop {
        if let Some(reply) = remote.reply(asked) {
            if reply["ok"] != true {
                remote.ask(&json!({ "request": "stop" }), ANSWER)?;
                let words = reply["error"]["found"].as_str().unwrap_or("no reason given");
                return Ok((false, format!("no plan: {words}"), Value::Null));
            }
            deadline = now() + nanos(reply["duration"].as_f64().unwrap_or(0.0) + OVERTIME);
            plan = reply;
        }
        if let Some(state) = remote.sample::<State>()?.filter(|state| is_over(state, arm)) {
            return Ok((state.cause == Cause::Completed.code(), cause_of(&state), plan));
        }
        let overdue = if plan.is_null() { "no plan came" } else { "longer under way than planned" };
        let ended = [(stop.load(Ordering::Relaxed), "interrupted"), (now() > deadline, overdue)];
        if let Some((_, why)) = ended.into_iter().find(|(ended, _)| *ended) {
            remote.ask(&json!({ "request": "stop" }), ANSWER)?;
            return Ok((false, why.to_owned(), plan));
        }
        remote.receive(now() + life::nanos(LOOK))?;
    }
}

#[cfg(test)]
mod tests {
    use kerbside_settings::GatewaySettings;

    use super::*;
    use crate::gateway::request::{Request, parse};

    #[test]
    fn the_gateway_understands_what_this_asks() {
        let parking = crate::configuration::parking(None, "garage", None).unwrap();
        let mut wanted = parking.scenario.value.plan_request(&parking.stack.value.vehicle);
        wanted.arm = 7;
        let line = json!({ "request": "plan", "plan": as_json(&wanted) }).to_string();
        let (_, request) = parse(line.as_bytes(), now(), &GatewaySettings::default());
        assert_eq!(request, Ok(Request::Plan(Box::new(wanted))));
    }
}
