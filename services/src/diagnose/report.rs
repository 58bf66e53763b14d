//! The report of a diagnosis: from what was found to what is drawn.

use kerbside_reports::{DiagnoseReport, Provenance};

use super::Diagnosed;
use super::document::{NEXT, OVERLAY, VEHICLE};

/// The report of `diagnosed`.
pub fn of(diagnosed: &Diagnosed, command_line: &str) -> DiagnoseReport {
    let (input, found) = (&diagnosed.input, &diagnosed.found);
    let file = |there: bool, name: &str| if there { name.to_owned() } else { String::new() };
    DiagnoseReport {
        diagnosis: found.clone(),
        vehicle: input.case.vehicle.name.clone(),
        runs: input.case.runs.iter().map(|run| run.name.clone()).collect(),
        overlay: file(!found.effects.is_empty(), OVERLAY),
        next_file: file(found.next.as_ref().is_some_and(|next| !next.commands.is_empty()), NEXT),
        notes: input
            .notices
            .iter()
            .cloned()
            .chain(diagnosed.absorbed().in_words(VEHICLE))
            .collect(),
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command_line: command_line.to_owned(),
            configuration: vec![input.origin.clone()],
            machine: crate::machine::facts(),
            ..Provenance::default()
        },
    }
}
