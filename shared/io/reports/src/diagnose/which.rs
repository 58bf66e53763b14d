//! Which: the rivals, how likely each is, and what each gains on runs that it was not fitted to.

use kerbside_diagnosis::{FoundEffect, FoundParameter, Rival};

use super::data::{DiagnoseReport, plain};
use crate::format;
use crate::page::{Block, Section};
use crate::svg::{Bar, BarRow, Cell, Figure, Ink, Panel, Range, RowWeight, Rows};

/// Rivals drawn, at most.
const DRAWN: usize = 10;

impl DiagnoseReport {
    pub(super) fn which_section(&self) -> Section {
        let lead = "Every set of effects is fitted and compared on runs left out of the fit. \
                    A dot is a run: to the right of 0 the set of effects predicts it better than no effect.";
        let blocks = match self.diagnosis.ranking.is_empty() {
            true => vec![Block::Text("No rival was fitted.".to_owned())],
            false => vec![Block::Figure(self.rivals())],
        };
        Section::new("which", "Which effect causes it", blocks).with_lead(lead)
    }

    fn rivals(&self) -> Figure {
        let rivals = &self.diagnosis.ranking;
        let drawn = &rivals[..rivals.len().min(DRAWN)];
        let gains = drawn.iter().flat_map(|rival| &rival.left_out).map(|gain| deviations(*gain));
        let reach = Range::covering(gains.chain([0.0, 1.0]));
        let mut panels = vec![Panel {
            title: "probability".to_owned(),
            range: Range::new(0.0, 1.0),
            share: 1.0,
            words: 44.0,
            limits: Vec::new(),
        }];
        if drawn.iter().any(|rival| !rival.left_out.is_empty()) {
            panels.push(Panel {
                title: "gain on each run while left out, in standard deviations".to_owned(),
                range: reach.unwrap_or(Range::new(0.0, 1.0)).padded(0.04),
                share: 1.5,
                words: 0.0,
                limits: vec![0.0],
            });
        }
        let figure = Rows {
            id: "rivals".to_owned(),
            title: "Rivals, likeliest first".to_owned(),
            description:
                "A row per set of effects: its probability, and its gain on runs left out."
                    .to_owned(),
            panels,
            rows: drawn.iter().map(|rival| self.rival_row(rival)).collect(),
            ..Rows::default()
        }
        .figure();
        let caption = match rivals.len() - drawn.len() {
            0 => String::new(),
            more => format!(
                "And {} that are less likely.",
                format::plural(more as u64, "rival", "rivals")
            ),
        };
        figure.with_caption(caption)
    }

    fn rival_row(&self, rival: &Rival) -> BarRow {
        let chosen = self.is_chosen(rival);
        let ink = if chosen { Ink::Blue } else { Ink::Grey };
        let first = Cell {
            bars: vec![Bar::new(0.0, rival.probability, ink)],
            words: probability(rival.probability),
            ..Cell::default()
        };
        let run = |index: usize| self.runs.get(index).map_or("a run", String::as_str);
        let dot = |(index, gain): (usize, &f64)| {
            let gain = deviations(*gain);
            (gain, format!("{}: {}", run(index), format::signed(gain, 1)))
        };
        let dots = rival.left_out.iter().enumerate().map(dot).collect();
        BarRow {
            name: plain(&rival.name),
            note: if chosen { self.sizes(rival) } else { String::new() },
            weight: if chosen { RowWeight::Strong } else { RowWeight::Normal },
            cells: vec![first, Cell { dots, ..Cell::default() }],
        }
    }

    /// Whether a rival is the answer: its effects, or its word.
    fn is_chosen(&self, rival: &Rival) -> bool {
        let diagnosis = &self.diagnosis;
        let ids: Vec<&str> = diagnosis.effects.iter().map(|effect| effect.id).collect();
        let names: Vec<&str> = rival.name.split(" + ").collect();
        let same = names.len() == ids.len() && names.iter().all(|name| ids.contains(name));
        same || rival.name == diagnosis.verdict.name()
    }

    /// Sizes of the effects of the answer, in as few words as go.
    fn sizes(&self, rival: &Rival) -> String {
        let named = |effect: &&FoundEffect| rival.name.split(" + ").any(|name| name == effect.id);
        let effects = self.diagnosis.effects.iter().filter(named);
        let words: Vec<String> =
            effects.flat_map(|effect| effect.parameters.iter().map(size)).collect();
        words.join(", ")
    }
}

fn size(parameter: &FoundParameter) -> String {
    let value = format::significant(parameter.value.value, 3);
    format!("{} {}", plain(parameter.name), format::with_unit(&value, parameter.unit))
}

/// A gain in log-likelihood, given twice, as the standard deviations of a difference that would weigh as much; what
/// speaks against is negative.
fn deviations(gain: f64) -> f64 {
    gain.abs().sqrt().copysign(gain)
}

/// A probability; what is rounded to certainty says that it is no such thing.
pub(super) fn probability(value: f64) -> String {
    match value {
        certain if certain > 0.995 => ">\u{202f}0.99".to_owned(),
        none if none < 0.005 => "<\u{202f}0.01".to_owned(),
        between => format::fixed(between, 2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_keep_their_sign() {
        assert_eq!([deviations(9.0), deviations(-4.0), deviations(0.0)], [3.0, -2.0, 0.0]);
    }

    #[test]
    fn nothing_is_certain() {
        assert_eq!(probability(0.9999), ">\u{202f}0.99");
        assert_eq!(probability(0.97), "0.97");
        assert_eq!(probability(0.0), "<\u{202f}0.01");
        assert_eq!(probability(f64::NAN), format::UNKNOWN);
    }
}
