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
                    A dot is a run: to the right of 0 it is predicted better than without any effect, or better \
                    than by the likeliest.";
        let blocks = match self.diagnosis.ranking.is_empty() {
            true => vec![Block::Text("No rival was fitted.".to_owned())],
            false => vec![Block::Figure(self.rivals())],
        };
        Section::new("which", "Which effect causes it", blocks).with_lead(lead)
    }

    fn rivals(&self) -> Figure {
        let rivals = &self.diagnosis.ranking;
        let drawn = &rivals[..rivals.len().min(DRAWN)];
        let mut panels = vec![Panel {
            title: "probability".to_owned(),
            range: Range::new(0.0, 1.0),
            share: 0.7,
            words: 44.0,
            limits: Vec::new(),
        }];
        let titles = ["over no effect [standard deviations]", "over the likeliest"];
        let sides = [
            drawn.iter().flat_map(over_nothing).collect(),
            drawn.iter().flat_map(|rival| over(rival, &drawn[0])).collect(),
        ];
        for (title, gains) in titles.into_iter().zip(sides) {
            let gains: Vec<f64> = gains;
            if gains.iter().any(|gain| gain.is_finite()) {
                panels.push(panel(title, gains));
            }
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
            words: format::probability(rival.probability),
            ..Cell::default()
        };
        let dots = |gains: Vec<f64>| {
            let run = |index: usize| self.runs.get(index).map_or("a run", String::as_str);
            let dot = |(index, gain): (usize, f64)| {
                (gain, format!("{}: {}", run(index), format::signed(gain, 1)))
            };
            Cell { dots: gains.into_iter().enumerate().map(dot).collect(), ..Cell::default() }
        };
        let likeliest = self.diagnosis.ranking.first();
        let against = likeliest.map_or_else(Vec::new, |likeliest| over(rival, likeliest));
        BarRow {
            name: plain(&rival.name),
            note: if chosen { self.sizes(rival) } else { String::new() },
            weight: if chosen { RowWeight::Strong } else { RowWeight::Normal },
            cells: vec![first, dots(over_nothing(rival)), dots(against)],
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

/// A panel of gains.
fn panel(title: &str, gains: Vec<f64>) -> Panel {
    let range = Range::covering(gains.into_iter().chain([-0.5, 0.5]));
    Panel {
        title: title.to_owned(),
        range: range.unwrap_or(Range::new(0.0, 1.0)).padded(0.04),
        share: 1.0,
        words: 0.0,
        limits: vec![0.0],
    }
}

/// Gains over no effect, on each run while it was left out.
fn over_nothing(rival: &Rival) -> Vec<f64> {
    rival.left_out.iter().map(|gain| deviations(*gain)).collect()
}

/// The same over another rival; nothing over itself.
fn over(rival: &Rival, other: &Rival) -> Vec<f64> {
    let pairs = rival.left_out.iter().zip(&other.left_out);
    let gains = pairs.map(|(gain, other)| deviations(gain - other));
    if rival.name == other.name { Vec::new() } else { gains.collect() }
}

/// A gain in log-likelihood, given twice, as the standard deviations of a difference that would weigh as much; what
/// speaks against is negative.
fn deviations(gain: f64) -> f64 {
    gain.abs().sqrt().copysign(gain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_keep_their_sign() {
        assert_eq!([deviations(9.0), deviations(-4.0), deviations(0.0)], [3.0, -2.0, 0.0]);
    }
}
