//! Traces over a common axis.

use super::axes::Axes;
use super::band::curve;
use super::canvas::{Canvas, closed_path_data, path_data};
use super::figure::{Frame, Plot};
use super::{Band, Figure, Ink, Legend, Line, Range, Scale, Ticks, Tone};

/// A chart. Fill in what it needs, leave the rest to `..Chart::default()`.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Unique on the page; letters, digits and hyphens.
    pub id: String,
    /// A few words.
    pub title: String,
    /// The picture in a sentence, for those who cannot see it.
    pub description: String,
    /// What the horizontal axis shows, with its unit.
    pub x_title: String,
    /// What the vertical axis shows, with its unit.
    pub y_title: String,
    /// Kind of the horizontal axis.
    pub x_ticks: Ticks,
    /// Kind of the vertical axis.
    pub y_ticks: Ticks,
    /// What the horizontal axis covers; none: what the data covers.
    pub x_range: Option<Range>,
    /// What the vertical axis covers; none: what the data covers, and a little more.
    pub y_range: Option<Range>,
    /// The vertical axis covers at least so much: noise in a constant must not fill the chart.
    pub y_least: f64,
    /// Curves, the first lowest.
    pub traces: Vec<Trace>,
    /// Areas between curves, below all traces.
    pub bands: Vec<Band>,
    /// Bars as (from x, to x, height), standing on the lower edge.
    pub bars: Vec<[f64; 3]>,
    /// Shaded stretches of the horizontal axis.
    pub spans: Vec<Span>,
    /// Vertical lines.
    pub marks: Vec<Mark>,
    /// Horizontal lines of limits.
    pub limits: Vec<f64>,
    /// Points that no line joins, below all traces.
    pub clouds: Vec<Cloud>,
}

/// Points that no line joins.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// For the legend.
    pub label: String,
    /// Colour.
    pub ink: Ink,
    /// (x, y) in any order; what is not finite is left out.
    pub points: Vec<[f64; 2]>,
}

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// For the legend.
    pub label: String,
    /// Its look.
    pub line: Line,
    /// (x, y), x never decreasing; what is not finite leaves a hole.
    pub points: Vec<[f64; 2]>,
}

/// A shaded stretch.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Written into it where there is room.
    pub label: String,
    /// Its colour.
    pub tone: Tone,
}

/// A vertical line.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where.
    pub x: f64,
    /// Written beside it.
    pub label: String,
    /// Its colour.
    pub tone: Tone,
}

impl Default for Chart {
    fn default() -> Self {
        Self {
            id: String::new(),
            title: String::new(),
            description: String::new(),
            x_title: String::new(),
            y_title: String::new(),
            x_ticks: Ticks::Linear,
            y_ticks: Ticks::Linear,
            x_range: None,
            y_range: None,
            y_least: 0.0,
            traces: Vec::new(),
            bands: Vec::new(),
            bars: Vec::new(),
            spans: Vec::new(),
            marks: Vec::new(),
            limits: Vec::new(),
            clouds: Vec::new(),
        }
    }
}

const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 240.0;
const PLOT: Plot = Plot { left: 52.0, top: 18.0, width: 440.0, height: 186.0 };
/// About how wide a letter is, in figure units.
const LETTER: f64 = 6.2;
/// Points of the largest cloud drawn.
const DOTS: usize = 1500;

