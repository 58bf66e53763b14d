//! The folder of a diagnosis: what is written, and in which order.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::document::{self, DIAGNOSIS, NEXT, OVERLAY, REPORT, VEHICLE};
use super::{Diagnosed, absorbed, report};
use crate::exit::{Exit, Failure};
use crate::output;

/// Writes a diagnosis into `folder`. diagnosis.json is taken away first and comes last, in one piece: where it is,
/// everything is.
///
/// # Errors
/// [`Failure`] where the folder cannot be written to.
pub fn write(folder: &Path, diagnosed: &Diagnosed, command_line: &str) -> Result<Value, Failure> {
    output::make(folder)?;
    clear(folder)?;
    let found = &diagnosed.found;
    if !found.effects.is_empty() {
        output::write(&folder.join(OVERLAY), &document::overlay(found))?;
    }
    let absorbed = diagnosed.absorbed();
    if !absorbed.lines.is_empty() {
        output::write(&folder.join(VEHICLE), &absorbed::text(diagnosed, &absorbed)?)?;
    }
    if let Some(next) = found.next.as_ref().filter(|next| !next.commands.is_empty()) {
        output::write(&folder.join(NEXT), &document::commands(next))?;
    }
    let page = report::of(diagnosed, command_line).render().map_err(Failure::internal)?;
    output::write(&folder.join(REPORT), &page)?;
    let document = diagnosed.document();
    let text = serde_json::to_string_pretty(&document).map_err(Failure::internal)?;
    whole(&folder.join(DIAGNOSIS), format!("{text}\n").as_bytes())?;
    Ok(document)
}

/// Takes away what an earlier diagnosis left.
///
/// # Errors
/// [`Failure`] naming what cannot be taken away.
pub fn clear(folder: &Path) -> Result<(), Failure> {
    for name in [DIAGNOSIS, OVERLAY, VEHICLE, NEXT, REPORT] {
        match fs::remove_file(folder.join(name)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(refused(&folder.join(name), &error));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Writes a file that is there as a whole or not at all.
///
/// # Errors
/// [`Failure`] naming the file.
pub fn whole(path: &Path, content: &[u8]) -> Result<(), Failure> {
    let beside = path.with_extension("part");
    fs::write(&beside, content)
        .and_then(|()| fs::rename(&beside, path))
        .map_err(|error| refused(path, &error))
}

fn refused(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(Exit::Unavailable, format!("cannot write to {}: {error}", path.display()))
}

/// The diagnosis that `folder` holds, if this version made it with the same overlay.
pub fn kept(folder: &Path, model: Option<&str>) -> Option<Value> {
    let text = fs::read_to_string(folder.join(DIAGNOSIS)).ok()?;
    let document: Value = serde_json::from_str(&text).ok()?;
    let same =
        document["version"] == env!("CARGO_PKG_VERSION") && document["model"].as_str() == model;
    same.then_some(document)
}
