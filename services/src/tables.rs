//! Tables for people: one look, and no line longer than the terminal.

use comfy_table::presets::{UTF8_FULL_CONDENSED, UTF8_HORIZONTAL_ONLY};
use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, Table, TableStyle,
};

use crate::output::terminal_width;

/// Columns that a table of figures keeps to where no terminal says how many there are.
const WIDTH: u16 = 80;
/// A line above, below the header and below, none between rows.
const LINED: TableStyle = UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none());

/// A table with a frame, for names and what they are; cells break between words where the terminal is narrow.
#[must_use]
pub fn framed() -> Table {
    framed_within(terminal_width())
}

/// The same within `width` columns, where that is known.
#[must_use]
pub fn framed_within(width: Option<u16>) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    if let Some(width) = width {
        table.set_content_arrangement(ContentArrangement::Dynamic).set_width(width);
    }
    table
}

/// A table of many columns of figures under `header`; columns of numbers, by index, are aligned to the right.
#[must_use]
pub fn figures(header: &[&str], numbers: &[usize]) -> Table {
    let mut table = Table::new();
    table.load_style(LINED);
    table
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(terminal_width().unwrap_or(WIDTH).max(WIDTH))
        .set_header(header.to_vec());
    for index in numbers {
        if let Some(column) = table.column_mut(*index) {
            column.set_cell_alignment(CellAlignment::Right);
            // Words may break, numbers may not.
            column.set_constraint(ColumnConstraint::ContentWidth);
        }
    }
    table
}

/// The same with less room between columns, for as many as a terminal holds; names in the first column do not break.
#[must_use]
pub fn dense_figures(header: &[&str], numbers: &[usize]) -> Table {
    let mut table = figures(header, numbers);
    table.column_iter_mut().for_each(|column| {
        column.set_padding((0, 1));
    });
    if let Some(names) = table.column_mut(0) {
        names.set_constraint(ColumnConstraint::ContentWidth);
    }
    table
}
