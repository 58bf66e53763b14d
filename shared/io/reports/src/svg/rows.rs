//! Rows of bars, whiskers and dots: one thing a row, one quantity a panel.

use super::canvas::{Canvas, path_data};
use super::figure::{Frame, Plot};
use super::{Figure, Ink, Legend, Range, Scale, Ticks};

/// A figure of rows, as wide as the page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// Unique on the page; letters, digits and hyphens.
    pub id: String,
    /// A few words.
    pub title: String,
    /// The picture in a sentence, for those who cannot see it.
    pub description: String,
    /// Quantities, from left to right.
    pub panels: Vec<Panel>,
    /// Rows, from top to bottom.
    pub rows: Vec<BarRow>,
    /// Joins the rows by arrows from each to the next.
    pub chained: bool,
    /// What the marks mean.
    pub legend: Vec<Legend>,
}

/// A quantity that every row has a cell of.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What it shows, with its unit.
    pub title: String,
    /// What its axis covers.
    pub range: Range,
    /// Share of the width that all panels have.
    pub share: f64,
    /// Room for words to the right of its bars, in figure units.
    pub words: f64,
    /// Lines across all rows.
    pub limits: Vec<f64>,
}

/// A row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BarRow {
    /// Its name.
    pub name: String,
    /// A few words below the name; may be empty.
    pub note: String,
    /// How its name is set.
    pub weight: RowWeight,
    /// A cell per panel.
    pub cells: Vec<Cell>,
}

/// How much a row matters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowWeight {
    /// As the others.
    #[default]
    Normal,
    /// It is what the figure is about.
    Strong,
    /// It was not measured.
    Faded,
}

/// What a row shows in a panel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// Bars from one value to another; the first lowest.
    pub bars: Vec<Bar>,
    /// An interval.
    pub whisker: Option<[f64; 2]>,
    /// Single values with the words that a pointer shows.
    pub dots: Vec<(f64, String)>,
    /// Words to the right.
    pub words: String,
}

/// A bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bar {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Its colour.
    pub ink: Ink,
    /// Whether it is a paler part of the same thing.
    pub pale: bool,
}

impl Bar {
    /// A bar of full colour.
    #[must_use]
    pub const fn new(from: f64, to: f64, ink: Ink) -> Self {
        Self { from, to, ink, pale: false }
    }

    /// The same bar, paler.
    #[must_use]
    pub const fn pale(self) -> Self {
        Self { pale: true, ..self }
    }

    fn class(self) -> String {
        format!("bar {}{}", self.ink.class(), if self.pale { " pale" } else { "" })
    }
}

impl Legend {
    /// For a bar.
    #[must_use]
    pub fn bar(label: &str, ink: Ink, pale: bool) -> Self {
        Self::class(label, &Bar { from: 0.0, to: 0.0, ink, pale }.class())
    }

    /// For a dot.
    #[must_use]
    pub fn dot(label: &str, ink: Ink) -> Self {
        Self::drawn(label, |canvas| draw_dot(canvas, [14.0, 6.0], ink, ""))
    }

    /// For an interval.
    #[must_use]
    pub fn whisker(label: &str) -> Self {
        Self::drawn(label, |canvas| draw_whisker(canvas, [5.0, 23.0], 6.0))
    }
}

const WIDTH: f64 = 760.0;
const TOP: f64 = 20.0;
const ROW: f64 = 30.0;
/// Room for the names of rows.
const NAMES: f64 = 168.0;
/// Between panels.
const GUTTER: f64 = 14.0;
/// Below the rows: ticks.
const BELOW: f64 = 20.0;
/// Half the height of a bar.
const HALF: f64 = 6.5;
/// Where the chain runs.
const CHAIN: f64 = 7.0;

