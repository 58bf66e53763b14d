//! Overlays: the effects that are to be added to a nominal vehicle.
//!
//! ```toml
//! [[effect]]
//! id = "understeer"
//! gradient = 1.6
//!
//! [[effect]]
//! id = "count_loss"
//! wheel = "rl"
//! fraction = 0.08
//! ```
//!
//! What effects and parameters there are, and what they may be, the simulation's library says. Its
//! `Display` writes the text.

use core::ops::Range;
use std::path::Path;
use std::sync::Arc;

use kerbside_geometry::{WHEELS, Wheel};
use kerbside_simulation::effects::{OverlayError, definition, library};
use kerbside_simulation::{Effect, Overlay};
use toml::de::{DeTable, DeValue};

use crate::declare::{SourceFile, number};
use crate::problem::{Cause, Problem, SettingsError, Severity};
use crate::{nearest, sources};

/// The overlay of a file.
///
/// # Errors
/// [`SettingsError`]: not readable, or refused with every problem.
pub fn load_overlay(path: &Path) -> Result<Overlay, SettingsError> {
    read(sources::read(path)?)
}

/// The overlay of a text that is a file's of that name.
///
/// # Errors
/// [`SettingsError::Refused`] with every problem.
pub fn parse_overlay(name: &str, text: &str) -> Result<Overlay, SettingsError> {
    read(SourceFile { name: name.to_owned(), text: text.into(), folder: None })
}

fn read(file: SourceFile) -> Result<Overlay, SettingsError> {
    let text = Arc::clone(&file.text);
    let mut reader = Reader { file, overlay: Overlay::new(), problems: Vec::new() };
    let (document, errors) = DeTable::parse_recoverable(&text);
    for error in &errors {
        let end = text.len();
        let cause = Cause::Syntax(error.message().to_owned());
        reader.report(String::new(), error.span().unwrap_or(end..end), None, cause, "");
    }
    // Where the text is no TOML, what else is wrong may only follow from that.
    if errors.is_empty() {
        reader.file(document.get_ref());
    }
    if reader.problems.is_empty() {
        Ok(reader.overlay)
    } else {
        reader.problems.sort_by_key(|problem| problem.span.start);
        Err(SettingsError::Refused(reader.problems))
    }
}

struct Reader {
    file: SourceFile,
    overlay: Overlay,
    problems: Vec<Problem>,
}

/// One `[[effect]]` of the text.
struct Block<'a> {
    table: &'a DeTable<'a>,
    /// `effect[0]`, for messages.
    place: String,
    span: Range<usize>,
}

impl Block<'_> {
    /// Where a key's value stands; the block itself where the key is missing.
    fn span(&self, key: &str) -> Range<usize> {
        self.table.get(key).map_or(self.span.clone(), |value| value.span())
    }
}

impl Reader {
    fn file(&mut self, root: &DeTable<'_>) {
        for (name, value) in root {
            let key = name.get_ref().to_string();
            match value.get_ref() {
                DeValue::Array(blocks) if key == "effect" => {
                    for (index, block) in blocks.iter().enumerate() {
                        let place = format!("effect[{index}]");
                        match block.get_ref() {
                            DeValue::Table(table) => {
                                self.block(&Block { table, place, span: block.span() });
                            }
                            other => self.wrong_type(place, block.span(), other, "a table"),
                        }
                    }
                }
                other if key == "effect" => {
                    self.wrong_type(key, value.span(), other, "tables [[effect]]");
                }
                _ => self.report(key, name.span(), None, Cause::UnknownKey, "[[effect]]"),
            }
        }
    }

    fn block(&mut self, block: &Block<'_>) {
        let before = self.problems.len();
        let id = self.text(block, "id");
        let wheel = self.text(block, "wheel").and_then(|name| self.wheel(block, &name));
        let mut values = Vec::new();
        for (name, value) in block.table {
            let name = name.get_ref().as_ref();
            if ["id", "wheel"].contains(&name) {
                continue;
            }
            match number(value.get_ref()) {
                Some(number) => values.push((name, number)),
                None => {
                    let place = format!("{}.{name}", block.place);
                    self.wrong_type(place, value.span(), value.get_ref(), "a number");
                }
            }
        }
        match id {
            // What is of the wrong type would be reported again as missing.
            Some(id) if self.problems.len() == before => self.add(block, &id, wheel, values),
            Some(_) => {}
            None if self.problems.len() == before => {
                let (place, span) = (format!("{}.id", block.place), block.span.clone());
                self.report(place, span, None, Cause::Missing, &ids());
            }
            None => {}
        }
    }

