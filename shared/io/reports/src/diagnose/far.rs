//! How far: the gap of the trajectory before and after, effect by effect, over the way and over the horizon.

use kerbside_diagnosis::{Judged, RunPaths, Shrinkage};

use super::data::{DiagnoseReport, plain, points};
use crate::format::{percent, significant, with_unit};
use crate::page::{Block, Section};
use crate::svg::{
    Band, Bar, BarRow, Cell, Chart, Cloud, Figure, Ink, Legend, Line, Map, Panel, Range, RowWeight,
    Rows, Ticks, Trace,
};

/// Height of a run's map, in figure units: level with the chart beside it.
const LEVEL: f64 = 170.0;
/// Runs drawn, at most.
const DRAWN: usize = 6;
const MEASURED: Line = Line::new(Ink::Green).wide();
const NOMINAL: Line = Line::new(Ink::Orange);
const AFTER: Line = Line::new(Ink::Blue);

impl DiagnoseReport {
    pub(super) fn far_section(&self) -> Option<Section> {
        let diagnosis = &self.diagnosis;
        let mut blocks: Vec<Block> =
            diagnosis.gap.iter().map(|gap| Block::Figure(self.waterfall(gap))).collect();
        let curves = [self.horizons(), self.circumstance()];
        let curves: Vec<Block> = curves.into_iter().flatten().map(Block::Figure).collect();
        blocks.extend((!curves.is_empty()).then_some(Block::Beside(curves)));
        let drawn = self.drawn(DRAWN);
        let more = diagnosis.paths.len() - drawn.len();
        blocks.extend(drawn.iter().enumerate().map(|(number, run)| self.run_figures(run, number)));
        if blocks.is_empty() {
            return None;
        }
        if more > 0 {
            blocks.push(Block::Text(format!("{more} more of the runs are not drawn.")));
        }
        let lead = match diagnosis.gap.as_ref().map(|gap| gap.judged) {
            Some(Judged::Fitted) => {
                "Simulated from the commands and the measured start alone. There is a single run: what is shown is the \
                 one that the effects were fitted to, and proves nothing."
            }
            Some(Judged::ByHand) => {
                "Simulated from the commands and the measured start alone, with effects given by hand."
            }
            _ => {
                "Simulated from the commands and the measured start alone. The figures are of runs that chose and \
                 fitted nothing."
            }
        };
        Some(Section::new("how-far", "How far the gap shrinks", blocks).with_lead(lead))
    }

    fn waterfall(&self, gap: &Shrinkage) -> Figure {
        let has_effects = !gap.steps.is_empty();
        let mut rows = vec![bar_row("nominal vehicle", gap.before, Ink::Orange)];
        let mut from = gap.before;
        for (effect, to) in self.diagnosis.effects.iter().zip(&gap.steps) {
            rows.push(step_row(effect.id, from, *to));
            from = *to;
        }
        if has_effects {
            rows.push(bar_row("with the effects", gap.after, Ink::Blue));
        }
        rows.push(bar_row("noise alone", gap.floor, Ink::Grey));
        let values = [gap.before, gap.after, gap.floor, 0.0];
        let range = Range::covering(values.into_iter().chain(gap.steps.iter().copied()));
        let range = range.unwrap_or(Range::new(0.0, 1.0));
        let panel = Panel {
            title: "position error along the way, root mean square [m]".to_owned(),
            range: Range::new(0.0, 1.04 * range.high().max(1e-6)),
            share: 1.0,
            words: 80.0,
            limits: vec![gap.floor],
        };
        let figure = Rows {
            id: "waterfall".to_owned(),
            title: "From the nominal vehicle to noise alone".to_owned(),
            description: "A bar per stage: the position error, and what each effect takes off."
                .to_owned(),
            panels: vec![panel],
            rows,
            ..Rows::default()
        }
        .figure();
        figure.with_caption(removed(gap))
    }

    /// The residual against the circumstance that matters, before and after.
    fn circumstance(&self) -> Option<Figure> {
        let plot = self.diagnosis.plot.as_ref()?;
        let side = |after: bool| {
            let points = plot.points.iter();
            points.map(|(x, before, left)| [*x, if after { *left } else { *before }]).collect()
        };
        let cloud = |label: &str, line: Line, points: Vec<[f64; 2]>| Cloud {
            label: label.to_owned(),
            ink: line.ink,
            points,
        };
        let mut clouds = vec![cloud("nominal vehicle", NOMINAL, side(false))];
        if !self.diagnosis.effects.is_empty() {
            clouds.push(cloud("with the effects", AFTER, side(true)));
        }
        let chart = Chart {
            id: "circumstance".to_owned(),
            title: "The residual where it matters".to_owned(),
            description: format!("{} against {}, before and after.", plot.signal, plot.axis),
            x_title: plot.axis.clone(),
            y_title: plot.signal.clone(),
            clouds,
            limits: vec![0.0],
            ..Chart::default()
        };
        Some(chart.figure())
    }

