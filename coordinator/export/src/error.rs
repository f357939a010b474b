//! Why the folder of an export cannot be written or read.

use arrow_schema::ArrowError;
use murmuration_store::transfer::Unsound;
use murmuration_swarm::Text;
use parquet::errors::ParquetError;
use std::{
    io,
    path::{Path, PathBuf},
};
use zip::result::ZipError;

/// Why no campaign was exported, or why a folder cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A file or folder cannot be used.
    #[error("cannot {doing} {path}: {source}")]
    File {
        /// The failed operation.
        doing: &'static str,
        /// The file or folder of the failed operation.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// The folder for the export is not empty.
    #[error("{0} is not empty: name a new folder, or replace an export with --force")]
    NotEmpty(PathBuf),
    /// The existing folder cannot be replaced, because it is not an unchanged export.
    #[error("{0} has other files or changed files, so that --force does not replace it: name a new folder")]
    NoExport(PathBuf),
    /// The export would replace the current folder of the process, or a folder above it.
    #[error("{0} is the working folder, or has it in it, and cannot be replaced: go to another folder first")]
    WorkingFolder(PathBuf),
    /// The former export has lost its name, but the new export did not get this name.
    #[error("cannot write {target}: {source}; the export that was there is in {old}")]
    Aside {
        /// The path of the former export.
        old: PathBuf,
        /// The name that the former export had.
        target: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// The folder, or a file in it, differs from what an export writes.
    #[error("{path}: {reason}")]
    Damaged {
        /// The folder or file.
        path: PathBuf,
        /// The fault.
        reason: String,
    },
    /// The coordinator sent no database of a campaign.
    #[error("the coordinator's answer is invalid: {0}")]
    Answer(#[from] Unsound),
}

impl ExportError {
    /// Makes the reason one line of plain text, because it can quote a file, which can contain anything.
    pub(crate) fn damaged(path: &Path, reason: impl ToString) -> Self {
        Self::Damaged {
            path: path.to_path_buf(),
            reason: Text::line(&reason.to_string()).into(),
        }
    }

    /// An error of the system about a file.
    pub(crate) fn file(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::File { doing, path, source }
    }

    /// Why a table cannot be written.
    pub(crate) fn unwritten(path: &Path) -> impl Fn(ParquetError) -> Self {
        let path = path.to_path_buf();
        move |error| Self::File {
            doing: "write",
            path: path.clone(),
            source: match error {
                // The message of the Parquet library would show the system's error as a Rust value.
                ParquetError::External(error) => match error.downcast::<io::Error>() {
                    Ok(error) => *error,
                    Err(error) => io::Error::other(error),
                },
                error => io::Error::other(error),
            },
        }
    }

    /// Why a table of columns cannot be made.
    pub(crate) fn uneven(path: &Path) -> impl Fn(ArrowError) -> Self {
        let path = path.to_path_buf();
        move |error| Self::damaged(&path, error)
    }

    /// Why an archive cannot be written.
    pub(crate) fn unzipped(path: &Path) -> impl Fn(ZipError) -> Self {
        let path = path.to_path_buf();
        move |error| Self::File {
            doing: "write",
            path: path.clone(),
            source: match error {
                ZipError::Io(error) => error,
                error => io::Error::other(error),
            },
        }
    }
}
