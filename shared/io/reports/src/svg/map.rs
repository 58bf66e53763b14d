//! A view from above with equal scales on both axes.

use super::axes::Axes;
use super::band::{LIMIT, TOLERANCE};
use super::canvas::{Canvas, closed_path_data, path_data};
use super::decimate::{finite_pieces, simplify};
use super::figure::{Frame, Plot};
use super::{Area, Figure, Ink, Legend, Line, Range, Scale, Ticks};
use kerbside_geometry::{Pose, math};

/// A map. Things are drawn in the order in which they are added.
#[derive(Clone, Debug)]
pub struct Map {
    id: String,
    title: String,
    description: String,
    unit: &'static str,
    width: f64,
    tallest: f64,
    view: Option<[Range; 2]>,
    shapes: Vec<Shape>,
    legend: Vec<Legend>,
}

#[derive(Clone, Debug)]
enum Shape {
    Polygon { corners: Vec<[f64; 2]>, area: Area },
    Path { points: Vec<[f64; 2]>, line: Line },
    Label { at: [f64; 2], text: String },
    Number { at: [f64; 2], number: usize, ink: Ink },
    Arrow { at: Pose, ink: Ink },
    Cross { at: [f64; 2], ink: Ink },
}

impl Map {
    /// An empty map as wide as the page, its axes in metres. `id` is unique on the page.
    #[must_use]
    pub fn new(id: &str, title: &str, description: &str) -> Self {
        Self {
            id: id.to_owned(),
            title: title.to_owned(),
            description: description.to_owned(),
            unit: "m",
            width: 760.0,
            tallest: 620.0,
            view: None,
            shapes: Vec::new(),
            legend: Vec::new(),
        }
    }

    /// A map half as wide as the page and about square, its axes in `unit`.
    #[must_use]
    pub fn small(id: &str, title: &str, description: &str, unit: &'static str) -> Self {
        Self { unit, width: 400.0, tallest: 400.0, ..Self::new(id, title, description) }
    }

    /// Shows this part of the plane; without it, everything that was added.
    pub fn show(&mut self, x: Range, y: Range) {
        self.view = Some([x, y]);
    }

    /// Keeps the drawing within a height, in figure units of which the page is 760 wide.
    pub fn keep_within(&mut self, height: f64) {
        self.tallest = self.tallest.min(height);
    }

    /// An area within corners (x, y).
    pub fn polygon(&mut self, corners: &[[f64; 2]], area: Area) {
        self.shapes.push(Shape::Polygon { corners: corners.to_vec(), area });
    }

    /// A line through points (x, y); what is not finite leaves a hole.
    pub fn path(&mut self, points: Vec<[f64; 2]>, line: Line) {
        self.shapes.push(Shape::Path { points, line });
    }

    /// A word at a place.
    pub fn label(&mut self, at: [f64; 2], text: &str) {
        self.shapes.push(Shape::Label { at, text: text.to_owned() });
    }

    /// A number in a disc.
    pub fn number(&mut self, at: [f64; 2], number: usize, ink: Ink) {
        self.shapes.push(Shape::Number { at, number, ink });
    }

    /// An arrow head that points along the pose's heading.
    pub fn arrow(&mut self, at: Pose, ink: Ink) {
        self.shapes.push(Shape::Arrow { at, ink });
    }

    /// A cross at a place.
    pub fn cross(&mut self, at: [f64; 2], ink: Ink) {
        self.shapes.push(Shape::Cross { at, ink });
    }

    /// Adds an entry to the legend.
    pub fn explain(&mut self, entry: Legend) {
        self.legend.push(entry);
    }

    /// Draws it.
    #[must_use]
    pub fn figure(&self) -> Figure {
        let layout = self.layout();
        let mut canvas = Canvas::default();
        let class = if self.width < 500.0 { "map small" } else { "map" };
        let (id, title, description) = (&self.id, &self.title, &self.description);
        let (width, height) = (self.width, layout.plot.bottom() + MARGIN_BELOW);
        Frame { id, class, title, description, width, height }.open(&mut canvas);
        layout.draw(&mut canvas, &self.shapes, self.unit);
        canvas.close("svg");
        Figure {
            id: self.id.clone(),
            title: self.title.clone(),
            caption: String::new(),
            svg: canvas.finish(),
            legend: self.legend.clone(),
            size: [width, height],
        }
    }

