//! What can be wrong with files of labels.

use murmuration_proto::{Invalid, counted};
use std::path::PathBuf;

/// What is wrong with a file of labels.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LabelFileError {
    /// It cannot be read, or is not CSV.
    #[error("{}: {error}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: String,
    },
    /// A column that is needed is not there, or twice.
    #[error("{}, line 1: {problem} column {column:?}; its columns are {columns}", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column's name.
        column: String,
        /// `there is no` or `there is more than one`.
        problem: &'static str,
        /// The columns that there are.
        columns: String,
    },
    /// A row has too few or too many cells.
    #[error("{}, line {line}: the row has {cells}, the header {columns}", path.display())]
    Uneven {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// How many cells.
        cells: String,
        /// How many columns the header names.
        columns: String,
    },
    /// Something else than commas separates the columns.
    #[error("{}, line 1: the columns are separated by {separator}; save the file with commas", path.display())]
    Separator {
        /// The file.
        path: PathBuf,
        /// What separates them.
        separator: &'static str,
    },
    /// A quote is opened and not closed.
    #[error("{}, line {line}: a cell begins with a quote but does not end with one", path.display())]
    Quote {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
    },
    /// A cell cannot be used.
    #[error("{}, line {line}: {error}", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Its line, from 1.
        line: usize,
        /// Which column, what it holds, and what is allowed.
        error: Invalid,
    },
    /// No row has a class.
    #[error("{}: no row has a class", .0.display())]
    NoClass(PathBuf),
    /// No person gave a class.
    #[error(
        "{}: no row has a class that a person gave: the synthetic annotator gave {}", path.display(), counted(*rows, "class")
    )]
    NoPerson {
        /// The file.
        path: PathBuf,
        /// The rows in which the synthetic annotator gave a class.
        rows: u64,
    },
    /// The picture of a behaviour cannot be used.
    #[error("{}: {problem}", image.display())]
    Image {
        /// The picture's file.
        image: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}
