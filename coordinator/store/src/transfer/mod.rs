//! Transfer of whole campaigns: exports a campaign from a store into a database of its own, and imports such a database into
//! another store.
//!
//! Limits: the pictures of a dataset, snapshots of trainings, epochs, notices, provenance and former taxonomies are not
//! transferred. The pictures can be simulated again, and the other data is about the exporting store only.

mod arriving;
mod exporting;
mod received;
mod takeover;
mod untrusted;

pub use arriving::{Arriving, ImportError};
pub use exporting::export;
pub use received::{Member, ReceivedCampaign};
pub use untrusted::Unsound;

use crate::{Store, StoreError};
use std::{fs, path::Path};
use tempfile::TempDir;

/// Prefix of the temporary folders in a data directory in which campaigns' databases are written.
const PREFIX: &str = ".transfer-";

/// SQLite's application id of a campaign's database: "Murm".
const APPLICATION: i32 = 0x4d75_726d;

/// The tables that a campaign's database has besides the tables of a store: one for the bytes of its checkpoints, one for the
/// digest of its archive, as `murmuration digest` prints it.
const FURTHER_TABLES: &str = "
    CREATE TABLE embedders (
        checkpoint INTEGER PRIMARY KEY REFERENCES checkpoints (number),
        model BLOB NOT NULL
    ) STRICT;
    CREATE TABLE exported (
        digest TEXT NOT NULL
    ) STRICT;
";

/// Removes the folders and rows that unfinished exports, imports and deletions have left in a held data directory. Leftovers that
/// cannot be removed stay until the store is next opened.
pub(crate) fn remove_leftovers(store: &Store, data: &Path) {
    let folders = fs::read_dir(data).into_iter().flatten().flatten();
    for folder in folders.filter(|folder| folder.file_name().to_string_lossy().starts_with(PREFIX)) {
        if let Err(error) = fs::remove_dir_all(folder.path()) {
            tracing::warn!(path = %folder.path().display(), %error, "the folder of an export or import is not removed");
        }
    }
    if let Err(error) = store.remove_all_hidden() {
        tracing::warn!(%error, "remains of imports and deletions could not be removed from the database");
    }
}

fn new_folder(data: &Path) -> Result<TempDir, StoreError> {
    let made = tempfile::Builder::new().prefix(PREFIX).tempdir_in(data);
    made.map_err(|error| StoreError::from_io(error, "make a folder in", data))
}

#[cfg(test)]
mod tests;