    fn layout(&self) -> Layout {
        let [x, y] = self.view.unwrap_or_else(|| self.extent());
        // A point, a line, or a plane of no size still needs an area to be drawn in.
        let least = 1e-3 * x.span().max(y.span()).max(1e-3);
        let (x, y) = (x.at_least(least), y.at_least(least));
        let width = self.width - MARGIN_LEFT - MARGIN_RIGHT;
        let shortest = 0.3 * width;
        let scale = (width / x.span()).min(self.tallest / y.span());
        let height = (scale * y.span()).max(shortest);
        let plot = Plot { left: MARGIN_LEFT, top: MARGIN_TOP, width, height };
        let (x, y) = (x.at_least(width / scale), y.at_least(height / scale));
        Layout {
            plot,
            x: Scale::new(Ticks::Linear, x, plot.left, plot.right()),
            y: Scale::new(Ticks::Linear, y, plot.bottom(), plot.top),
        }
    }

    fn extent(&self) -> [Range; 2] {
        [0, 1].map(|axis| {
            let values = self.shapes.iter().flat_map(Shape::points).map(|point| point[axis]);
            Range::covering(values).unwrap_or(Range::new(0.0, 1.0)).padded(0.04)
        })
    }
}

impl Shape {
    fn points(&self) -> &[[f64; 2]] {
        match self {
            Self::Polygon { corners, .. } => corners,
            Self::Path { points, .. } => points,
            Self::Label { at, .. } | Self::Number { at, .. } | Self::Cross { at, .. } => {
                core::slice::from_ref(at)
            }
            Self::Arrow { .. } => &[],
        }
    }
}

const MARGIN_LEFT: f64 = 46.0;
const MARGIN_RIGHT: f64 = 8.0;
const MARGIN_TOP: f64 = 18.0;
const MARGIN_BELOW: f64 = 42.0;

struct Layout {
    plot: Plot,
    x: Scale,
    y: Scale,
}

