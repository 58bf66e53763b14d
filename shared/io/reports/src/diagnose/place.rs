//! Where: the chain of links with the gap of each.

use kerbside_diagnosis::{Diagnosis, LinkGap};
use kerbside_geometry::math;
use kerbside_simulation::effects::Link;

use super::data::{DiagnoseReport, plain, way};
use crate::format::{self, significant, with_unit};
use crate::page::{Block, Row, Section, Table};
use crate::svg::{Bar, BarRow, Cell, Figure, Ink, Legend, Panel, Range, RowWeight, Rows, Tone};

/// How far the axis of the chain goes at least, and at most, in what noise and a car in good order explain.
const REACH: [f64; 2] = [3.0, 60.0];

impl DiagnoseReport {
    pub(super) fn place_section(&self) -> Section {
        let diagnosis = &self.diagnosis;
        let columns = [
            "link",
            "signal that shows most",
            "",
            "#gap",
            "#noise floor",
            "#allowance",
            "#excess (90 % interval)",
        ];
        let table = Table::new("Links, over two seconds", &columns, "No link was measured.")
            .with_rows(diagnosis.links.iter().map(|gap| self.link_row(gap)));
        let mut blocks = vec![Block::Figure(self.chain()), Block::Text(self.moved())];
        blocks.extend(self.map().map(Block::Figure));
        if !diagnosis.regime.is_empty() {
            blocks.push(Block::Text(format!("{}.", capital(&diagnosis.regime))));
        }
        blocks.push(Block::Table(table));
        Section::new("where", "Where the gap lies", blocks).with_lead(
            "Each link is fed with what was measured before it, and asked for what was measured after it. \
             The gap is held against noise alone and against what a car in good order may differ by.",
        )
    }

    /// What the residuals say of the links before any effect is fitted, and whether the answer agrees.
    fn moved(&self) -> String {
        let Diagnosis { moved, links_named, .. } = &self.diagnosis;
        let names = |links: &[&Link], and: &str| {
            links.iter().map(|link| plain(link.name())).collect::<Vec<_>>().join(and)
        };
        let seen = match &moved.iter().collect::<Vec<_>>()[..] {
            [] => "no link had moved: what was left had the pattern of none, beyond noise and allowance".to_owned(),
            [one] => format!("one link had moved: what was left had the pattern of {}", names(&[*one], "")),
            several => format!(
                "what was left had the patterns of several links, the likeliest first: {}",
                names(several, ", ")
            ),
        };
        let elsewhere: Vec<&Link> =
            links_named.iter().filter(|link| !moved.contains(link)).collect();
        let after = match (moved.is_empty(), links_named.is_empty(), elsewhere.is_empty()) {
            (true, true, _) => String::new(),
            (false, true, _) => " The answer is at no link all the same.".to_owned(),
            (_, false, true) => " The answer is in keeping with it.".to_owned(),
            (_, false, false) => {
                format!(" The answer was found elsewhere: {}.", names(&elsewhere, ", "))
            }
        };
        format!("Before any effect was fitted, {seen}.{after}")
    }

    fn chain(&self) -> Figure {
        let gaps = &self.diagnosis.links;
        let reach = gaps.iter().filter(|gap| gap.measured).map(|gap| {
            let allowed = allowed(gap);
            1.05 * (gap.gap / allowed).max(beside(gap.high, allowed))
        });
        let reach = reach.filter(|reach| reach.is_finite()).fold(REACH[0], f64::max).min(REACH[1]);
        let legend = vec![
            Legend::bar("within the noise floor", Ink::Grey, false),
            Legend::bar("within the allowance of a car in good order", Ink::Grey, true),
            Legend::bar("excess", Ink::Vermilion, false),
            Legend::whisker("90 % interval of the excess"),
        ];
        let panel = Panel {
            title: "gap, in multiples of what noise and allowance make together".to_owned(),
            range: Range::new(0.0, reach),
            share: 1.0,
            words: 150.0,
            limits: vec![1.0],
        };
        Rows {
            id: "chain".to_owned(),
            title: "The chain from command to reference".to_owned(),
            description: "A bar per link, as long as its gap.".to_owned(),
            panels: vec![panel],
            rows: gaps.iter().map(|gap| self.chain_row(gap)).collect(),
            chained: true,
            legend,
        }
        .figure()
    }

    fn is_named(&self, gap: &LinkGap) -> bool {
        self.diagnosis.links_named.contains(&gap.link)
    }

    fn chain_row(&self, gap: &LinkGap) -> BarRow {
        let weight = match (gap.measured, self.is_named(gap)) {
            (false, _) => RowWeight::Faded,
            (true, true) => RowWeight::Strong,
            (true, false) => RowWeight::Normal,
        };
        BarRow {
            name: plain(gap.link.name()),
            note: way(gap.link).to_owned(),
            weight,
            cells: vec![if gap.measured { self.chain_cell(gap) } else { unmeasured() }],
        }
    }

    fn chain_cell(&self, gap: &LinkGap) -> Cell {
        let allowed = allowed(gap);
        let share = |value: f64| value / allowed;
        let (floor, inside) = (share(gap.floor.min(gap.gap)), share(gap.gap.min(allowed)));
        let mut bars = vec![
            Bar::new(0.0, floor, Ink::Grey),
            Bar::new(floor, inside.max(floor), Ink::Grey).pale(),
        ];
        let beyond = gap.excess > 0.0;
        if beyond {
            let bar = Bar::new(1.0, share(gap.gap).max(1.0), Ink::Vermilion);
            bars.push(if self.is_named(gap) { bar } else { bar.pale() });
        }
        let interval = [gap.low, gap.high].map(|excess| beside(excess, allowed));
        let gap_words = with_unit(&significant(gap.gap, 2), gap.unit);
        let words = format!(
            "{gap_words}, {} allowed",
            significant(math::hypot(gap.floor, gap.allowance), 2)
        );
        Cell { bars, whisker: (gap.high > 0.0).then_some(interval), dots: Vec::new(), words }
    }

    fn link_row(&self, gap: &LinkGap) -> Row {
        if !gap.measured {
            let dash = || format::UNKNOWN.to_owned();
            let cells = [plain(gap.link.name()), "not measured".to_owned(), String::new()];
            return Row::new(cells.into_iter().chain([dash(), dash(), dash(), dash()]));
        }
        let show = |value: f64| significant(value, 3);
        let row = Row::new([
            plain(gap.link.name()),
            gap.signal.to_owned(),
            gap.unit.to_owned(),
            show(gap.gap),
            show(gap.floor),
            show(gap.allowance),
            format::interval([gap.excess, gap.low, gap.high]),
        ]);
        if self.is_named(gap) { row.toned(Tone::Bad) } else { row }
    }
}

/// What noise and a car in good order explain of a gap, which have nothing to do with one another; never nothing, so
/// that it can be divided by.
fn allowed(gap: &LinkGap) -> f64 {
    math::hypot(gap.floor, gap.allowance).max(1e-12)
}

/// The gap that has this excess, in multiples of what is allowed.
fn beside(excess: f64, allowed: f64) -> f64 {
    math::hypot(1.0, excess / allowed)
}

fn unmeasured() -> Cell {
    Cell { words: "not measured".to_owned(), ..Cell::default() }
}

/// With a capital first letter.
pub(super) fn capital(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