impl Chart {
    /// Draws it.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let mut canvas = Canvas::default();
        let (class, title) = ("chart", self.title.as_str());
        let (id, description) = (self.id.as_str(), self.description.as_str());
        Frame { id, class, title, description, width: WIDTH, height: HEIGHT }.open(&mut canvas);
        let x = self.x_scale();
        let y = self.y_scale(x.values());
        let axes = Axes {
            plot: PLOT,
            x: &x,
            y: &y,
            x_title: &self.x_title,
            y_title: &self.y_title,
            x_ticks: 8,
            y_ticks: 5,
        };
        axes.draw_grid(&mut canvas);
        self.draw_data(&mut canvas, &x, &y);
        axes.draw_labels(&mut canvas);
        canvas.close("svg");
        Figure {
            id: self.id.clone(),
            title: self.title.clone(),
            caption: String::new(),
            svg: canvas.finish(),
            legend: self.legend(),
            size: [WIDTH, HEIGHT],
        }
    }

    fn draw_data(&self, canvas: &mut Canvas, x: &Scale, y: &Scale) {
        PLOT.open_window(canvas);
        self.draw_spans(canvas, x);
        self.draw_bars(canvas, x, y);
        for band in &self.bands {
            let data = closed_path_data(&band.outlines(x, y));
            draw_path(canvas, &format!("band {}", band.ink.class()), &data);
        }
        self.draw_limits(canvas, y);
        self.draw_clouds(canvas, x, y);
        for trace in &self.traces {
            draw_path(canvas, &trace.line.class(), &path_data(&curve(&trace.points, x, y)));
        }
        self.draw_marks(canvas, x);
        canvas.close("svg");
        if self.xs().next().is_none() {
            PLOT.say_empty(canvas);
        }
    }

    fn draw_spans(&self, canvas: &mut Canvas, x: &Scale) {
        for span in &self.spans {
            let (from, to) = (x.at(span.from).max(PLOT.left), x.at(span.to).min(PLOT.right()));
            if !(from.is_finite() && to.is_finite() && from < to) {
                continue;
            }
            canvas.group(&format!("span {}", span.tone.class()));
            canvas.element("title").text(&span.label);
            canvas.element("rect").at(from, PLOT.top).size(to - from, PLOT.height).end();
            if span.label.chars().count() as f64 * LETTER + 6.0 < to - from {
                let (x, y) = (0.5 * (from + to), PLOT.top + 3.0);
                canvas.element("text").at(x, y).attribute("dy", ".9em").text(&span.label);
            }
            canvas.close("g");
        }
    }

    fn draw_bars(&self, canvas: &mut Canvas, x: &Scale, y: &Scale) {
        let corners = |[from, to, height]: [f64; 3]| {
            let (left, right, top) = (x.at(from), x.at(to), y.at(height).max(PLOT.top));
            let low = PLOT.bottom();
            vec![[left, low], [left, top], [right, top], [right, low]]
        };
        let bars: Vec<_> = self
            .bars
            .iter()
            .map(|bar| corners(*bar))
            .filter(|bar| bar.iter().flatten().all(|value| value.is_finite()))
            .collect();
        draw_path(canvas, "bars", &closed_path_data(&bars));
    }

    fn draw_limits(&self, canvas: &mut Canvas, y: &Scale) {
        for height in self.limits.iter().map(|limit| y.at(*limit)).filter(|y| y.is_finite()) {
            let line = canvas.element("line").class("limit").number("x1", PLOT.left);
            line.number("y1", height).number("x2", PLOT.right()).number("y2", height).end();
        }
    }

    /// A point is a line of no length with round ends: a cloud is one path.
    fn draw_clouds(&self, canvas: &mut Canvas, x: &Scale, y: &Scale) {
        for cloud in &self.clouds {
            let at = cloud.points.iter().map(|point| [x.at(point[0]), y.at(point[1])]);
            let seen = at.filter(|point| point.iter().all(|value| value.is_finite()));
            let points: Vec<_> = seen.map(|point| vec![point, point]).collect();
            // More than that and a reader sees a blot, whatever is drawn.
            let every = points.len().div_ceil(DOTS).max(1);
            let thinned: Vec<_> = points.into_iter().step_by(every).collect();
            let class = format!("cloud {}", cloud.ink.class());
            draw_path(canvas, &class, &path_data(&thinned));
        }
    }

    /// Labels of marks go to rows below one another, so that near marks stay readable.
    fn draw_marks(&self, canvas: &mut Canvas, x: &Scale) {
        for (index, mark) in self.marks.iter().enumerate() {
            let at = x.at(mark.x);
            if !at.is_finite() || !(PLOT.left..=PLOT.right()).contains(&at) {
                continue;
            }
            canvas.group(&format!("mark {}", mark.tone.class()));
            canvas.element("title").text(&mark.label);
            let line = canvas.element("line").number("x1", at).number("y1", PLOT.top);
            line.number("x2", at).number("y2", PLOT.bottom()).end();
            let fits_right = at + 130.0 < PLOT.right();
            let (side, shift) = if fits_right { ("after", 4.0) } else { ("before", -4.0) };
            let text = canvas.element("text").class(side).at(at + shift, PLOT.top + 3.0);
            text.attribute("dy", &format!("{:.1}em", 0.9 + 1.15 * (index % 6) as f64))
                .text(&mark.label);
            canvas.close("g");
        }
    }

    fn legend(&self) -> Vec<Legend> {
        let traces = self.traces.iter().map(|trace| Legend::line(&trace.label, trace.line));
        let bands = self
            .bands
            .iter()
            .map(|band| Legend::class(&band.label, &format!("band {}", band.ink.class())));
        let clouds = self.clouds.iter().map(|cloud| Legend::dot(&cloud.label, cloud.ink));
        let all = traces.chain(clouds).chain(bands);
        all.filter(|entry| !entry.label.is_empty()).collect()
    }

    fn xs(&self) -> impl Iterator<Item = f64> + '_ {
        let traces = self.traces.iter().flat_map(|trace| &trace.points);
        let bands = self.bands.iter().flat_map(|band| &band.points);
        let bars = self.bars.iter().flat_map(|bar| [bar[0], bar[1]]);
        let curves = traces.map(|point| point[0]).chain(bands.map(|point| point[0]));
        let clouds = self.clouds.iter().flat_map(|cloud| &cloud.points).map(|point| point[0]);
        curves.chain(bars).chain(clouds).filter(|x| x.is_finite())
    }

    /// Heights of everything that `x` shows.
    fn ys(&self, x: Range) -> impl Iterator<Item = f64> + '_ {
        let traces = self.traces.iter().flat_map(|trace| &trace.points);
        let traces = traces.filter(move |point| x.holds(point[0])).map(|point| point[1]);
        let bands = self.bands.iter().flat_map(|band| &band.points);
        let bands = bands.filter(move |point| x.holds(point[0]));
        let bands = bands.flat_map(|point| [point[1], point[2]]);
        let bars = self.bars.iter().map(|bar| bar[2]);
        let clouds = self.clouds.iter().flat_map(|cloud| &cloud.points);
        let clouds = clouds.filter(move |point| x.holds(point[0])).map(|point| point[1]);
        traces.chain(bands).chain(bars).chain(clouds).chain(self.limits.iter().copied())
    }

    fn x_scale(&self) -> Scale {
        let covered = self.x_range.or_else(|| Range::covering(self.xs()));
        let range = covered.unwrap_or(Range::new(0.0, 1.0));
        Scale::new(self.x_ticks, range, PLOT.left, PLOT.right())
    }

    fn y_scale(&self, x: Range) -> Scale {
        let range = self.y_range.unwrap_or_else(|| {
            let covered = Range::covering(self.ys(x)).unwrap_or(Range::new(0.0, 1.0));
            let covered = covered.at_least(self.y_least).padded(0.08);
            // Names of shaded stretches stand above the data.
            let names = if self.spans.is_empty() { 0.0 } else { 0.1 * covered.span() };
            Range::new(covered.low(), covered.high() + names)
        });
        Scale::new(self.y_ticks, range, PLOT.bottom(), PLOT.top)
    }
}