impl Layout {
    fn draw(&self, canvas: &mut Canvas, shapes: &[Shape], unit: &str) {
        let axes = Axes {
            plot: self.plot,
            x: &self.x,
            y: &self.y,
            x_title: &format!("x [{unit}]"),
            y_title: &format!("y [{unit}]"),
            x_ticks: 10,
            y_ticks: (self.plot.height / 60.0) as usize + 1,
        };
        axes.draw_grid(canvas);
        self.plot.open_window(canvas);
        for shape in shapes {
            self.draw_shape(canvas, shape);
        }
        canvas.close("svg");
        if shapes.iter().flat_map(Shape::points).flatten().all(|value| !value.is_finite()) {
            self.plot.say_empty(canvas);
        }
        axes.draw_labels(canvas);
    }

    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.x.at(x), self.y.at(y)]
    }

    fn draw_shape(&self, canvas: &mut Canvas, shape: &Shape) {
        match shape {
            Shape::Polygon { corners, area } => self.draw_polygon(canvas, corners, *area),
            Shape::Path { points, line } => self.draw_path(canvas, points, *line),
            Shape::Label { at, text } => self.draw_label(canvas, *at, text),
            Shape::Number { at, number, ink } => self.draw_number(canvas, *at, *number, *ink),
            Shape::Arrow { at, ink } => self.draw_arrow(canvas, at, *ink),
            Shape::Cross { at, ink } => self.draw_cross(canvas, *at, *ink),
        }
    }

    fn draw_polygon(&self, canvas: &mut Canvas, corners: &[[f64; 2]], area: Area) {
        let outline: Vec<_> = corners.iter().map(|corner| self.at(*corner)).collect();
        if !outline.is_empty() && outline.iter().flatten().all(|value| value.is_finite()) {
            let data = closed_path_data(&[outline]);
            canvas.element("path").class(&area.class()).attribute("d", &data).end();
        }
    }

    fn draw_path(&self, canvas: &mut Canvas, points: &[[f64; 2]], line: Line) {
        let pieces: Vec<_> = finite_pieces(points.iter().map(|point| self.at(*point)))
            .iter()
            .map(|piece| simplify(piece, TOLERANCE, LIMIT))
            .collect();
        if !pieces.is_empty() {
            let data = path_data(&pieces);
            canvas.element("path").class(&line.class()).attribute("d", &data).end();
        }
    }

    fn draw_label(&self, canvas: &mut Canvas, at: [f64; 2], text: &str) {
        let [x, y] = self.at(at);
        if x.is_finite() && y.is_finite() {
            canvas.element("text").class("place-name").at(x, y).attribute("dy", ".32em").text(text);
        }
    }

    fn draw_number(&self, canvas: &mut Canvas, at: [f64; 2], number: usize, ink: Ink) {
        let [x, y] = self.at(at);
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        canvas.group(&format!("disc {}", ink.class()));
        canvas.element("circle").number("cx", x).number("cy", y).number("r", 7.0).end();
        let text = canvas.element("text").at(x, y).attribute("dy", ".35em");
        text.text(&number.to_string());
        canvas.close("g");
    }

    fn draw_arrow(&self, canvas: &mut Canvas, at: &Pose, ink: Ink) {
        let [x, y] = self.at([at.x, at.y]);
        let (sin, cos) = math::sin_cos(at.yaw);
        // The vertical axis of a figure points down.
        let corner = |along: f64, across: f64| {
            [x + cos * along - sin * across, y - sin * along - cos * across]
        };
        let outline =
            vec![corner(6.5, 0.0), corner(-4.0, 4.5), corner(-2.0, 0.0), corner(-4.0, -4.5)];
        if outline.iter().flatten().all(|value| value.is_finite()) {
            let data = closed_path_data(&[outline]);
            let class = format!("head {}", ink.class());
            canvas.element("path").class(&class).attribute("d", &data).end();
        }
    }

    fn draw_cross(&self, canvas: &mut Canvas, at: [f64; 2], ink: Ink) {
        let [x, y] = self.at(at);
        if x.is_finite() && y.is_finite() {
            let lines = [
                vec![[x - 5.0, y - 5.0], [x + 5.0, y + 5.0]],
                vec![[x - 5.0, y + 5.0], [x + 5.0, y - 5.0]],
            ];
            let class = Line::new(ink).class();
            canvas.element("path").class(&class).attribute("d", &path_data(&lines)).end();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_axes_have_the_same_scale() {
        for (x, y) in [(5.0, 1.0), (1.0, 50.0), (1e4, 1e4), (0.0, 3.0), (0.0, 0.0)] {
            let mut map = Map::new("map", "a", "b");
            map.show(Range::new(0.0, x), Range::new(0.0, y));
            let layout = map.layout();
            let [origin, across] = [layout.at([0.0, 0.0]), layout.at([0.1, 0.1])];
            let (dx, dy) = (across[0] - origin[0], origin[1] - across[1]);
            assert!(dx > 0.0 && (dx - dy).abs() < 1e-9 * dx, "{x} by {y}: {dx} and {dy}");
            assert!(layout.plot.height <= 620.0 + 1e-9);
        }
    }

    #[test]
    fn what_is_not_finite_is_not_drawn() {
        let mut map = Map::new("map", "a", "b");
        map.polygon(&[[0.0, 0.0], [f64::NAN, 1.0], [1.0, 1.0]], Area::Obstacle);
        map.path(vec![[f64::INFINITY, 0.0]], Line::new(Ink::Blue));
        map.number([f64::NAN, 0.0], 1, Ink::Blue);
        map.arrow(Pose::new(f64::NAN, 0.0, 0.0), Ink::Blue);
        let svg = map.figure().svg;
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(!svg.contains("obstacle"));
    }

    #[test]
    fn a_long_path_is_drawn_with_few_points() {
        let wave = |index: i32| f64::from(index) * 1e-3;
        let points = (0..200_000).map(|i| [wave(i), math::sin(wave(i))]).collect();
        let mut map = Map::new("map", "a", "b");
        map.path(points, Line::new(Ink::Blue));
        assert!(map.figure().svg.len() < 60_000, "{}", map.figure().svg.len());
    }
}
