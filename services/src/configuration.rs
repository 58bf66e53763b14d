//! Loading configuration, and showing what is wrong with it where it stands.

use std::path::Path;

use kerbside_recordings::run_folder::RunError;
use kerbside_settings::{Parking, Problem, SettingsError, Severity, Sources, Stack};
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};

use crate::exit::{Exit, Failure};

/// The places to look in, `config` (a folder or a stack's file) first.
///
/// # Errors
/// [`Failure`] where `config` is not there.
pub fn sources(config: Option<&Path>) -> Result<Sources, Failure> {
    Sources::new(config).map_err(Failure::from)
}

/// The stack, with `vehicle` in place of its own where one is named.
///
/// # Errors
/// [`Failure`] where the configuration is refused.
pub fn stack(config: Option<&Path>, vehicle: Option<&str>) -> Result<Stack, Failure> {
    let loaded = sources(config)?.stack_for(vehicle)?;
    warn(&loaded.warnings);
    Ok(loaded.value)
}

/// A scenario with the stack that suits it.
///
/// # Errors
/// [`Failure`] where the configuration is refused.
pub fn parking(
    config: Option<&Path>,
    scenario: &str,
    vehicle: Option<&str>,
) -> Result<Parking, Failure> {
    let parking = sources(config)?.parking(scenario, vehicle)?;
    warn(&parking.scenario.warnings);
    // Both are checked with the vehicle, and say the same of it.
    let news = |warning: &&Problem| !parking.scenario.warnings.contains(warning);
    let of_stack: Vec<_> = parking.stack.warnings.iter().filter(news).cloned().collect();
    warn(&of_stack);
    Ok(parking)
}

/// Says what is suspicious but not refused.
pub fn warn(warnings: &[Problem]) {
    for warning in warnings {
        tracing::warn!("{warning}");
    }
}

impl From<SettingsError> for Failure {
    fn from(error: SettingsError) -> Self {
        let exit = match error {
            SettingsError::UnknownKey { .. } => Exit::Usage,
            _ => Exit::Configuration,
        };
        if error.problems().is_empty() {
            return Self::new(exit, error);
        }
        Self { exit, report: miette::Report::new(Refused::new(error.problems())) }
    }
}

/// A run folder that is not as the format says: where a file of it has problems, every one.
#[must_use]
pub fn refused_run(error: RunError) -> Failure {
    match error {
        RunError::About(error) if !error.problems().is_empty() => {
            let report = miette::Report::new(Refused::new(error.problems()));
            Failure { exit: Exit::Data, report }
        }
        error => Failure::new(Exit::Data, error),
    }
}

/// A refused configuration: every problem with its place.
#[derive(Debug, thiserror::Error)]
#[error("configuration refused: {} {}", problems.len(), if problems.len() == 1 { "problem" } else { "problems" })]
pub struct Refused {
    problems: Vec<Located>,
}

impl Refused {
    /// All of `problems`.
    #[must_use]
    pub fn new(problems: &[Problem]) -> Self {
        Self { problems: problems.iter().cloned().map(Located::new).collect() }
    }
}

impl Refused {
    /// Each problem in one line.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        self.problems.iter().map(ToString::to_string)
    }

    /// Each problem with the text it stands in.
    pub fn reports(&self) -> impl Iterator<Item = miette::Report> {
        self.problems.iter().cloned().map(miette::Report::new)
    }
}

impl Diagnostic for Refused {}

/// A problem with the text it stands in.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{}:{}: {}", problem.file, problem.line, problem.message())]
struct Located {
    problem: Problem,
    source_text: NamedSource<String>,
}

impl Located {
    fn new(problem: Problem) -> Self {
        let source_text = NamedSource::new(&problem.file, problem.source.to_string());
        Self { problem, source_text }
    }
}

impl Diagnostic for Located {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.problem.severity {
            Severity::Warning => miette::Severity::Warning,
            Severity::Error => miette::Severity::Error,
        })
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.source_text)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let label = Some(self.problem.cause.to_string());
        let span = LabeledSpan::new_with_span(label, self.problem.span.clone());
        Some(Box::new(core::iter::once(span)))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn core::fmt::Display + 'a>> {
        self.problem.help.as_ref().map(|help| Box::new(help) as Box<dyn core::fmt::Display>)
    }
}
