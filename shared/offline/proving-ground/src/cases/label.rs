//! The answer to a case.

use core::fmt::Write;

use super::specification::{Kind, Specification};
use crate::insertions::{Effect, Link, measured};

/// What was put in, in the terms of the list; what acts by physics of its own is stated as measured on the vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// What kind of cause.
    pub kind: Kind,
    /// Where, in the order of cause.
    pub links: Vec<Link>,
    /// Which listed effects.
    pub effects: Vec<Effect>,
    /// Half the range over speeds and angles in which a parameter was measured: id, parameter, half range.
    pub spread: Vec<(&'static str, &'static str, f64)>,
    /// What happens, where no listed effect says it.
    pub description: Option<String>,
}

impl Label {
    /// The label of a case.
    pub(super) fn new(case: &Specification) -> Self {
        let (mut effects, mut spread) = (case.effects.clone(), Vec::new());
        for effect in &mut effects {
            for (name, value) in &mut effect.values {
                if let Some(measured) = measured(case, effect.id, name) {
                    *value = measured.value;
                    spread.push((effect.id, *name, measured.spread));
                }
            }
        }
        let unknown = case.kind == Kind::Unknown;
        let sentences: Vec<_> = effects.iter().map(Effect::sentence).collect();
        Self {
            kind: case.kind,
            links: case.links(),
            effects: if unknown { Vec::new() } else { effects },
            spread,
            description: unknown.then(|| sentences.join("; ")),
        }
    }

    /// As `label.toml` says it.
    #[must_use]
    pub fn text(&self) -> String {
        let links: Vec<_> = self.links.iter().map(|link| format!("\"{}\"", link.name())).collect();
        let mut text = format!("kind = \"{}\"\nlinks = [{}]\n", self.kind.name(), links.join(", "));
        // Writing to a string never fails.
        if let Some(description) = &self.description {
            let _ = writeln!(text, "description = \"{description}\"");
        }
        for effect in &self.effects {
            let _ = write!(text, "\n[[effect]]\nid = \"{}\"\n", effect.id);
            if let Some(wheel) = effect.wheel {
                let _ = writeln!(text, "wheel = \"{}\"", wheel.name());
            }
            for (name, value) in &effect.values {
                let _ = writeln!(text, "{name} = {value:?}");
            }
        }
        for (id, name, spread) in &self.spread {
            let _ = write!(
                text,
                "\n[[spread]]\nid = \"{id}\"\nparameter = \"{name}\"\nhalf_range = {spread:?}\n"
            );
        }
        text
    }
}
