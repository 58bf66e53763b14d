//! What a client asks: one JSON object a line, read and checked before anything is done.

use kerbside_messages::layout::Described;
use kerbside_messages::topics::TABLE;
use kerbside_messages::{
    Fix, Header, Inhibit, Message, Nanos, PlanRequest, Process, Publisher, Topic, text,
};
use kerbside_settings::{GatewaySettings, Right};
use serde_json::{Map, Value};

use crate::fields::{FieldError, Presence, cut, from_json, shown};

/// Longest `id` of a request \[byte\], as JSON.
const LONGEST_ID: usize = 64;

/// What a client asks.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// The mode and each process.
    Status,
    /// The topics that can be subscribed to, with their schemas.
    Topics,
    /// Samples of a topic, the newest at `rate` a second \[Hz\].
    Subscribe {
        /// Which.
        stream: Stream,
        /// How often at most.
        rate: f64,
    },
    /// No more samples of a topic.
    Unsubscribe {
        /// Which.
        stream: Stream,
    },
    /// A pose for the estimator; its source and its seal are still missing.
    Fix(Box<Fix>),
    /// A demand to stop; who asks and its seal are still missing.
    Inhibit(Box<Inhibit>),
    /// A goal for the planner; its id and its seal are still missing.
    Plan(Box<PlanRequest>),
    /// Permit motion for the next plan.
    Arm,
    /// Stop the vehicle.
    Stop,
}

/// A topic, and of heartbeats whose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stream {
    /// The topic.
    pub topic: &'static Topic,
    /// The process, for a topic that each process has of its own.
    pub process: Option<Process>,
}

impl Request {
    /// What a line of a request is called.
    pub const NAMES: [&'static str; 9] =
        ["status", "topics", "subscribe", "unsubscribe", "fix", "inhibit", "plan", "arm", "stop"];

    /// The right it takes.
    #[must_use]
    pub fn right(&self) -> Right {
        match self {
            Self::Status | Self::Topics | Self::Subscribe { .. } | Self::Unsubscribe { .. } => {
                Right::Watch
            }
            Self::Fix(_) => Right::Fix,
            Self::Inhibit(_) => Right::Inhibit,
            Self::Plan(_) => Right::Plan,
            Self::Arm => Right::Arm,
            Self::Stop => Right::Stop,
        }
    }
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}: found {found}, allowed is {allowed}")]
pub struct Complaint {
    /// The key or field, or the line itself.
    pub what: String,
    /// What was found there.
    pub found: String,
    /// What is allowed there.
    pub allowed: String,
}

impl Complaint {
    fn new(what: &str, found: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self { what: what.to_owned(), found: found.into(), allowed: allowed.into() }
    }