impl Rows {
    /// Draws it.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let height = TOP + ROW * self.rows.len() as f64 + BELOW;
        let mut canvas = Canvas::default();
        let (id, title, description) = (&self.id, &self.title, &self.description);
        Frame { id, class: "rows", title, description, width: WIDTH, height }.open(&mut canvas);
        let columns = self.columns();
        for (panel, column) in self.panels.iter().zip(&columns) {
            self.draw_axis(&mut canvas, panel, column);
        }
        for (index, row) in self.rows.iter().enumerate() {
            self.draw_row(&mut canvas, index, row, &columns);
        }
        if self.chained {
            self.draw_chain(&mut canvas);
        }
        canvas.close("svg");
        Figure {
            id: self.id.clone(),
            title: self.title.clone(),
            caption: String::new(),
            svg: canvas.finish(),
            legend: self.legend.clone(),
            size: [WIDTH, height],
        }
    }

    /// Where each panel lies, and its scale.
    fn columns(&self) -> Vec<(Plot, Scale)> {
        let words: f64 = self.panels.iter().map(|panel| panel.words).sum();
        let gutters = GUTTER * self.panels.len() as f64;
        let shares: f64 = self.panels.iter().map(|panel| panel.share).sum();
        let room = (WIDTH - NAMES - words - gutters).max(60.0);
        let mut left = NAMES + self.indent();
        let height = ROW * self.rows.len() as f64;
        let place = |panel: &Panel| {
            let width = (room - self.indent()) * panel.share / shares.max(1e-9);
            let plot = Plot { left, top: TOP, width, height };
            left += width + panel.words + GUTTER;
            (plot, Scale::new(Ticks::Linear, panel.range, plot.left, plot.right()))
        };
        self.panels.iter().map(place).collect()
    }

    fn indent(&self) -> f64 {
        if self.chained { 2.0 * CHAIN } else { 0.0 }
    }

    fn draw_axis(&self, canvas: &mut Canvas, panel: &Panel, (plot, scale): &(Plot, Scale)) {
        let ground = canvas.element("rect").class("ground").at(plot.left, plot.top);
        ground.size(plot.width, plot.height).end();
        let ticks = scale.ticks((plot.width / 55.0) as usize + 1);
        canvas.group("grid");
        for tick in &ticks {
            vertical(canvas.element("line"), scale.at(tick.value), plot);
        }
        canvas.close("g");
        for limit in panel.limits.iter().filter(|limit| panel.range.holds(**limit)) {
            vertical(canvas.element("line").class("limit"), scale.at(*limit), plot);
        }
        canvas.group("labels");
        for tick in &ticks {
            let text = canvas.element("text").class("x");
            let text = text.at(scale.at(tick.value), plot.bottom() + 4.0);
            text.attribute("dy", ".8em").text(&tick.label);
        }
        canvas.element("text").at(plot.left, plot.top - 6.0).text(&panel.title);
        canvas.close("g");
    }

    fn draw_row(&self, canvas: &mut Canvas, index: usize, row: &BarRow, columns: &[(Plot, Scale)]) {
        let middle = TOP + ROW * (index as f64 + 0.5);
        let class = match row.weight {
            RowWeight::Normal => "row",
            RowWeight::Strong => "row strong",
            RowWeight::Faded => "row faded",
        };
        canvas.group(class);
        let name = canvas.element("text").class("row-name").at(self.indent(), middle);
        let lift = if row.note.is_empty() { ".35em" } else { "-.15em" };
        name.attribute("dy", lift).text(&row.name);
        if !row.note.is_empty() {
            let note = canvas.element("text").class("row-note").at(self.indent(), middle);
            note.attribute("dy", "1.05em").text(&row.note);
        }
        for (cell, (plot, scale)) in row.cells.iter().zip(columns) {
            draw_cell(canvas, cell, middle, plot, scale);
        }
        canvas.close("g");
    }

    fn draw_chain(&self, canvas: &mut Canvas) {
        let middle = |index: usize| TOP + ROW * (index as f64 + 0.5);
        for (index, row) in self.rows.iter().enumerate() {
            let ink = match row.weight {
                RowWeight::Strong => Ink::Vermilion,
                RowWeight::Normal => Ink::Text,
                RowWeight::Faded => Ink::Grey,
            };
            if index + 1 < self.rows.len() {
                let [from, to] = [middle(index) + 4.0, middle(index + 1) - 5.0];
                let x = 0.5 * CHAIN;
                let head = vec![[x - 2.5, to - 4.0], [x, to], [x + 2.5, to - 4.0]];
                let data = path_data(&[vec![[x, from], [x, to]], head]);
                canvas.element("path").class("chain").attribute("d", &data).end();
            }
            draw_dot(canvas, [0.5 * CHAIN, middle(index)], ink, "");
        }
    }
}

fn vertical(line: super::canvas::Element<'_>, x: f64, plot: &Plot) {
    line.number("x1", x).number("y1", plot.top).number("x2", x).number("y2", plot.bottom()).end();
}

