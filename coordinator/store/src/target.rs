//! Folders that something of a data directory is copied into.

use super::files::{is_empty, without_links};
use std::{
    io,
    path::{Path, PathBuf},
};

/// Why nothing can be copied into a folder.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// Something is there already.
    #[error("{0} is not empty: name a folder that does not exist yet")]
    NotEmpty(PathBuf),
    /// What is in it would be lost with what it is a copy of.
    #[error(
        "{path} is in the data directory {data}: name a folder elsewhere, on another disk if there is one"
    )]
    Within {
        /// The folder that was named.
        path: PathBuf,
        /// The data directory.
        data: PathBuf,
    },
    /// It, or the data directory, cannot be looked into.
    #[error("cannot look into {path}: {source}")]
    Folder {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// `target` without links, if something of the data directory `data` can be copied into it.
pub(super) fn check_target(data: &Path, target: &Path) -> Result<PathBuf, TargetError> {
    check_empty(target)?;
    let whole = without_links(target).map_err(unknown(target))?;
    if whole.starts_with(without_links(data).map_err(unknown(data))?) {
        return Err(TargetError::Within {
            path: target.to_path_buf(),
            data: data.to_path_buf(),
        });
    }
    Ok(whole)
}

/// Whether a folder is empty, or not there.
pub(super) fn check_empty(folder: &Path) -> Result<(), TargetError> {
    match is_empty(folder).map_err(unknown(folder))? {
        true => Ok(()),
        false => Err(TargetError::NotEmpty(folder.to_path_buf())),
    }
}

fn unknown(path: &Path) -> impl FnOnce(io::Error) -> TargetError {
    let path = path.to_path_buf();
    move |source| TargetError::Folder { path, source }
}
