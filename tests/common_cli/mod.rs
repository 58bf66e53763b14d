//! What the tests of the command line share: running a verb, and reading what it says as a person would.

// A test that cannot go on panics: that is how it says so. No test binary uses everything.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use crate::common::stack::{poll, send};
use crate::common::{PATIENCE, Sandbox, Signal};

/// How a verb ended, and what it said.
#[derive(Clone, Debug)]
pub(crate) struct Said {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Said {
    /// The one object on standard output.
    pub(crate) fn json(&self) -> Value {
        let lines: Vec<_> = self.stdout.lines().collect();
        let [line] = lines[..] else { panic!("one object is expected: {self:?}") };
        let object: Value = serde_json::from_str(line).unwrap_or_else(|_| panic!("{self:?}"));
        for key in ["schema", "version", "seed", "passed", "figures"] {
            assert!(object.get(key).is_some(), "{key} is missing: {object}");
        }
        object
    }

    /// Holds the exit code, and the words on standard error, against what is expected; line breaks do not count.
    pub(crate) fn refuses(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:?}");
        let flat = flat(&self.stderr);
        for word in words {
            assert!(flat.contains(&word.replace(' ', "")), "{word:?} is missing:\n{}", self.stderr);
        }
        reads_like_prose(&self.stderr);
    }
}

/// Holds the keys of what `verb` printed, those of its parts included, against docs/json.md.
pub(crate) fn is_documented(verb: &str, object: &Value) {
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/json.md")).unwrap();
    let begin = format!("| `{verb}` |");
    let row = page.lines().find(|line| line.starts_with(&begin));
    let row = row.unwrap_or_else(|| panic!("docs/json.md has no {verb}"));
    let mut keys = Vec::new();
    collect_keys(object, &mut keys);
    let common = ["schema", "version", "seed", "passed", "figures"];
    for key in keys.iter().filter(|key| !common.contains(&key.as_str())) {
        assert!(row.contains(&format!("`{key}`")), "docs/json.md has no {key} of {verb}");
    }
}

fn collect_keys(value: &Value, keys: &mut Vec<String>) {
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| {
            keys.push(key.clone());
            collect_keys(value, keys);
        }),
        Value::Array(all) => all.iter().for_each(|value| collect_keys(value, keys)),
        _ => {}
    }
}

/// Without white space and the frame that diagnostics are drawn in: where a line breaks says nothing.
fn flat(text: &str) -> String {
    text.chars()
        .filter(|letter| !letter.is_whitespace() && !"│╭╰─×·┬├▲┌└".contains(*letter))
        .collect()
}

/// Nothing that only a programmer of kerbside understands.
pub(crate) fn reads_like_prose(text: &str) {
    for noise in
        ["panicked", "unwrap", "Err(", "Ok(", "Some(", "None", "Error {", "Os {", "\u{1b}", "::"]
    {
        assert!(!text.contains(noise), "{noise:?} in:\n{text}");
    }
}

/// Runs a verb to its end.
pub(crate) fn run(sandbox: &Sandbox, arguments: &[&str]) -> Said {
    let mut command = sandbox.kerbside();
    command.args(arguments);
    finish(command)
}

/// Runs a command to its end.
pub(crate) fn finish(mut command: Command) -> Said {
    let output = command.stdin(Stdio::null()).output().unwrap();
    Said {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// A file of the sandbox with this content.
pub(crate) fn file(sandbox: &Sandbox, name: &str, content: &str) -> PathBuf {
    let path = sandbox.file(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, content).unwrap();
    path
}

/// A process that a test started; killed when dropped.
#[derive(Debug)]
pub(crate) struct Running {
    child: Child,
    stdout: PathBuf,
    stderr: PathBuf,
}

impl Running {
    /// Starts a verb whose words go to files called `name`.
    pub(crate) fn start(sandbox: &Sandbox, name: &str, arguments: &[&str]) -> Self {
        let mut command = sandbox.kerbside();
        command.args(arguments);
        Self::spawn(sandbox, name, command)
    }

    /// The same with any command.
    pub(crate) fn spawn(sandbox: &Sandbox, name: &str, mut command: Command) -> Self {
        let stdout = sandbox.file(&format!("{name}.out"));
        let stderr = sandbox.file(&format!("{name}.err"));
        command.stdin(Stdio::null());
        command.stdout(File::create(&stdout).unwrap()).stderr(File::create(&stderr).unwrap());
        Self { child: command.spawn().unwrap(), stdout, stderr }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        send(self.child.id(), signal);
    }

    /// What it has logged so far.
    pub(crate) fn log(&self) -> String {
        fs::read_to_string(&self.stderr).unwrap()
    }

    /// Waits until it has logged these words.
    pub(crate) fn until_says(&self, words: &str) {
        let found = poll(PATIENCE, || self.log().contains(words).then_some(()));
        assert!(found.is_some(), "{words:?} is not said:\n{}", self.log());
    }

    /// Waits for its end.
    pub(crate) fn end(mut self) -> Said {
        let ended = poll(PATIENCE, || self.child.try_wait().unwrap());
        let Some(status) = ended else { panic!("it does not end:\n{}", self.log()) };
        let stdout = fs::read_to_string(&self.stdout).unwrap();
        Said { code: status.code(), stdout, stderr: self.log() }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// What `status --json` says of the sandbox's instance, once it says anything.
pub(crate) fn status(sandbox: &Sandbox) -> Option<Value> {
    let instance = sandbox.instance();
    let said = run(sandbox, &["status", "--json", "--instance", instance.name()]);
    matches!(said.code, Some(0 | 1)).then(|| said.json())
}

/// Waits until the status shows something.
pub(crate) fn until<T>(sandbox: &Sandbox, what: &str, found: impl Fn(&Value) -> Option<T>) -> T {
    let mut newest = None;
    let result = poll(PATIENCE, || {
        newest = status(sandbox);
        found(newest.as_ref()?)
    });
    result.unwrap_or_else(|| panic!("{what} does not come: {newest:?}"))
}

/// Waits for a mode.
pub(crate) fn until_mode(sandbox: &Sandbox, mode: &str) {
    until(sandbox, mode, |status| (status["mode"] == mode).then_some(()));
}

/// The row of a process.
pub(crate) fn row<'a>(status: &'a Value, process: &str) -> &'a Value {
    status["processes"].as_array().unwrap().iter().find(|row| row["name"] == process).unwrap()
}

/// A scenario of a few seconds: half a metre along the aisle.
pub(crate) const SHORT: &str = r#"
vehicle = "paper-1-6"

[slot]
x = [-0.26, 0.26]
depth = 0.95
aisle_x = [-2.0, 2.5]
aisle_width = 1.3

[start]
x = -1.0
y = 0.65
yaw_degrees = 0.0

[goal]
x = -0.5
y = 0.65
yaw_degrees = 0.0
gear = "forward"

[plan]
clearance = 0.05
steering_degrees = 28.0
speed = 0.2
gear_changes = 0

[tolerance]
position = 0.03
yaw_degrees = 1.5

[disturbance]
position = 0.001
yaw_degrees = 0.1
known_position = 0.001
known_yaw_degrees = 0.05
"#;