    /// Adds the effect; what is wrong with it is mended after it was reported, so that the rest is
    /// looked at as well.
    fn add(
        &mut self,
        block: &Block<'_>,
        id: &str,
        mut wheel: Option<Wheel>,
        mut values: Vec<(&str, f64)>,
    ) {
        loop {
            let error = match Effect::new(id, wheel, &values) {
                Ok(effect) => match self.overlay.add(effect) {
                    Ok(()) => return,
                    Err(error) => error,
                },
                Err(error) => error,
            };
            self.refuse(block, &error);
            match error {
                OverlayError::UnknownParameter { found, .. }
                | OverlayError::ParameterTwice { found, .. } => {
                    values.retain(|(name, _)| *name != found);
                }
                OverlayError::Missing { id, name } | OverlayError::Outside { id, name, .. } => {
                    values.retain(|(found, _)| *found != name);
                    let parameters = definition(id).into_iter().flat_map(|known| known.parameters);
                    let known = parameters.filter(|parameter| parameter.name == name);
                    values.extend(known.map(|parameter| (name, parameter.neutral)));
                }
                OverlayError::Wheel { needed, .. } => wheel = needed.then_some(WHEELS[0]),
                OverlayError::UnknownEffect { .. } | OverlayError::EffectTwice { .. } => return,
            }
        }
    }

    fn refuse(&mut self, block: &Block<'_>, error: &OverlayError) {
        let key = error.key();
        let cause = match error {
            OverlayError::UnknownEffect { .. } => Cause::NotAllowed,
            OverlayError::UnknownParameter { .. } => Cause::UnknownKey,
            OverlayError::Missing { .. } | OverlayError::Wheel { needed: true, .. } => {
                Cause::Missing
            }
            OverlayError::Outside { .. } => Cause::OutOfRange,
            OverlayError::ParameterTwice { .. }
            | OverlayError::Wheel { needed: false, .. }
            | OverlayError::EffectTwice { .. } => Cause::Conflict(error.to_string()),
        };
        let span = block.span(key);
        let value = block.table.get(key).map(|value| self.file.excerpt(&value.span()));
        let place = format!("{}.{key}", block.place);
        self.report(place, span, value, cause, &error.allowed());
        let near = match error {
            OverlayError::UnknownEffect { found } => {
                nearest(found, library().iter().map(|definition| definition.id))
            }
            OverlayError::UnknownParameter { id, found } => definition(id).and_then(|definition| {
                nearest(found, definition.parameters.iter().map(|parameter| parameter.name))
            }),
            _ => None,
        };
        if let (Some(problem), Some(near)) = (self.problems.last_mut(), near) {
            problem.help = Some(format!("did you mean \"{near}\"?"));
        }
    }

    fn text(&mut self, block: &Block<'_>, key: &str) -> Option<String> {
        let value = block.table.get(key)?;
        if let DeValue::String(text) = value.get_ref() {
            return Some(text.to_string());
        }
        self.wrong_type(format!("{}.{key}", block.place), value.span(), value.get_ref(), "a text");
        None
    }

    fn wheel(&mut self, block: &Block<'_>, name: &str) -> Option<Wheel> {
        let wheel = WHEELS.into_iter().find(|wheel| wheel.name() == name);
        if wheel.is_none() {
            let (place, span) = (format!("{}.wheel", block.place), block.span("wheel"));
            let names = WHEELS.map(Wheel::name).join(", ");
            let value = Some(self.file.excerpt(&span));
            self.report(place, span, value, Cause::NotAllowed, &format!("one of {names}"));
        }
        wheel
    }

    fn wrong_type(&mut self, key: String, span: Range<usize>, found: &DeValue<'_>, allowed: &str) {
        let value = Some(self.file.excerpt(&span));
        self.report(key, span, value, Cause::WrongType { found: found.type_str() }, allowed);
    }

    fn report(
        &mut self,
        key: String,
        span: Range<usize>,
        value: Option<String>,
        cause: Cause,
        allowed: &str,
    ) {
        let (line, column) = self.file.position(span.start);
        self.problems.push(Problem {
            severity: Severity::Error,
            file: self.file.name.clone(),
            source: Arc::clone(&self.file.text),
            span,
            line,
            column,
            key,
            value,
            cause,
            allowed: allowed.to_owned(),
            help: None,
        });
    }
}

