//! Errors in files of labels.

use murmuration_proto::{Invalid, Text, counted};
use std::path::PathBuf;

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LabelFileError {
    #[error("{}: {error}", path.display())]
    Unreadable { path: PathBuf, error: String },
    #[error("{}, line 1: {problem} column {column:?}; its columns are {columns}", path.display())]
    Column {
        path: PathBuf,
        column: String,
        /// `there is no` or `there is more than one`.
        problem: &'static str,
        columns: String,
    },
    #[error("{}, line {line}: the row has {cells}, the header {columns}", path.display())]
    Uneven {
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        cells: String,
        /// How many columns the header names.
        columns: String,
    },
    #[error("{}, line 1: the columns are separated by {separator}; save the file with commas", path.display())]
    Separator { path: PathBuf, separator: &'static str },
    #[error("{}, line {line}: a cell begins with a quote but does not end with one", path.display())]
    Quote {
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
    },
    #[error("{}, line {line}: {error}", path.display())]
    Cell {
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// Which column, what it holds, and what is allowed.
        error: Invalid,
    },
    #[error("{}: no row has a class", .0.display())]
    NoClass(PathBuf),
    #[error(
        "{}: no row has a class by an annotator other than `synthetic`, which gave {}", path.display(), counted(*rows, "class")
    )]
    NoPerson {
        path: PathBuf,
        /// The rows in which the synthetic annotator gave a class.
        rows: u64,
    },
    // Its name is a cell of the table, in which there may be line ends.
    #[error("{}: {problem}", Text::line(&image.to_string_lossy()))]
    Image { image: PathBuf, problem: String },
}
