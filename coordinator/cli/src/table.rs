//! Tables that commands print: a line of headings, columns two spaces apart.

use comfy_table::CellAlignment;
use murmuration_link::{OutputError, outln};

/// A column: its heading, and the alignment of its cells.
pub struct Column {
    heading: String,
    side: CellAlignment,
}

pub fn left(heading: impl Into<String>) -> Column {
    Column {
        heading: heading.into(),
        side: CellAlignment::Left,
    }
}

pub fn right(heading: impl Into<String>) -> Column {
    Column {
        heading: heading.into(),
        side: CellAlignment::Right,
    }
}

pub struct Table(comfy_table::Table);

impl Table {
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
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

    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.0.add_row(cells.into_iter().collect::<Vec<_>>());
    }

    pub fn print(&self) -> Result<(), OutputError> {
        self.0.lines().try_for_each(|line| outln!("{}", line.trim_end()))
    }
}
