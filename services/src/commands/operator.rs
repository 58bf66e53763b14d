//! `arm`, `stop`, `down`: what an operator asks of a running stack; and what all verbs of operators share.

use core::time::Duration;

use kerbside_messages::{
    Mode, Nanos, OperatorAnswer, OperatorRequest, Process, State, Verb, nanos, text,
};
use kerbside_runtime::{Instance, Newest, Session, Ticker, now};
use serde_json::{Value, json};

use super::status::instance_of;
use crate::exit::{Exit, Failure};
use crate::gateway::remote::Remote;

/// Longest wait for the supervisor's answer.
const ANSWER: Duration = Duration::from_secs(1);
/// A state that is older than this means that the supervisor is gone \[s\].
const STATE_AGE: f64 = 1.0;
/// Longest wait for the vehicle to stand, and for a stack to end \[s\].
const END: f64 = 10.0;
/// Time between looks.
const LOOK: Duration = Duration::from_millis(5);

/// Which stack, and how to answer.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct OperatorArgs {
    /// Name of the instance, or the socket of its gateway; the only live one where not given.
    #[arg(long, value_name = "NAME")]
    pub instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl OperatorArgs {
    /// Prints the object of the verb `schema` under --json, else the sentence.
    pub fn tell(&self, schema: &str, name: &str, passed: bool, more: Value, sentence: &str) {
        if !self.json {
            return println!("{name}: {sentence}");
        }
        let mut object = json!({
            "schema": format!("kerbside.{schema}.v1"), "version": env!("CARGO_PKG_VERSION"),
            "seed": null, "passed": passed, "figures": [], "instance": name,
        });
        if let (Some(object), Value::Object(more)) = (object.as_object_mut(), more) {
            object.extend(more);
        }
        println!("{object}");
    }
}

/// An operator's place at a running stack.
#[derive(Debug)]
pub struct Desk {
    /// The stack.
    pub instance: Instance,
    /// Its ports are opened here.
    pub session: Session,
    state: Newest<State>,
    heard: Nanos,
}

impl Desk {
    /// Joins the stack that is meant.
    ///
    /// # Errors
    /// [`Failure`] where there is none, or several.
    pub fn open(args: &OperatorArgs) -> Result<Self, Failure> {
        let instance = instance_of(args.instance.as_deref())?;
        let session = Session::join(&instance, Process::Operator)?;
        let state = Newest::of(session.subscriber::<State>(None, 1)?);
        Ok(Self { instance, session, state, heard: now() })
    }

    /// The newest state; none before the first.
    ///
    /// # Errors
    /// [`Failure`] where the supervisor is silent.
    pub fn state(&mut self) -> Result<Option<State>, Failure> {
        if self.state.update() {
            self.heard = now();
        }
        if now().saturating_sub(self.heard) > nanos(STATE_AGE) {
            return Err(Failure::unavailable(format!(
                "the supervisor of instance {} is silent",
                self.instance.name()
            )));
        }
        Ok(self.state.get().copied())
    }

    /// Asks the supervisor, and waits for its answer.
    ///
    /// # Errors
    /// [`Failure`] where none comes.
    pub fn ask(&self, verb: Verb) -> Result<OperatorAnswer, Failure> {
        let client = self.session.client::<OperatorRequest, OperatorAnswer>()?;
        let request = OperatorRequest {
            id: now(),
            pid: std::process::id(),
            verb: verb.code(),
            ..OperatorRequest::default()
        };
        client.ask(request, ANSWER)?.ok_or_else(|| {
            Failure::unavailable(format!("the supervisor did not answer {verb} within 1 s"))
        })
    }

    /// Stops the vehicle and waits until it stands; the state it led to.
    ///
    /// # Errors
    /// [`Failure`] where the supervisor is silent, or the vehicle does not come to rest.
    pub fn stop(&mut self) -> Result<(OperatorAnswer, State), Failure> {
        let answer = self.ask(Verb::Stop)?;
        let asked = now();
        let mut look = Ticker::new(LOOK);
        loop {
            // A state from before the request may still say what was.
            if let Some(state) = self.state()?.filter(|state| state.header.stamp >= asked)
                && state.mode() != Mode::Stopping
            {
                return Ok((answer, state));
            }
            if now().saturating_sub(asked) > nanos(END) {
                return Err(Failure::new(Exit::Bad, "the vehicle does not come to rest"));
            }
            look.wait();
        }
    }

    fn wait_for_end(&self) -> Result<(), Failure> {
        let mut look = Ticker::new(LOOK);
        let deadline = now() + nanos(END);
        while let Some(pid) = self.instance.supervisor() {
            if now() > deadline {
                return Err(Failure::unavailable(format!("supervisor {pid} does not end")));
            }
            look.wait();
        }
        Ok(())
    }
}

/// Asks the supervisor for `verb`, and waits until it is done.
///
/// # Errors
/// [`Failure`] where there is no stack or it does not answer.
pub fn ask(args: &OperatorArgs, verb: Verb) -> Result<Exit, Failure> {
    if let Some(mut remote) = Remote::find(args.instance.as_deref())? {
        return remote_ask(args, &mut remote, verb);
    }
    let mut desk = Desk::open(args)?;
    let (answer, mode) = if verb == Verb::Stop {
        let (answer, state) = desk.stop()?;
        (answer, state.mode())
    } else {
        let answer = desk.ask(verb)?;
        (answer, Mode::from_code(answer.mode).unwrap_or(Mode::Faulted))
    };
    let accepted = answer.accepted == 1;
    if verb == Verb::Down && accepted {
        desk.wait_for_end()?;
    }
    Ok(tell(args, &desk, &answer, mode))
}

/// Tells what the supervisor answered.
pub fn tell(args: &OperatorArgs, desk: &Desk, answer: &OperatorAnswer, mode: Mode) -> Exit {
    let (accepted, words) = (answer.accepted == 1, text::as_str(&answer.text));
    tell_words(args, desk.instance.name(), accepted, mode.name(), answer.arms, words)
}

fn tell_words(
    args: &OperatorArgs,
    instance: &str,
    accepted: bool,
    mode: &str,
    arms: u64,
    words: &str,
) -> Exit {
    let more = json!({ "mode": mode, "arms": arms, "text": words });
    let sentence = if accepted { mode.to_owned() } else { format!("refused: {words}") };
    args.tell("operator", instance, accepted, more, &sentence);
    if accepted { Exit::Good } else { Exit::Bad }
}

/// The same through the gateway of another user's instance.
fn remote_ask(args: &OperatorArgs, remote: &mut Remote, verb: Verb) -> Result<Exit, Failure> {
    if verb == Verb::Down {
        return Err(Failure::with_help(
            Exit::Unavailable,
            format!("instance {} is another user's", remote.instance()),
            "only its own user may end it; kerbside stop stops the vehicle",
        ));
    }
    let reply = remote.ask(&json!({ "request": verb.name() }), 2 * ANSWER)?;
    let words = reply["error"]["found"].as_str().unwrap_or_default();
    let Some(mode) = reply["mode"].as_str() else { return Err(remote.refused(&reply)) };
    let accepted = reply["ok"] == true;
    let mut mode = mode.to_owned();
    if verb == Verb::Stop && accepted {
        mode = remote.until_stopped(END)?.name().to_owned();
    }
    let arms = reply["arms"].as_u64().unwrap_or_default();
    Ok(tell_words(args, remote.instance(), accepted, &mode, arms, words))
}
