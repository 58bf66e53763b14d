//! How sure: parameters with their intervals, what else it may be, and what these runs cannot show.

use kerbside_diagnosis::{Alternative, FoundEffect, Verdict};

use super::data::{DiagnoseReport, plain};
use crate::format::{self, probability};
use crate::page::{Block, Row, Section, Table};

/// Sizes per row of the table of what would have been seen.
const ABREAST: usize = 3;

impl DiagnoseReport {
    pub(super) fn sure_section(&self) -> Section {
        let diagnosis = &self.diagnosis;
        let mut blocks = Vec::new();
        if !diagnosis.effects.is_empty() {
            let columns =
                ["effect", "link", "parameter", "", "#value (90 % interval)", "#probability"];
            let rows = diagnosis.effects.iter().flat_map(parameter_rows);
            blocks.push(Block::Table(Table::new("The effects", &columns, "").with_rows(rows)));
        }
        if diagnosis.alternatives.len() > 1 {
            let columns = ["one of these", "#probability"];
            let rows = diagnosis.alternatives.iter().map(alternative_row);
            let caption = "The fewest that hold the cause with 90 %";
            blocks.push(Block::Table(Table::new(caption, &columns, "").with_rows(rows)));
        }
        if let Some(words) = self.what_would_change_it() {
            blocks.push(Block::Text(words));
        }
        if !diagnosis.not_excited.is_empty() {
            let names: Vec<String> = diagnosis.not_excited.iter().map(|id| plain(id)).collect();
            blocks.push(Block::Text(format!(
                "These runs cannot show, and therefore do not deny: {}.",
                names.join(", ")
            )));
        }
        let remarks: Vec<String> = diagnosis.notices.iter().chain(&self.notes).cloned().collect();
        if !remarks.is_empty() {
            blocks.push(Block::List(remarks));
        }
        if !diagnosis.smallest_seen.is_empty() {
            blocks.push(Block::Table(self.smallest_table()));
        }
        if blocks.is_empty() {
            blocks.push(Block::Text("Nothing is to be added.".to_owned()));
        }
        Section::new("how-sure", "How sure that is", blocks)
            .with_lead("Intervals hold the truth nine times in ten.")
    }

    /// The smallest size of each effect that would have been seen, several abreast.
    fn smallest_table(&self) -> Table {
        let sizes = &self.diagnosis.smallest_seen;
        let columns: Vec<&str> =
            ["effect", "#size"].into_iter().cycle().take(2 * ABREAST).collect();
        let high = sizes.len().div_ceil(ABREAST);
        let cells = |row: usize| {
            let pair = move |column: usize| match sizes.get(column * high + row) {
                Some((id, size)) => [plain(id), format::significant(*size, 2)],
                None => [String::new(), String::new()],
            };
            Row::new((0..ABREAST).flat_map(pair))
        };
        let caption = "The smallest size that would have been seen, in the effect's unit";
        Table::new(caption, &columns, "").with_rows((0..high).map(cells))
    }

    /// What stands between this verdict and another, a sentence.
    fn what_would_change_it(&self) -> Option<String> {
        let diagnosis = &self.diagnosis;
        let chosen = |name: &str| {
            let names: Vec<&str> = name.split(" + ").collect();
            let found = |effect: &FoundEffect| names.contains(&effect.id);
            name == diagnosis.verdict.name()
                || diagnosis.effects.len() == names.len() && diagnosis.effects.iter().all(found)
        };
        let next = diagnosis.ranking.iter().find(|rival| !chosen(&rival.name));
        let rival = next.map(|rival| (plain(&rival.name), probability(rival.probability)));
        let unseen = (diagnosis.unseen > 0.0).then(|| {
            format!(
                "That another effect, too small for these runs, acts beside it has a probability of {}.",
                probability(diagnosis.unseen)
            )
        });
        Some(match (diagnosis.verdict, rival) {
            (Verdict::None, _) => "An effect larger than the sizes below would have been seen.".to_owned(),
            (Verdict::Unknown, _) => {
                "A repeatable residual is left that no listed effect explains: naming one would be a guess.".to_owned()
            }
            (Verdict::Mistake, _) => {
                "Mend the mistake and diagnose again: no effect was judged on top of it.".to_owned()
            }
            (Verdict::Ambiguous, _) => {
                "More of the same runs will not decide; the manoeuvre below will.".to_owned()
            }
            (Verdict::Effects, Some((name, probability))) => {
                let nearest = format!(
                    "The verdict's nearest rival is {name}, at a probability of {probability}."
                );
                [Some(nearest), unseen].into_iter().flatten().collect::<Vec<_>>().join(" ")
            }
            (Verdict::Effects, None) => return unseen,
        })
    }
}

fn parameter_rows(effect: &FoundEffect) -> Vec<Row> {
    let wheel = effect.wheel.map_or_else(String::new, |wheel| format!(" of {wheel}"));
    let row = |parameter: &kerbside_diagnosis::FoundParameter| {
        let value = parameter.value;
        Row::new([
            format!("{}{wheel}", plain(effect.id)),
            plain(effect.link.name()),
            plain(parameter.name),
            parameter.unit.to_owned(),
            format::interval([value.value, value.low, value.high]),
            probability(effect.probability),
        ])
    };
    effect.parameters.iter().map(row).collect()
}

fn alternative_row(alternative: &Alternative) -> Row {
    let names: Vec<String> = alternative.ids.iter().map(|id| plain(id)).collect();
    Row::new([names.join(" + "), probability(alternative.probability)])
}
