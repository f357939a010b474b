//! Errors in files of labels.

use crate::csv_file::CsvError;
use murmuration_swarm::{Text, counted};
use std::path::PathBuf;

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LabelFileError {
    #[error(transparent)]
    Csv(#[from] CsvError),
    #[error(
        "{}, lines {} and {}: one annotator has two answers about {behaviour}, and no times tell which is newer", path.display(),
        lines[0], lines[1]
    )]
    Twice {
        path: PathBuf,
        lines: [u64; 2],
        /// The behaviour, as the file identifies it.
        behaviour: String,
    },
    #[error(
        "{}, line 1: the column \"id\" may have the numbers of another tool: nothing beside it shows that these are indices of \
         individuals (its columns are {columns}). --columns index=NAME names the column of the indices{}", path.display(),
        picture_column(*has_pictures)
    )]
    OnlyIds {
        path: PathBuf,
        columns: String,
        /// Whether the names of pictures in the column `image` end with numbers.
        has_pictures: bool,
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

fn picture_column(has_pictures: bool) -> &'static str {
    match has_pictures {
        true => "; --columns index=image takes the numbers at the ends of the pictures' names",
        false => "",
    }
}
