//! What is on disk: one SQLite database in a data directory, changed by whole transactions only.
//!
//! Limits: knows rows, not searches. Everything acknowledged to anybody has been committed with
//! `synchronous = FULL` first, so a `kill -9` at any instant loses nothing (invariant 4 of ARCHITECTURE.md).

mod archive;
mod campaigns;
mod checkpoints;
mod committee;
mod data_directory;
mod embeddings;
mod error;
mod inspection;
mod labels;
mod lessons;
mod open;
mod pictures;
mod provenance;
mod rounds;
mod salvage;
mod schema;
mod taken_back;

pub use archive::{ArchivedIndividual, GenerationRecord, StoredTaxonomy};
pub use campaigns::{CampaignRecord, Edition};
pub use checkpoints::CheckpointRecord;
pub use data_directory::{DataDirectory, Holder};
pub use embeddings::Switch;
pub use error::StoreError;
pub use labels::{LabelError, Undone};
pub use lessons::{FurtherStart, LessonPicture, LessonPictures};
pub use pictures::{Picture, SavedTraining};
pub use provenance::{Notice, Provenance, Suspects};
pub use rounds::TrainingPictures;
pub use salvage::Remains;

use rusqlite::{Connection, Transaction};
use std::{
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

/// The open store; clones share one connection.
#[derive(Debug, Clone)]
pub struct Store {
    /// One connection: SQLite has one writer, and every statement here is short.
    connection: Arc<Mutex<Connection>>,
    path: Arc<Path>,
    /// Whether the disk failed under a change, so that nobody knows how much of it is written. Set and read by whoever
    /// has the connection.
    in_doubt: Arc<AtomicBool>,
    /// What the label logs come to.
    followed: Arc<labels::Followed>,
}

impl Store {
    /// Name of the database in its data directory.
    pub const FILE: &str = "murmuration.sqlite";

    /// Opens or creates the database in `directory`, which must be held (see [`DataDirectory::hold`]), brings it to the
    /// newest schema, and checks its structure (of a database of more than a gigabyte `murmuration doctor` does that).
    ///
    /// # Errors
    /// Says what is wrong with the file: not a database, damaged, read-only, of a newer version, on a full disk.
    pub fn open(directory: &DataDirectory) -> Result<Self, StoreError> {
        let path = directory.path().join(Self::FILE);
        if !path.exists() {
            open::create(directory.path())?;
        }
        let connection = open::to_write(&path)?;
        Ok(Self::over(connection, &path))
    }

    /// Opens the database in `folder` to look at it, and says which version its schema is of; nothing can be changed through
    /// it, and nothing is checked. `alone` says that nobody writes it meanwhile (see [`DataDirectory::watch`]).
    ///
    /// # Errors
    /// As [`Store::open`], and [`StoreError::NoDirectory`].
    pub fn look(folder: &Path, alone: bool) -> Result<(Self, u32), StoreError> {
        let path = folder.join(Self::FILE);
        if !path.exists() {
            return Err(StoreError::NoDirectory(folder.to_path_buf()));
        }
        let (connection, version) = open::to_look(&path, alone)?;
        Ok((Self::over(connection, &path), version))
    }

    fn over(connection: Connection, path: &Path) -> Self {
        Self {
            connection: Arc::new(Mutex::new(connection)),
            path: path.into(),
            in_doubt: Arc::default(),
            followed: Arc::default(),
        }
    }

    /// Whether it can be read.
    ///
    /// # Errors
    /// Why it cannot.
    pub fn answers(&self) -> Result<(), StoreError> {
        self.read(|connection| {
            let tables = "SELECT count(*) FROM sqlite_schema";
            Ok(connection
                .query_row(tables, [], |row| row.get::<_, i64>(0))
                .map(drop)?)
        })
    }

    /// Runs `change` in a transaction that is committed, on disk, when this returns `Ok`.
    fn write<T>(
        &self,
        change: impl FnOnce(&Transaction<'_>) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let mut connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        if self.in_doubt.load(Ordering::Relaxed) {
            open::settle(&connection, &self.path)?;
            self.in_doubt.store(false, Ordering::Relaxed);
        }
        let changed = changed(&mut connection, change).map_err(|error| error.at(&self.path));
        if matches!(changed, Err(StoreError::Unwritable { .. })) {
            self.in_doubt.store(true, Ordering::Relaxed);
        }
        changed
    }

    fn read<T>(&self, query: impl FnOnce(&Connection) -> Result<T, StoreError>) -> Result<T, StoreError> {
        let connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        query(&connection).map_err(|error| error.at(&self.path))
    }
}

fn changed<T>(
    connection: &mut Connection,
    change: impl FnOnce(&Transaction<'_>) -> Result<T, StoreError>,
) -> Result<T, StoreError> {
    let transaction = connection.transaction()?;
    let value = change(&transaction)?;
    transaction.commit()?;
    Ok(value)
}

#[cfg(test)]
mod tests;
