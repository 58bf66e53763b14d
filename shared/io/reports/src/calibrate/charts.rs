//! Paths and end errors, before and after: the paper's Fig. 6.

use super::data::{CalibrateReport, EndErrors, ReckonedPath, RunPaths};
use crate::page::Block;
use crate::svg::{Figure, Ink, Legend, Line, Map, Range};

const REFERENCE: Line = Line::new(Ink::Green).wide();

/// The colour of a source.
fn ink(source: &str) -> Ink {
    match source {
        "rear" => Ink::Orange,
        "front" => Ink::Blue,
        _ => Ink::Purple,
    }
}

/// Figures of before and after side by side.
fn pair(before: Figure, after: Figure) -> Block {
    Block::Beside(vec![Block::Figure(before), Block::Figure(after)])
}

/// The range that covers all points, with a margin.
fn cover(points: impl Iterator<Item = f64> + Clone) -> Range {
    Range::covering(points).unwrap_or(Range::new(0.0, 1.0)).padded(0.06)
}

impl RunPaths {
    /// The run from above, before and after, in the same view.
    pub(super) fn figures(&self, number: usize) -> Block {
        let all = || {
            let reckoned =
                self.reckoned.iter().flat_map(|path| path.before.iter().chain(&path.after));
            let end = self.end.iter().map(|end| [end.x, end.y]);
            reckoned.chain(&self.reference).copied().chain(end).collect::<Vec<_>>()
        };
        let view = [0, 1].map(|axis| cover(all().iter().map(|point| point[axis])));
        let before = self.map(&format!("before-{number}"), "before", view, |path| &path.before);
        let after = self.map(&format!("after-{number}"), "after", view, |path| &path.after);
        pair(before, after)
    }

    fn map(
        &self,
        id: &str,
        when: &str,
        [x, y]: [Range; 2],
        points: impl Fn(&ReckonedPath) -> &Vec<[f64; 2]>,
    ) -> Figure {
        let title = format!("{}, {when}", self.run);
        let description = format!("Paths of {} by dead reckoning {when} calibration.", self.run);
        let mut map = Map::small(id, &title, &description, "m");
        map.show(x, y);
        if !self.reference.is_empty() {
            map.path(self.reference.clone(), REFERENCE);
            map.explain(Legend::line("reference", REFERENCE));
        }
        for path in &self.reckoned {
            let line = Line::new(ink(&path.source));
            map.path(points(path).clone(), line);
            map.explain(Legend::line(&path.source, line));
        }
        if let Some(end) = self.end {
            map.cross([end.x, end.y], Ink::Green);
        }
        map.figure()
    }
}

impl CalibrateReport {
    /// Where the runs left out end, seen from their known ends.
    pub(super) fn end_maps(&self) -> Block {
        let before =
            self.end_map("ends-before", "End errors before", |row| [row.before.x, row.before.y]);
        let after =
            self.end_map("ends-after", "End errors after", |row| [row.after.x, row.after.y]);
        pair(before, after)
    }

    fn end_map(&self, id: &str, title: &str, at: impl Fn(&EndErrors) -> [f64; 2]) -> Figure {
        let description = format!("{title}: along and across the start's heading, a cross a run.");
        let mut map = Map::small(id, title, &description, "m");
        let zero = [0.0, 0.0];
        let axes = [0, 1].map(|axis| {
            let values = self.left_out.iter().map(|row| at(row)[axis]);
            cover(values.chain([0.0]).collect::<Vec<_>>().into_iter())
        });
        map.show(axes[0], axes[1]);
        map.path(vec![[axes[0].low(), 0.0], [axes[0].high(), 0.0]], Line::new(Ink::Grey).thin());
        map.path(vec![[0.0, axes[1].low()], [0.0, axes[1].high()]], Line::new(Ink::Grey).thin());
        let mut sources: Vec<&str> = Vec::new();
        for row in &self.left_out {
            map.cross(at(row), ink(&row.source));
            if !sources.contains(&row.source.as_str()) {
                sources.push(&row.source);
            }
        }
        for source in sources {
            map.explain(Legend::line(source, Line::new(ink(source))));
        }
        map.number(zero, 0, Ink::Green);
        map.figure()
    }
}
