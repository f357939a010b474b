//! Tables as commands print them: a line of headings, columns two spaces apart.

use comfy_table::CellAlignment;
use murmuration_link::{OutputError, outln};

/// A column: its heading, and the side on which its cells begin.
pub(super) struct Column {
    heading: String,
    side: CellAlignment,
}

/// A column of words.
pub(super) fn left(heading: impl Into<String>) -> Column {
    Column {
        heading: heading.into(),
        side: CellAlignment::Left,
    }
}

/// A column of numbers.
pub(super) fn right(heading: impl Into<String>) -> Column {
    Column {
        heading: heading.into(),
        side: CellAlignment::Right,
    }
}

/// A table, row by row.
pub(super) struct Table(comfy_table::Table);

impl Table {
    pub(super) fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        let columns: Vec<Column> = columns.into_iter().collect();
        let mut table = comfy_table::Table::new();
        table.load_style(comfy_table::presets::NOTHING);
        table.set_header(columns.iter().map(|column| &column.heading));
        for (place, column) in columns.iter().enumerate() {
            if let Some(shown) = table.column_mut(place) {
                shown.set_padding((0, 2));
                shown.set_cell_alignment(column.side);
            }
        }
        Self(table)
    }

    /// Adds a row, a cell a column.
    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.0.add_row(cells.into_iter().collect::<Vec<_>>());
    }

    /// Prints it to stdout.
    pub(super) fn print(&self) -> Result<(), OutputError> {
        self.0.lines().try_for_each(|line| outln!("{}", line.trim_end()))
    }
}
