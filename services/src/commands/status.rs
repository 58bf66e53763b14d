//! `status`: each process and the mode.

use core::time::Duration;

use comfy_table::Table;
use kerbside_messages::{Mode, Process, ProcessRow, ProcessState, State, text};
use kerbside_runtime::{Instance, Newest, Session, Ticker, now};
use serde_json::{Value, json};

use crate::exit::{Exit, Failure};
use crate::gateway::remote::Remote;
use crate::manoeuvre::cause_of;

/// Longest wait for a state: the supervisor publishes it every few milliseconds.
const PATIENCE: u64 = 1_000_000_000;

/// What `status` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct StatusArgs {
    /// Name of the instance, or the socket of its gateway; the only live one where not given.
    #[arg(long, value_name = "NAME")]
    instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The instance that is meant: the named one, or the only live one.
///
/// # Errors
/// [`Failure`] where none or several are meant.
pub fn instance_of(name: Option<&str>) -> Result<Instance, Failure> {
    let live = Instance::live();
    if let Some(name) = name {
        let instance = Instance::named(name)?;
        if instance.supervisor().is_none() {
            let known: Vec<_> = live.iter().map(|(instance, _)| instance.name()).collect();
            let help = if known.is_empty() {
                "none is".to_owned()
            } else {
                format!("these are: {}", known.join(", "))
            };
            return Err(Failure::with_help(
                Exit::Unavailable,
                format!("instance {name} is not running"),
                help,
            ));
        }
        return Ok(instance);
    }
    match &live[..] {
        [] => Err(Failure::with_help(
            Exit::Unavailable,
            "no instance is running",
            "kerbside up starts one",
        )),
        [(instance, _)] => Ok(instance.clone()),
        several => {
            let names: Vec<_> = several
                .iter()
                .map(|(instance, pid)| format!("{} (process {pid})", instance.name()))
                .collect();
            let help = format!("name one with --instance: {}", names.join(", "));
            Err(Failure::with_help(Exit::Unavailable, "several instances are running", help))
        }
    }
}

/// Runs the verb: exit code 0 unless the stack is faulted or silent.
///
/// # Errors
/// [`Failure`] where there is no instance.
pub fn run(args: &StatusArgs) -> Result<Exit, Failure> {
    if let Some(mut remote) = Remote::find(args.instance.as_deref())? {
        let state = remote.state()?;
        return Ok(tell(args, remote.instance(), &state));
    }
    let instance = instance_of(args.instance.as_deref())?;
    let session = Session::join(&instance, Process::Operator)?;
    let mut state = Newest::of(session.subscriber::<State>(None, 1)?);
    let mut look = Ticker::new(Duration::from_millis(5));
    let deadline = now() + PATIENCE;
    while !state.update() {
        if now() > deadline {
            let words = format!("the supervisor of instance {} is silent", instance.name());
            return Err(Failure::unavailable(words));
        }
        look.wait();
    }
    let Some(state) = state.get() else { return Err(Failure::internal("a state without content")) };
    Ok(tell(args, instance.name(), state))
}

fn tell(args: &StatusArgs, instance: &str, state: &State) -> Exit {
    if args.json {
        println!("{}", object(instance, state));
    } else {
        print_table(instance, state);
    }
    if state.mode() == Mode::Faulted { Exit::Bad } else { Exit::Good }
}

/// A state as `status --json` prints it.
pub(crate) fn object(instance: &str, state: &State) -> Value {
    let row = |row: &ProcessRow| {
        json!({
            "name": name_of(row), "pid": row.pid, "state": state_of(row), "restarts": row.restarts,
            "misses": row.misses, "age_ms": row.age_ms, "waiting_for": text::as_str(&row.waiting_for),
        })
    };
    json!({
        "schema": "kerbside.status.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": null,
        "passed": state.mode() != Mode::Faulted,
        "figures": [],
        "instance": instance,
        "mode": state.mode().name(),
        "cause": cause_of(state),
        "processes": state.rows().iter().map(row).collect::<Vec<_>>(),
    })
}

fn print_table(instance: &str, state: &State) {
    println!("instance {instance}, supervised by process {}", state.pid);
    match cause_of(state).as_str() {
        "" => println!("mode {}", state.mode()),
        cause => println!("mode {}: {cause}", state.mode()),
    }
    println!("{}", table(state, crate::output::terminal_width()));
}

/// A row per process, within `width` columns where that is known.
fn table(state: &State, width: Option<u16>) -> Table {
    let mut table = crate::tables::framed_within(width);
    table.set_header(["process", "pid", "state", "restarts", "misses", "age ms", "says"]);
    for row in state.rows() {
        table.add_row([
            name_of(row).to_owned(),
            row.pid.to_string(),
            state_of(row).to_owned(),
            row.restarts.to_string(),
            row.misses.to_string(),
            row.age_ms.to_string(),
            says(row),
        ]);
    }
    table
}

/// What a process says of itself, or what is to be said of it.
fn says(row: &ProcessRow) -> String {
    let words = text::as_str(&row.waiting_for);
    match ProcessState::from_code(row.state) {
        Some(ProcessState::Starting) if !words.is_empty() => format!("waits for {words}"),
        Some(ProcessState::External) if row.pid == 0 => "is started elsewhere".to_owned(),
        _ => words.to_owned(),
    }
}

fn name_of(row: &ProcessRow) -> &'static str {
    Process::from_id(row.process).map_or("unknown", Process::name)
}

fn state_of(row: &ProcessRow) -> &'static str {
    ProcessState::from_code(row.state).map_or("unknown", ProcessState::name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_fits_a_terminal_and_breaks_what_a_process_says_between_words() {
        let mut state = State { rows: 2, ..State::default() };
        for (row, words) in state
            .processes
            .iter_mut()
            .zip(["the configured device, which does not answer for some time now", ""])
        {
            *row = ProcessRow {
                pid: 4_194_304,
                state: ProcessState::Starting.code(),
                restarts: 12,
                misses: 100_000,
                waiting_for: text::from_str(words),
                ..ProcessRow::default()
            };
        }
        let narrow = table(&state, Some(80)).to_string();
        assert!(narrow.lines().all(|line| line.chars().count() <= 80), "{narrow}");
        assert!(narrow.contains("4194304") && narrow.contains("configured"), "{narrow}");
        let wide = table(&state, None).to_string();
        assert!(wide.contains("waits for the configured device, which does not answer"), "{wide}");
    }
}