fn draw_cell(canvas: &mut Canvas, cell: &Cell, middle: f64, plot: &Plot, scale: &Scale) {
    let place = |value: f64| {
        let at = scale.at(value);
        at.is_finite().then(|| at.clamp(plot.left, plot.right()))
    };
    for bar in &cell.bars {
        if let (Some(from), Some(to)) = (place(bar.from), place(bar.to)) {
            let rect = canvas.element("rect").class(&bar.class());
            rect.at(from.min(to), middle - HALF).size((to - from).abs(), 2.0 * HALF).end();
        }
    }
    let interval = cell.whisker.and_then(|[low, high]| Some([place(low)?, place(high)?]));
    if let Some(interval) = interval {
        draw_whisker(canvas, interval, middle);
    }
    for (value, words) in &cell.dots {
        if let Some(x) = place(*value) {
            draw_dot(canvas, [x, middle], dot_ink(*value), words);
        }
    }
    if !cell.words.is_empty() {
        let words = canvas.element("text").class("row-words").at(plot.right() + 5.0, middle);
        words.attribute("dy", ".35em").text(&cell.words);
    }
}

/// What speaks for a thing is green, what speaks against it is not.
fn dot_ink(value: f64) -> Ink {
    if value < 0.0 { Ink::Vermilion } else { Ink::Green }
}

fn draw_dot(canvas: &mut Canvas, [x, y]: [f64; 2], ink: Ink, words: &str) {
    let class = format!("dot {}", ink.class());
    let dot = canvas.element("circle").class(&class).number("cx", x).number("cy", y);
    let dot = dot.number("r", 3.0);
    if words.is_empty() {
        dot.end();
    } else {
        dot.open();
        canvas.element("title").text(words);
        canvas.close("circle");
    }
}

fn draw_whisker(canvas: &mut Canvas, [low, high]: [f64; 2], y: f64) {
    let lines = [
        vec![[low, y], [high, y]],
        vec![[low, y - 3.0], [low, y + 3.0]],
        vec![[high, y - 3.0], [high, y + 3.0]],
    ];
    canvas.element("path").class("whisker").attribute("d", &path_data(&lines)).end();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(cell: Cell) -> Rows {
        let panel = Panel {
            title: "gap".to_owned(),
            range: Range::new(0.0, 10.0),
            share: 1.0,
            words: 0.0,
            limits: vec![1.0],
        };
        let row = BarRow { name: "ground".to_owned(), cells: vec![cell], ..BarRow::default() };
        Rows { id: "a".to_owned(), panels: vec![panel], rows: vec![row], ..Rows::default() }
    }

    /// The attribute of the only element of that class.
    fn number(svg: &str, class: &str, name: &str) -> f64 {
        let element = svg.split(&format!("class=\"{class}\"")).nth(1).unwrap();
        let value = element.split(&format!(" {name}=\"")).nth(1).unwrap();
        value.split('"').next().unwrap().parse().unwrap()
    }

    #[test]
    fn a_bar_is_as_long_as_its_value_and_ends_at_the_edge() {
        let bar = |to: f64| Cell { bars: vec![Bar::new(0.0, to, Ink::Blue)], ..Cell::default() };
        let [two, four, far] =
            [2.0, 4.0, 99.0].map(|to| number(&rows(bar(to)).figure().svg, "bar blue", "width"));
        assert!((four - 2.0 * two).abs() < 0.02 && two > 0.0, "{two}, {four}");
        assert!((far - 5.0 * two).abs() < 0.05, "{far} is cut at the edge");
    }

    #[test]
    fn what_is_not_finite_is_not_drawn() {
        let cell = Cell {
            bars: vec![Bar::new(0.0, f64::NAN, Ink::Blue)],
            whisker: Some([1.0, f64::INFINITY]),
            dots: vec![(f64::NAN, String::new())],
            words: "not measured".to_owned(),
        };
        let svg = rows(cell).figure().svg;
        for absent in ["bar blue", "whisker", "dot", "NaN", "inf"] {
            assert!(!svg.contains(absent), "{absent} in {svg}");
        }
        assert!(svg.contains("not measured"));
    }

    #[test]
    fn panels_do_not_overlap() {
        let mut rows = rows(Cell::default());
        rows.panels.push(Panel { words: 80.0, share: 2.0, ..rows.panels[0].clone() });
        for chained in [false, true] {
            rows.chained = chained;
            let columns = rows.columns();
            let [(first, _), (second, _)] = &columns[..] else { panic!("two panels") };
            assert!(first.right() < second.left && second.right() + 80.0 <= WIDTH, "{columns:?}");
        }
    }
}