fn draw_path(canvas: &mut Canvas, class: &str, data: &str) {
    if !data.is_empty() {
        canvas.element("path").class(class).attribute("d", data).end();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<[f64; 2]>) -> Chart {
        let trace = Trace { label: "speed".to_owned(), line: Line::new(Ink::Blue), points };
        Chart { id: "a".to_owned(), traces: vec![trace], ..Chart::default() }
    }

    #[test]
    fn the_vertical_axis_covers_what_is_shown() {
        let chart = Chart {
            x_range: Some(Range::new(0.0, 1.0)),
            ..chart(vec![[0.0, -1.0], [1.0, 3.0], [2.0, 100.0]])
        };
        let shown = chart.y_scale(chart.x_scale().values()).values();
        assert!(shown.holds(-1.0) && shown.holds(3.0) && shown.high() < 5.0, "{shown:?}");
    }

    #[test]
    fn a_cloud_is_drawn_thin_and_counts_for_the_axes() {
        let points = (0..20_000).map(|i| [f64::from(i), f64::from(i % 7)]).collect();
        let cloud = Cloud { label: "before".to_owned(), ink: Ink::Orange, points };
        let chart = Chart { clouds: vec![cloud], ..chart(vec![[0.0, 0.0]]) };
        assert!(chart.x_scale().values().holds(19_999.0));
        let figure = chart.figure();
        let data = figure.svg.split("class=\"cloud orange\" d=\"").nth(1).unwrap();
        let dots = data.split('"').next().unwrap().matches('M').count();
        assert!((100..=DOTS).contains(&dots), "{dots}");
        assert_eq!(figure.legend.len(), 2);
    }

    #[test]
    fn a_constant_is_not_blown_up() {
        let chart = Chart { y_least: 4.0, ..chart(vec![[0.0, 1.0], [1.0, 1.0 + 1e-9]]) };
        assert!(chart.y_scale(chart.x_scale().values()).values().span() >= 4.0);
    }

    #[test]
    fn holes_break_the_line_and_marks_outside_are_left_out() {
        let hole = [f64::NAN, f64::NAN];
        let mut chart = chart(vec![[0.0, 0.0], [1.0, 1.0], hole, [2.0, 0.0], [3.0, 1.0]]);
        let mark = |x: f64| Mark { x, label: format!("mark at {x}"), tone: Tone::Bad };
        chart.marks = vec![mark(1.5), mark(9.0), mark(f64::NAN)];
        let figure = chart.figure();
        let line = figure.svg.split("class=\"line blue\" d=\"").nth(1).unwrap();
        let line = line.split('"').next().unwrap();
        assert_eq!(line.matches('M').count(), 2, "{line}");
        assert!(figure.svg.contains("mark at 1.5") && !figure.svg.contains("mark at 9"));
        assert_eq!(figure.legend.len(), 1);
    }
}
