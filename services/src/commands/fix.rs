//! `fix`: tells the estimator where the standing vehicle is.

use core::time::Duration;

use kerbside_geometry::angle;
use kerbside_messages::{Fix, FixVerdict, Header, Message, Nanos, Odometry, nanos, text};
use kerbside_runtime::{Newest, Ticker, now};
use serde_json::json;

use super::operator::{Desk, OperatorArgs};
use crate::exit::{Exit, Failure};
use crate::gateway::remote::Remote;

/// A fix can be read for so long at least: some rounds of the slowest reader.
const LINGER: Duration = Duration::from_millis(100);
/// Longest wait for an estimate \[s\].
const PATIENCE: f64 = 1.0;

/// A pose for the estimator.
#[derive(Clone, Debug, clap::Args)]
pub struct FixArgs {
    #[command(flatten)]
    operator: OperatorArgs,
    /// Position along x [m].
    #[arg(allow_negative_numbers = true)]
    x: f64,
    /// Position along y [m].
    #[arg(allow_negative_numbers = true)]
    y: f64,
    /// Heading [degrees].
    #[arg(allow_negative_numbers = true)]
    yaw: f64,
    /// Standard deviation of each coordinate [m].
    #[arg(long, value_name = "METRES", default_value_t = 0.002, value_parser = deviation)]
    position_noise: f64,
    /// Standard deviation of the heading [degrees].
    #[arg(long, value_name = "DEGREES", default_value_t = 0.1, value_parser = deviation)]
    yaw_noise: f64,
}

fn deviation(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|number| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "a number above 0 is allowed".to_owned())
}

/// Publishes the fix and tells what became of it.
///
/// # Errors
/// [`Failure`] where there is no stack, or no estimate comes.
pub fn run(args: &FixArgs) -> Result<Exit, Failure> {
    let content = content(args)?;
    if let Some(mut remote) = Remote::find(args.operator.instance.as_deref())? {
        return remote_fix(args, &mut remote, &content);
    }
    let desk = Desk::open(&args.operator)?;
    let mut odometry = Newest::of(desk.session.subscriber::<Odometry>(None, 1)?);
    let mut publisher = desk.session.publisher::<Fix>(None)?;
    let none = "no estimate comes: is the vehicle's line up? kerbside status tells";
    wait_for(&mut odometry, |_| true, none)?;
    // A vehicle that came to rest a moment ago is known to stand a moment later; one that drives is refused below.
    let before = match wait_for(&mut odometry, |odometry| odometry.standstill == 1, "") {
        Ok(standing) => standing,
        Err(_) => wait_for(&mut odometry, |_| true, none)?,
    };
    publisher.send(|fix| {
        *fix = Fix { header: Header::stamped(now(), 0), ..content };
        true
    })?;
    let judged = |odometry: &Odometry| {
        odometry.resets != before.resets || odometry.fix_sequence != before.fix_sequence
    };
    // The sample lives as long as its publisher: the recorder, which polls, has to find it too.
    let mut lingering = Ticker::new(LINGER);
    let after = wait_for(&mut odometry, judged, "the estimator did not take up the fix")?;
    lingering.wait();
    let verdict = FixVerdict::from_code(after.fix_verdict).unwrap_or(FixVerdict::None);
    let accepted = matches!(verdict, FixVerdict::Accepted | FixVerdict::Widened);
    let more = json!({ "verdict": verdict.name() });
    args.operator.tell("fix", desk.instance.name(), accepted, more, &format!("fix {verdict}"));
    Ok(if accepted { Exit::Good } else { Exit::Bad })
}

/// The same through the gateway of another user's instance.
fn remote_fix(args: &FixArgs, remote: &mut Remote, fix: &Fix) -> Result<Exit, Failure> {
    let request = json!({ "request": "fix", "fix": {
        "x": fix.x, "y": fix.y, "yaw": fix.yaw, "covariance": fix.covariance,
    }});
    let reply = remote.ask(&request, Duration::from_secs(2))?;
    let Some(verdict) = reply["verdict"].as_str() else { return Err(remote.refused(&reply)) };
    let (accepted, more) = (reply["ok"] == true, json!({ "verdict": verdict }));
    args.operator.tell("fix", remote.instance(), accepted, more, &format!("fix {verdict}"));
    Ok(if accepted { Exit::Good } else { Exit::Bad })
}

fn content(args: &FixArgs) -> Result<Fix, Failure> {
    let (position, yaw) = (args.position_noise.powi(2), angle::radians(args.yaw_noise).powi(2));
    let fix = Fix {
        header: Header::default(),
        x: args.x,
        y: args.y,
        yaw: angle::radians(args.yaw),
        covariance: [position, 0.0, 0.0, 0.0, position, 0.0, 0.0, 0.0, yaw],
        source: text::from_str("operator"),
        ..Fix::default()
    };
    // A sample that its receivers refuse would be lost without a word.
    let words = |refusal| Failure::new(Exit::Usage, format!("no pose for a vehicle: {refusal}"));
    fix.validate().map(|()| fix).map_err(words)
}

fn wait_for(
    odometry: &mut Newest<Odometry>,
    wanted: impl Fn(&Odometry) -> bool,
    otherwise: &str,
) -> Result<Odometry, Failure> {
    let mut look = Ticker::new(Duration::from_millis(2));
    let deadline: Nanos = now() + nanos(PATIENCE);
    loop {
        if odometry.update()
            && let Some(newest) = odometry.get()
            && wanted(newest)
        {
            return Ok(*newest);
        }
        if now() > deadline {
            return Err(Failure::unavailable(otherwise));
        }
        look.wait();
    }
}
