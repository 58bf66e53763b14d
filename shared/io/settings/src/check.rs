//! Checking everything that can be found.

use crate::sources::{FileKind, Sources};
use crate::{Cause, Problem, SettingsError, Severity};

/// Every problem of every stack, vehicle and scenario that `sources` finds; warnings included.
///
/// Each scenario is also checked together with the stack and the vehicle it names. A problem is
/// listed once, however many files lead to it.
#[must_use]
pub fn check(sources: &Sources) -> Vec<Problem> {
    let mut problems: Vec<Problem> = Vec::new();
    let given = sources.given_stack().map(|_| sources.stack().map(|stack| stack.warnings));
    let found = FileKind::ALL.into_iter().flat_map(|kind| {
        sources.names(kind).into_iter().map(move |name| load(sources, kind, &name))
    });
    for result in given.into_iter().chain(found) {
        let more = result.unwrap_or_else(into_problems);
        let new: Vec<_> = more.into_iter().filter(|problem| !problems.contains(problem)).collect();
        problems.extend(new);
    }
    problems
}

fn load(sources: &Sources, kind: FileKind, name: &str) -> Result<Vec<Problem>, SettingsError> {
    match kind {
        FileKind::Stack => sources.stack_named(name).map(|stack| stack.warnings),
        FileKind::Vehicle => sources.vehicle(name).map(|vehicle| vehicle.warnings),
        FileKind::Scenario => sources
            .parking_as_stated(name)
            .map(|parking| [parking.scenario.warnings, parking.stack.warnings].concat()),
    }
}

fn into_problems(error: SettingsError) -> Vec<Problem> {
    let (file, reason) = match error {
        SettingsError::Refused(problems) => return problems,
        SettingsError::Unreadable { path, reason } => (path.display().to_string(), reason),
        other => (String::new(), other.to_string()),
    };
    vec![Problem {
        severity: Severity::Error,
        file,
        source: "".into(),
        span: 0..0,
        line: 1,
        column: 1,
        key: String::new(),
        value: None,
        cause: Cause::Unreadable(reason),
        allowed: String::new(),
        help: None,
    }]
}