fn ids() -> String {
    let ids: Vec<&str> = library().iter().map(|definition| definition.id).collect();
    format!("one of {}", ids.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[[effect]]\nid = \"count_loss\"\nwheel = \"rl\"\nfraction = 0.08\n\n\
                        [[effect]]\nid = \"acceleration_limit\"\nlimit = inf\n\n\
                        [[effect]]\nid = \"track_scale\"\nfront = 1.0\nrear = 0.9300000000000002\n";

    #[test]
    fn an_overlay_is_written_as_it_is_read() {
        let overlay = parse_overlay("model.toml", TEXT).unwrap();
        assert_eq!(overlay.to_string(), TEXT);
        assert_eq!(overlay.effects().len(), 3);
        assert_eq!(overlay.effects()[2].value("rear"), Some(0.930_000_000_000_000_2));
        assert!(parse_overlay("model.toml", "").unwrap().is_empty());
        let whole = parse_overlay(
            "m",
            "[[effect]]\nid = \"floor_patch\"\nx = 1\ny = 2\nradius = 1\nratio = 0",
        );
        assert_eq!(whole.unwrap().effects()[0].values(), [1.0, 2.0, 1.0, 0.0]);
    }

    #[test]
    fn every_problem_is_told_with_its_place_and_what_is_allowed() {
        for (text, line, parts) in [
            ("effects = 1", 1, &["effects: unknown key", "[[effect]]"][..]),
            ("effect = 3", 1, &["effect = 3", "wrong type, integer"]),
            ("[[effect]]\n", 1, &["effect[0].id: missing", "one of speed_gain"]),
            ("[[effect]]\nid = \"steering_gian\"\ngain = 1", 2, &["not allowed", "steering_gain"]),
            ("[[effect]]\nid = 7", 2, &["effect[0].id = 7", "a text"]),
            (
                "[[effect]]\nid = \"drive_slip\"\nratoi = 0.1\nratio = 0.1",
                3,
                &["effect[0].ratoi = 0.1: unknown key", "did you mean \"ratio\"?"],
            ),
            ("[[effect]]\nid = \"drive_slip\"", 1, &["effect[0].ratio: missing", "ratio once"]),
            (
                "[[effect]]\nid = \"drive_slip\"\nratio = 2",
                3,
                &["effect[0].ratio = 2: out of range", "-1 to 0.95"],
            ),
            ("[[effect]]\nid = \"gyro_bias\"\nbias = nan", 3, &["nan", "out of range"]),
            ("[[effect]]\nid = \"gyro_bias\"\nbias = \"1\"", 3, &["wrong type", "a number"]),
            (
                "[[effect]]\nid = \"count_loss\"\nfraction = 0.1",
                1,
                &["effect[0].wheel: missing", "one of fl, fr, rl, rr"],
            ),
            (
                "[[effect]]\nid = \"count_loss\"\nwheel = \"left\"\nfraction = 0.1",
                3,
                &["\"left\"", "one of fl, fr, rl, rr"],
            ),
            (
                "[[effect]]\nid = \"gyro_gain\"\nwheel = \"fl\"\ngain = 1",
                3,
                &["does not belong to one wheel"],
            ),
            (
                "[[effect]]\nid = \"gyro_gain\"\ngain = 1\n[[effect]]\nid = \"gyro_gain\"\ngain = 1",
                5,
                &["effect[1].id", "there twice", "every effect once"],
            ),
            ("[[effect]\n", 1, &["not valid TOML"]),
        ] {
            let error = parse_overlay("model.toml", text).unwrap_err();
            let [problem] = error.problems() else { panic!("{text}: {error}") };
            assert_eq!((problem.line, &*problem.file), (line, "model.toml"), "{text}: {error}");
            let told = problem.to_string();
            parts.iter().for_each(|part| assert!(told.contains(part), "{part} in {told}"));
        }
    }

    #[test]
    fn all_that_is_wrong_is_told_at_once() {
        let text =
            "[[effect]]\nid = \"track_scale\"\nfront = 99\nwidth = 1\n[[effect]]\nid = \"x\"";
        let error = parse_overlay("model.toml", text).unwrap_err();
        let keys: Vec<&str> = error.problems().iter().map(|problem| &*problem.key).collect();
        assert_eq!(keys, ["effect[0].rear", "effect[0].front", "effect[0].width", "effect[1].id"]);
    }
}
