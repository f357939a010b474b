//! Errors in files of labels.

use murmuration_swarm::{Invalid, Text, counted};
use std::path::PathBuf;

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LabelFileError {
    #[error("{}: {error}", path.display())]
    Unreadable { path: PathBuf, error: String },
    #[error("{}, line 1: {problem} column {column:?}; its columns are {columns}", path.display())]
    Column {
        path: PathBuf,
        column: String,
        /// The text `there is no` or `there is more than one`.
        problem: &'static str,
        columns: String,
    },
    #[error("{}, line {line}: the row has {cells}, the header {columns}", path.display())]
    Uneven {
        path: PathBuf,
        line: usize,
        cells: String,
        /// Number of columns in the header, in words.
        columns: String,
    },
    #[error("{}, line 1: the columns are separated by {separator}; save the file with commas", path.display())]
    Separator { path: PathBuf, separator: &'static str },
    #[error("{}, line {line}: a cell begins with a quote but does not end with one", path.display())]
    Quote { path: PathBuf, line: usize },
    #[error("{}, line {line}: {error}", path.display())]
    Cell {
        path: PathBuf,
        line: usize,
        /// The column, its value, and the allowed values.
        error: Invalid,
    },
    #[error("{}: no row has a class", .0.display())]
    NoClass(PathBuf),
    #[error(
        "{}: no row has a class by an annotator other than `synthetic`, which gave {}", path.display(), counted(*rows, "class")
    )]
    NoPerson {
        path: PathBuf,
        /// Number of rows with a class from the synthetic annotator.
        rows: u64,
    },
    // The image's name comes from a cell of the table, and may contain line ends.
    #[error("{}: {problem}", Text::line(&image.to_string_lossy()))]
    Image { image: PathBuf, problem: String },
}
