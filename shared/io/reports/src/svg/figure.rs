//! What every figure shares: its frame, its words for those who cannot see it, its legend.

use super::canvas::Canvas;
use super::{Area, Line};

/// A finished figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Unique on its page; letters, digits and hyphens.
    pub id: String,
    /// A few words.
    pub title: String,
    /// What to see in it; may be empty.
    pub caption: String,
    /// The drawing.
    pub svg: String,
    /// What its marks mean.
    pub legend: Vec<Legend>,
    /// Width and height of the drawing, in figure units.
    pub size: [f64; 2],
}

impl Figure {
    /// The figure with a caption.
    #[must_use]
    pub fn with_caption(self, caption: impl Into<String>) -> Self {
        Self { caption: caption.into(), ..self }
    }

    /// The drawing as a file of its own, carrying its style and its legend.
    #[must_use]
    pub fn standalone(&self) -> String {
        let [width, height] = self.size;
        let (legend, below) = self.drawn_legend();
        let view = |height: f64| format!("viewBox=\"0 0 {} {}\"", width.ceil(), height.ceil());
        let ground = format!(
            "<style>{}</style><rect width=\"100%\" height=\"100%\" fill=\"var(--paper)\"/><title",
            super::STYLE
        );
        let svg = self.svg.replacen(&view(height), &view(height + below), 1);
        let body = svg.replacen("<title", &ground, 1);
        format!("{}{legend}</svg>\n", body.strip_suffix("</svg>").unwrap_or(&body))
    }

    /// The legend in rows below the drawing, and how high they are.
    fn drawn_legend(&self) -> (String, f64) {
        let mut canvas = Canvas::default();
        let [mut x, mut y] = [MARGIN, self.size[1] + 12.0];
        for entry in &self.legend {
            let width = 34.0 + 5.2 * entry.label.chars().count() as f64 + 14.0;
            if x + width > self.size[0] && x > MARGIN {
                (x, y) = (MARGIN, y + 15.0);
            }
            let place = format!("translate({x:.1} {:.1})", y - 6.0);
            canvas.element("g").attribute("transform", &place).open();
            canvas.raw(&entry.swatch);
            canvas.close("g");
            let label = canvas.element("text").class("place-name").attribute("dy", ".35em");
            label.at(x + 33.0, y).attribute("style", "text-anchor:start").text(&entry.label);
            x += width;
        }
        (canvas.finish(), if self.legend.is_empty() { 0.0 } else { y + 12.0 - self.size[1] })
    }
}

/// Left edge of a drawn legend, in figure units.
const MARGIN: f64 = 12.0;

/// An entry of a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Legend {
    /// What the mark stands for.
    pub label: String,
    /// The mark: SVG elements within 28 by 12 units.
    pub swatch: String,
}

impl Legend {
    /// For a line.
    #[must_use]
    pub fn line(label: &str, line: Line) -> Self {
        Self::drawn(label, |canvas| {
            canvas.element("path").class(&line.class()).attribute("d", "M1 6H27").end();
        })
    }

    /// For an area.
    #[must_use]
    pub fn area(label: &str, area: Area) -> Self {
        Self::class(label, &area.class())
    }

    /// For a rectangle of a class of the style sheet.
    pub(crate) fn class(label: &str, class: &str) -> Self {
        Self::drawn(label, |canvas| {
            canvas.element("rect").class(class).at(4.0, 1.0).size(20.0, 10.0).end();
        })
    }

    /// For whatever `draw` draws into 28 by 12 units.
    pub(crate) fn drawn(label: &str, draw: impl FnOnce(&mut Canvas)) -> Self {
        let mut canvas = Canvas::default();
        draw(&mut canvas);
        Self { label: label.to_owned(), swatch: canvas.finish() }
    }
}

/// Who a drawing is and how large.
pub(crate) struct Frame<'a> {
    pub(crate) id: &'a str,
    pub(crate) class: &'a str,
    pub(crate) title: &'a str,
    pub(crate) description: &'a str,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Frame<'_> {
    /// Begins the drawing; close it with `canvas.close("svg")`.
    pub(crate) fn open(&self, canvas: &mut Canvas) {
        let (title, description) = (format!("{}-title", self.id), format!("{}-desc", self.id));
        canvas
            .element("svg")
            .attribute("xmlns", "http://www.w3.org/2000/svg")
            .class(self.class)
            .attribute("viewBox", &format!("0 0 {} {}", self.width.ceil(), self.height.ceil()))
            .attribute("role", "img")
            .attribute("aria-labelledby", &format!("{title} {description}"))
            .open();
        canvas.element("title").attribute("id", &title).text(self.title);
        canvas.element("desc").attribute("id", &description).text(self.description);
    }
}

/// The rectangle that data is drawn in, in figure units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plot {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Plot {
    pub(crate) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Begins a window onto this rectangle: what is drawn inside is cut at its edges. Close it with
    /// `canvas.close("svg")`.
    pub(crate) fn open_window(&self, canvas: &mut Canvas) {
        let view = format!("{} {} {} {}", self.left, self.top, self.width, self.height);
        let window = canvas.element("svg").class("window").at(self.left, self.top);
        window.size(self.width, self.height).attribute("viewBox", &view).open();
    }

    /// Says that there is nothing to see.
    pub(crate) fn say_empty(&self, canvas: &mut Canvas) {
        let (x, y) = (self.left + 0.5 * self.width, self.top + 0.5 * self.height);
        canvas.element("text").class("empty").at(x, y).text("no data");
    }
}