    /// Error against horizon, on logarithmic axes.
    fn horizons(&self) -> Option<Figure> {
        let positive = |value: &f64| *value > 0.0 && value.is_finite();
        let rows = &self.diagnosis.horizons;
        let times = Range::covering(rows.iter().map(|row| row.0).filter(positive))?;
        let sizes = rows.iter().flat_map(|row| [row.1, row.2, row.3]).filter(positive);
        let sizes = Range::covering(sizes)?;
        let sizes = Range::new(sizes.low() / 1.5, sizes.high() * 1.5);
        let curve = |pick: fn(&(f64, f64, f64, f64)) -> f64| {
            rows.iter().map(|row| [row.0, pick(row)]).collect::<Vec<_>>()
        };
        let mut traces = vec![trace("nominal vehicle", NOMINAL, curve(|row| row.1))];
        if !self.diagnosis.effects.is_empty() {
            traces.push(trace("with the effects", AFTER, curve(|row| row.2)));
        }
        let floor = rows.iter().map(|row| [row.0, sizes.low(), row.3]).collect();
        let chart = Chart {
            id: "horizons".to_owned(),
            title: "Position error against horizon".to_owned(),
            description: "The error of the position over the time predicted, both logarithmic."
                .to_owned(),
            x_title: "horizon [s]".to_owned(),
            y_title: "error [m]".to_owned(),
            x_ticks: Ticks::Log,
            y_ticks: Ticks::Log,
            x_range: Some(Range::new(times.low() / 1.1, times.high() * 1.1)),
            y_range: Some(sizes),
            traces,
            bands: vec![Band { label: "noise floor".to_owned(), ink: Ink::Grey, points: floor }],
            ..Chart::default()
        };
        Some(chart.figure())
    }

    /// Paths from above, and the distance from the measured one over time.
    fn run_figures(&self, run: &RunPaths, number: usize) -> Block {
        let has_effects = !self.diagnosis.effects.is_empty();
        let description =
            format!("Paths of {}: measured, nominal, and with the effects.", run.name);
        let mut map = Map::small(&format!("path-{number}"), &run.name, &description, "m");
        map.keep_within(LEVEL);
        let lines = [
            ("measured", MEASURED, &run.measured),
            ("nominal vehicle", NOMINAL, &run.nominal),
            ("with the effects", AFTER, &run.after),
        ];
        for (label, line, path) in lines {
            if !path.is_empty() && (line != AFTER || has_effects) {
                map.path(points(path), line);
                map.explain(Legend::line(label, line));
            }
        }
        let map = Block::Figure(map.figure());
        if run.errors.is_empty() {
            return Block::Beside(vec![map]);
        }
        let nominal = run.errors.iter().map(|(t, nominal, _)| [*t, *nominal]).collect();
        let after = run.errors.iter().map(|(t, _, after)| [*t, *after]).collect();
        let mut traces = vec![trace("nominal vehicle", NOMINAL, nominal)];
        if has_effects && !run.after.is_empty() {
            traces.push(trace("with the effects", AFTER, after));
        }
        let chart = Chart {
            id: format!("error-{number}"),
            title: format!("{}, distance from the measured path", run.name),
            description: format!("Distance of {} from the measured path over time.", run.name),
            x_title: "time [s]".to_owned(),
            y_title: "distance [m]".to_owned(),
            traces,
            limits: vec![0.0],
            ..Chart::default()
        };
        Block::Beside(vec![map, Block::Figure(chart.figure())])
    }
}

fn trace(label: &str, line: Line, points: Vec<[f64; 2]>) -> Trace {
    Trace { label: label.to_owned(), line, points }
}

fn metres(value: f64) -> String {
    with_unit(&significant(value, 3), "m")
}

fn bar_row(name: &str, value: f64, ink: Ink) -> BarRow {
    let cell =
        Cell { bars: vec![Bar::new(0.0, value, ink)], words: metres(value), ..Cell::default() };
    let weight = RowWeight::Normal;
    BarRow { name: name.to_owned(), note: String::new(), weight, cells: vec![cell] }
}

/// What an effect takes off; one that adds is shown as such.
fn step_row(id: &str, from: f64, to: f64) -> BarRow {
    let ink = if to <= from { Ink::Green } else { Ink::Vermilion };
    let sign = if to <= from { "\u{2212}" } else { "+" };
    let words = format!("{sign}{}", metres((to - from).abs()));
    let cell = Cell { bars: vec![Bar::new(to, from, ink)], words, ..Cell::default() };
    let weight = RowWeight::Strong;
    BarRow { name: plain(id), note: String::new(), weight, cells: vec![cell] }
}

/// What share of the explainable gap goes, a sentence.
fn removed(gap: &Shrinkage) -> String {
    let yaw = gap.yaw.map(|yaw| significant(kerbside_geometry::angle::degrees(yaw), 2));
    let [before, after, floor] = yaw;
    let yaw =
        format!("Heading: {before} deg before, {after} deg after, {floor} deg by noise alone.");
    match &gap.removed {
        Some(removed) if !removed.low.is_finite() => format!(
            "{} of the explainable gap is removed on {}. {yaw}",
            percent(removed.value),
            gap.judged.words()
        ),
        Some(removed) => format!(
            "{} of the explainable gap is removed (90 % interval {} to {}). {yaw}",
            percent(removed.value),
            percent(removed.low),
            percent(removed.high)
        ),
        None => format!("There is too little to explain for a share to mean anything. {yaw}"),
    }
}
