//! Axes: a grid, labels and units.

use super::canvas::Canvas;
use super::figure::Plot;
use super::scale::{Scale, Tick};

/// The pair of axes of a plot.
pub(crate) struct Axes<'a> {
    pub(crate) plot: Plot,
    pub(crate) x: &'a Scale,
    pub(crate) y: &'a Scale,
    pub(crate) x_title: &'a str,
    pub(crate) y_title: &'a str,
    pub(crate) x_ticks: usize,
    pub(crate) y_ticks: usize,
}

impl Axes<'_> {
    /// Draws the ground and the grid, below everything else.
    pub(crate) fn draw_grid(&self, canvas: &mut Canvas) {
        let Plot { left, top, width, height } = self.plot;
        canvas.element("rect").class("ground").at(left, top).size(width, height).end();
        canvas.group("grid");
        for tick in self.x.ticks(self.x_ticks) {
            let x = self.x.at(tick.value);
            grid_line(canvas, &tick, [x, top, x, self.plot.bottom()]);
        }
        for tick in self.y.ticks(self.y_ticks) {
            let y = self.y.at(tick.value);
            grid_line(canvas, &tick, [left, y, self.plot.right(), y]);
        }
        canvas.close("g");
    }

    /// Draws labels and titles, around the plot.
    pub(crate) fn draw_labels(&self, canvas: &mut Canvas) {
        canvas.group("labels");
        for tick in self.x.ticks(self.x_ticks).iter().filter(|tick| !tick.label.is_empty()) {
            let (x, y) = (self.x.at(tick.value), self.plot.bottom() + 4.0);
            canvas.element("text").class("x").at(x, y).attribute("dy", ".8em").text(&tick.label);
        }
        for tick in self.y.ticks(self.y_ticks).iter().filter(|tick| !tick.label.is_empty()) {
            let (x, y) = (self.plot.left - 5.0, self.y.at(tick.value));
            canvas.element("text").class("y").at(x, y).attribute("dy", ".32em").text(&tick.label);
        }
        self.draw_titles(canvas);
        canvas.close("g");
    }

    fn draw_titles(&self, canvas: &mut Canvas) {
        let (middle, bottom) = (self.plot.left + 0.5 * self.plot.width, self.plot.bottom() + 4.0);
        let title = canvas.element("text").class("x").at(middle, bottom);
        title.attribute("dy", "2.05em").text(self.x_title);
        canvas.element("text").at(self.plot.left, self.plot.top - 5.0).text(self.y_title);
    }
}

fn grid_line(canvas: &mut Canvas, tick: &Tick, [x1, y1, x2, y2]: [f64; 4]) {
    let line = canvas.element("line");
    let line = if tick.label.is_empty() { line.class("minor") } else { line };
    line.number("x1", x1).number("y1", y1).number("x2", x2).number("y2", y2).end();
}