    fn of(what: &str, error: FieldError) -> Self {
        let what =
            if error.path.is_empty() { what.to_owned() } else { format!("{what}.{}", error.path) };
        Self { what, found: error.found, allowed: error.allowed }
    }
}

/// A line: the id that the reply repeats, null where there is none, and the request, or what is wrong with it.
pub fn parse(
    line: &[u8],
    now: Nanos,
    settings: &GatewaySettings,
) -> (Value, Result<Request, Complaint>) {
    let object = match serde_json::from_slice(line) {
        Ok(Value::Object(object)) => object,
        Ok(other) => return (Value::Null, Err(no_request(shown(&other)))),
        Err(error) => return (Value::Null, Err(no_request(error.to_string()))),
    };
    let id = object.get("id").cloned().unwrap_or_default();
    if !matches!(id, Value::Null | Value::String(_) | Value::Number(_))
        || id.to_string().len() > LONGEST_ID
    {
        let allowed = format!("a string or number of at most {LONGEST_ID} bytes");
        return (Value::Null, Err(Complaint::new("id", shown(&id), allowed)));
    }
    (id, request(object, now, settings))
}

fn no_request(found: String) -> Complaint {
    Complaint::new("line", found, "a JSON object with the key \"request\"")
}

fn request(
    mut object: Map<String, Value>,
    now: Nanos,
    settings: &GatewaySettings,
) -> Result<Request, Complaint> {
    object.remove("id");
    let name = object.remove("request").unwrap_or_default();
    let known =
        name.as_str().and_then(|name| Request::NAMES.into_iter().find(|known| *known == name));
    let Some(name) = known else {
        return Err(Complaint::new("request", shown(&name), Request::NAMES.join(", ")));
    };
    let mut take = |key: &str| object.remove(key);
    let request = match name {
        "status" => Request::Status,
        "topics" => Request::Topics,
        "arm" => Request::Arm,
        "stop" => Request::Stop,
        "subscribe" => {
            let stream = stream(take("topic"), take("process"))?;
            Request::Subscribe { stream, rate: rate(take("rate"), settings)? }
        }
        "unsubscribe" => Request::Unsubscribe { stream: stream(take("topic"), take("process"))? },
        "fix" => Request::Fix(Box::new(fix(&take("fix").unwrap_or_default(), now)?)),
        "inhibit" => Request::Inhibit(Box::new(inhibit(
            &take("inhibit").unwrap_or_default(),
            now,
            settings,
        )?)),
        _ => Request::Plan(Box::new(plan(take("plan").unwrap_or_default())?)),
    };
    if let Some((key, value)) = object.iter().next() {
        let found = format!("the key \"{}\" ({})", cut(key), shown(value));
        return Err(Complaint::new("line", found, keys_of(name)));
    }
    Ok(request)
}

/// The keys of a request, for who wrote another one.
fn keys_of(name: &str) -> String {
    let more = match name {
        "subscribe" => ", topic, process, rate",
        "unsubscribe" => ", topic, process",
        "fix" => ", fix",
        "inhibit" => ", inhibit",
        "plan" => ", plan",
        _ => "",
    };
    format!("id, request{more}")
}

/// What can be subscribed to: whatever is recorded, but not the truth, which is for recordings and reports alone.
pub fn streams() -> impl Iterator<Item = Stream> {
    let offered =
        |topic: &&Topic| topic.recorded && topic.id != kerbside_messages::topics::TRUTH.id;
    TABLE.iter().filter(offered).flat_map(|topic| {
        let processes: Vec<_> = match topic.publisher {
            Publisher::Each => Process::SUPERVISED.into_iter().map(Some).collect(),
            _ => vec![None],
        };
        processes.into_iter().map(move |process| Stream { topic, process })
    })
}

fn stream(topic: Option<Value>, process: Option<Value>) -> Result<Stream, Complaint> {
    let topic = topic.unwrap_or_default();
    let of_topic: Vec<_> =
        streams().filter(|stream| topic.as_str() == Some(stream.topic.name)).collect();
    if of_topic.is_empty() {
        let mut names: Vec<_> = streams().map(|stream| stream.topic.name).collect();
        names.dedup();
        return Err(Complaint::new("topic", shown(&topic), names.join(", ")));
    }
    let name = process.as_ref().map_or(Some(""), Value::as_str);
    let named = |stream: &&Stream| name == Some(stream.process.map_or("", Process::name));
    of_topic.iter().find(named).copied().ok_or_else(|| {
        let names: Vec<_> = of_topic.iter().filter_map(|stream| stream.process).collect();
        let names: Vec<_> = names.into_iter().map(Process::name).collect();
        let allowed = if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
        Complaint::new("process", process.as_ref().map_or("nothing".to_owned(), shown), allowed)
    })
}

fn rate(rate: Option<Value>, settings: &GatewaySettings) -> Result<f64, Complaint> {
    let most = settings.sample_rate;
    let Some(value) = rate else { return Ok(most) };
    value.as_f64().filter(|rate| *rate > 0.0 && *rate <= most).ok_or_else(|| {
        let allowed = format!("a number in Hz, above 0, at most gateway.sample_rate = {most}");
        Complaint::new("rate", shown(&value), allowed)
    })
}

/// Only the stamp of a header is the client's own to say.
fn of_header(path: &str) -> Option<Presence> {
    let rest = path.strip_prefix("header.")?;
    Some(if rest == "stamp" { Presence::Optional } else { Presence::FilledIn })
}

fn read<M: Message>(
    what: &str,
    value: &Value,
    presence: &dyn Fn(&str) -> Presence,
) -> Result<M, Complaint> {
    let mut message = M::default();
    from_json(<M as Described>::LAYOUT, value, presence, bytemuck::bytes_of_mut(&mut message))
        .map_err(|error| Complaint::of(what, error))?;
    Ok(message)
}

fn valid<M: Message>(what: &str, message: M) -> Result<M, Complaint> {
    message.validate().map(|()| message).map_err(|refusal| {
        Complaint::new(what, refusal.to_string(), "what the schema says; see topics")
    })
}

fn fix(value: &Value, now: Nanos) -> Result<Fix, Complaint> {
    let mut fix: Fix = read("fix", value, &|path| {
        of_header(path).unwrap_or(match path {
            "x" | "y" | "yaw" | "covariance" => Presence::Required,
            "source" => Presence::FilledIn,
            _ => Presence::Optional,
        })
    })?;
    if fix.header.stamp == 0 {
        fix.header.stamp = now;
    }
    if fix.header.stamp > now {
        let allowed = format!("at most now, {now} ns of the monotonic clock");
        return Err(Complaint::new("fix.header.stamp", fix.header.stamp.to_string(), allowed));
    }
    valid("fix", fix)
}

fn inhibit(value: &Value, now: Nanos, settings: &GatewaySettings) -> Result<Inhibit, Complaint> {
    let mut inhibit: Inhibit = read("inhibit", value, &|path| {
        of_header(path).unwrap_or(match path {
            "expiry" | "why" => Presence::Required,
            "who" => Presence::FilledIn,
            _ => Presence::Optional,
        })
    })?;
    inhibit.header = Header::stamped(now, 0);
    let latest = now.saturating_add(crate::life::nanos(settings.inhibit));
    if !(now..=latest).contains(&inhibit.expiry) {
        let allowed = format!(
            "{now} to {latest} ns of the monotonic clock: from now on at most gateway.inhibit = {} s",
            settings.inhibit.as_secs_f64()
        );
        return Err(Complaint::new("inhibit.expiry", inhibit.expiry.to_string(), allowed));
    }
    if text::as_str(&inhibit.why).is_empty() {
        return Err(Complaint::new("inhibit.why", "an empty text", "a reason in words"));
    }
    valid("inhibit", inhibit)
}

fn plan(mut value: Value) -> Result<PlanRequest, Complaint> {
    let obstacles = value.as_object_mut().and_then(|object| object.remove("obstacles"));
    let mut plan: PlanRequest = read("plan", &value, &|path| {
        of_header(path).unwrap_or(match path {
            "id" | "vertices" | "sizes" => Presence::FilledIn,
            "gear" => Presence::Optional,
            "header" => Presence::FilledIn,
            _ => Presence::Required,
        })
    })?;
    let obstacles = obstacles.unwrap_or_else(|| Value::Array(Vec::new()));
    let allowed = "an array of convex polygons, each an array of [x, y] in metres, counter-clockwise; 32 polygons, 128 corners at most";
    let misfit = |found: String| Complaint::new("plan.obstacles", found, allowed);
    let polygons = obstacles.as_array().ok_or_else(|| misfit(shown(&obstacles)))?;
    for polygon in polygons {
        let corners = polygon
            .as_array()
            .and_then(|corners| corners.iter().map(corner).collect::<Option<Vec<_>>>());
        let corners = corners.ok_or_else(|| misfit(shown(polygon)))?;
        if !plan.push_obstacle(&corners) {
            return Err(misfit(format!(
                "a polygon of {} corners too many or too few",
                corners.len()
            )));
        }
    }
    valid("plan", plan)
}

fn corner(value: &Value) -> Option<[f64; 2]> {
    match &value.as_array()?[..] {
        [x, y] => Some([x.as_f64()?, y.as_f64()?]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    const NOW: Nanos = 5_000_000_000;

    fn ask(line: &str) -> (Value, Result<Request, Complaint>) {
        parse(line.as_bytes(), NOW, &GatewaySettings::default())
    }

    fn understood(value: &Value) -> Request {
        ask(&value.to_string()).1.unwrap_or_else(|complaint| panic!("{value}: {complaint}"))
    }

    fn refused(line: &str) -> Complaint {
        ask(line).1.expect_err(line)
    }

    #[test]
    fn requests_are_understood_and_their_rights_known() {
        let covariance = [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4];
        let cases = [
            (json!({"request": "status"}), Right::Watch),
            (json!({"request": "topics", "id": 1}), Right::Watch),
            (json!({"request": "subscribe", "topic": "odometry", "rate": 10}), Right::Watch),
            (json!({"request": "unsubscribe", "topic": "odometry"}), Right::Watch),
            (
                json!({"request": "fix", "fix": {"x": 1, "y": 2, "yaw": 0.5, "covariance": covariance}}),
                Right::Fix,
            ),
            (
                json!({"request": "inhibit", "inhibit": {"expiry": NOW + 1, "why": "test"}}),
                Right::Inhibit,
            ),
            (json!({"request": "arm"}), Right::Arm),
            (json!({"request": "stop"}), Right::Stop),
        ];
        for (value, right) in cases {
            assert_eq!(understood(&value).right(), right, "{value}");
        }
        let (id, _) = ask(r#"{"id": "a", "request": "nonsense"}"#);
        assert_eq!(id, "a");
    }

    #[test]
    fn a_fix_is_the_topics_own_with_what_is_left_out_filled_in() {
        let covariance = [1e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4];
        let value = json!({"request": "fix", "fix": {
            "header": {"stamp": 7}, "x": 1.5, "y": -2, "yaw": 0.5, "covariance": covariance, "marker_x": 0.25}});
        let Request::Fix(fix) = understood(&value) else { panic!("a fix") };
        assert_eq!(
            (fix.header.stamp, fix.x, fix.marker_x, fix.covariance),
            (7, 1.5, 0.25, covariance)
        );
        let now =
            json!({"request": "fix", "fix": {"x": 1, "y": 2, "yaw": 0, "covariance": covariance}});
        let Request::Fix(fix) = understood(&now) else { panic!("a fix") };
        assert_eq!(fix.header.stamp, NOW);
    }

    #[test]
    fn a_goal_has_its_obstacles_as_polygons() {
        let value = json!({"request": "plan", "plan": {
            "arm": 3, "x": 1, "y": 0.5, "yaw": 0, "clearance": 0.05, "steering": 0.4, "speed": 0.2,
            "bounds": [-2, -2, 4, 4], "gear_changes": 2,
            "obstacles": [[[0, 0], [1, 0], [1, 1]], [[2, 2], [3, 2], [3, 3], [2, 3]]]}});
        let Request::Plan(plan) = understood(&value) else { panic!("a plan") };
        let sizes: Vec<_> = plan.obstacles().map(<[_]>::len).collect();
        assert_eq!((plan.arm, plan.gear, sizes), (3, 0, vec![3, 4]));
    }

    #[test]
    fn what_is_wrong_is_named_with_what_is_allowed() {
        let cases = [
            ("", "line", "EOF", "JSON object"),
            ("[]", "line", "an array of 0", "JSON object"),
            ("\u{0}", "line", "expected value", "JSON object"),
            ("{}", "request", "null", "status, topics"),
            (r#"{"request": "down"}"#, "request", "\"down\"", "arm, stop"),
            (r#"{"request": "arm", "force": true}"#, "line", "\"force\" (true)", "id, request"),
            (r#"{"id": [], "request": "arm"}"#, "id", "an array of 0", "a string or number"),
            (r#"{"request": "subscribe", "topic": "truth"}"#, "topic", "\"truth\"", "raw, travel"),
            (
                r#"{"request": "subscribe", "topic": "heartbeat"}"#,
                "process",
                "nothing",
                "interface, ingest",
            ),
            (
                r#"{"request": "subscribe", "topic": "raw", "process": "ingest"}"#,
                "process",
                "\"ingest\"",
                "nothing",
            ),
            (
                r#"{"request": "subscribe", "topic": "raw", "rate": 51}"#,
                "rate",
                "51",
                "at most gateway.sample_rate = 50",
            ),
            (r#"{"request": "subscribe", "topic": "raw", "rate": 0}"#, "rate", "0", "above 0"),
            (r#"{"request": "fix"}"#, "fix", "null", "an object of Fix"),
            (r#"{"request": "fix", "fix": {"x": 1}}"#, "fix.y", "nothing", "a finite number"),
            (
                r#"{"request": "fix", "fix": {"x": 1, "y": 1, "yaw": 0, "covariance": [-1,0,0,0,1,0,0,0,1]}}"#,
                "fix",
                "covariance",
                "schema",
            ),
            (r#"{"request": "fix", "fix": {"source": "me"}}"#, "fix.x", "nothing", "number"),
            (
                r#"{"request": "inhibit", "inhibit": {"expiry": 1, "why": "x"}}"#,
                "inhibit.expiry",
                "1",
                "gateway.inhibit = 10 s",
            ),
            (
                r#"{"request": "inhibit", "inhibit": {"expiry": 18446744073709551615, "why": "x"}}"#,
                "inhibit.expiry",
                "18446744073709551615",
                "at most",
            ),
            (r#"{"request": "plan", "plan": {"obstacles": 1}}"#, "plan.arm", "nothing", "integer"),
        ];
        for (line, what, found, allowed) in cases {
            let complaint = refused(line);
            assert_eq!(complaint.what, what, "{line}: {complaint}");
            assert!(complaint.found.contains(found), "{line}: {complaint}");
            assert!(complaint.allowed.contains(allowed), "{line}: {complaint}");
        }
    }

    #[test]
    fn a_fix_from_the_future_is_refused() {
        let covariance = [0.0; 9];
        let value = json!({"request": "fix", "fix": {
            "header": {"stamp": NOW + 1}, "x": 0, "y": 0, "yaw": 0, "covariance": covariance}});
        assert_eq!(refused(&value.to_string()).what, "fix.header.stamp");
    }

    #[test]
    fn nesting_and_length_are_bounded() {
        let deep = format!("{}{}", "[".repeat(5000), "]".repeat(5000));
        assert_eq!(refused(&deep).what, "line");
        let long = format!(r#"{{"id": "{}", "request": "arm"}}"#, "a".repeat(100));
        assert_eq!(refused(&long).what, "id");
        let key = format!(r#"{{"request": "{}"}}"#, "b".repeat(10_000));
        assert!(refused(&key).to_string().len() < 300);
    }
}
