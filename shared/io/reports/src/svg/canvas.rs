//! Writing SVG elements.

use core::fmt::Write as _;

/// SVG text in the making.
#[derive(Default)]
pub(crate) struct Canvas {
    text: String,
}

impl Canvas {
    /// Begins an element; it must be finished by one of [`Element`]'s three ends.
    pub(crate) fn element(&mut self, tag: &'static str) -> Element<'_> {
        self.text.push('<');
        self.text.push_str(tag);
        Element { canvas: self, tag }
    }

    /// Closes an element that was left open.
    pub(crate) fn close(&mut self, tag: &'static str) {
        self.text.push_str("</");
        self.text.push_str(tag);
        self.text.push('>');
    }

    /// Appends elements written before.
    pub(crate) fn raw(&mut self, elements: &str) {
        self.text.push_str(elements);
    }

    /// Begins a group of a class.
    pub(crate) fn group(&mut self, class: &str) {
        self.element("g").class(class).open();
    }

    /// All that was written.
    pub(crate) fn finish(self) -> String {
        self.text
    }
}

/// An element whose attributes are being written.
#[must_use = "an element needs an end"]
pub(crate) struct Element<'a> {
    canvas: &'a mut Canvas,
    tag: &'static str,
}

impl Element<'_> {
    /// An attribute with a text, escaped.
    pub(crate) fn attribute(self, name: &str, value: &str) -> Self {
        let text = &mut self.canvas.text;
        text.push(' ');
        text.push_str(name);
        text.push_str("=\"");
        escape_into(text, value);
        text.push('"');
        self
    }

    /// The class.
    pub(crate) fn class(self, value: &str) -> Self {
        self.attribute("class", value)
    }

    /// A number in figure units.
    pub(crate) fn number(self, name: &str, value: f64) -> Self {
        let mut digits = String::new();
        coordinate_into(&mut digits, value);
        self.attribute(name, &digits)
    }

    /// x and y.
    pub(crate) fn at(self, x: f64, y: f64) -> Self {
        self.number("x", x).number("y", y)
    }

    /// Width and height.
    pub(crate) fn size(self, width: f64, height: f64) -> Self {
        self.number("width", width).number("height", height)
    }

    /// Ends an element without content.
    pub(crate) fn end(self) {
        self.canvas.text.push_str("/>");
    }

    /// Ends an element with a text, escaped.
    pub(crate) fn text(self, content: &str) {
        self.canvas.text.push('>');
        escape_into(&mut self.canvas.text, content);
        self.canvas.close(self.tag);
    }

    /// Leaves the element open for others to follow inside.
    pub(crate) fn open(self) {
        self.canvas.text.push('>');
    }
}

/// Appends `value` with at most two decimals: a hundredth of a unit is finer than any screen shows.
pub(crate) fn coordinate_into(text: &mut String, value: f64) {
    let hundredths = (value * 100.0).round();
    if !hundredths.is_finite() || hundredths == 0.0 {
        text.push('0');
        return;
    }
    let start = text.len();
    // Writing into a String cannot fail.
    let _ = write!(text, "{:.2}", hundredths / 100.0);
    while text.len() > start && text.ends_with('0') {
        text.pop();
    }
    if text.ends_with('.') {
        text.pop();
    }
}

/// Path data of open lines through `points`, a line each, in figure units.
pub(crate) fn path_data(lines: &[Vec<[f64; 2]>]) -> String {
    let mut data = String::new();
    for line in lines {
        append_line(&mut data, line);
    }
    data
}

/// Path data of closed outlines.
pub(crate) fn closed_path_data(outlines: &[Vec<[f64; 2]>]) -> String {
    let mut data = String::new();
    for outline in outlines {
        append_line(&mut data, outline);
        data.push('Z');
    }
    data
}

fn append_line(data: &mut String, line: &[[f64; 2]]) {
    for (index, [x, y]) in line.iter().enumerate() {
        data.push(if index == 0 { 'M' } else { 'L' });
        coordinate_into(data, *x);
        data.push(' ');
        coordinate_into(data, *y);
    }
}

fn escape_into(text: &mut String, content: &str) {
    for letter in content.chars() {
        match letter {
            '&' => text.push_str("&#38;"),
            '<' => text.push_str("&#60;"),
            '>' => text.push_str("&#62;"),
            '"' => text.push_str("&#34;"),
            '\'' => text.push_str("&#39;"),
            other => text.push(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_never_a_word() {
        let show = |value| {
            let mut text = "10".to_owned();
            coordinate_into(&mut text, value);
            text.split_off(2)
        };
        assert_eq!(show(12.0), "12");
        assert_eq!(show(100.0), "100");
        assert_eq!(show(-0.001), "0");
        assert_eq!(show(1.256), "1.26");
        assert_eq!(show(f64::NAN), "0");
        assert_eq!(show(f64::NEG_INFINITY), "0");
    }

    #[test]
    fn text_cannot_leave_its_element() {
        let mut canvas = Canvas::default();
        canvas.element("text").class("a\" onload='x").text("</text><script>&");
        let text = canvas.finish();
        assert_eq!(
            text,
            "<text class=\"a&#34; onload=&#39;x\">&#60;/text&#62;&#60;script&#62;&#38;</text>"
        );
    }
}
