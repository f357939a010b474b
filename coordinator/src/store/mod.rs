//! What is on disk: one SQLite database in a data directory, changed by whole transactions only.
//!
//! Limits: knows rows, not searches. Everything acknowledged to anybody has been committed with
//! `synchronous = FULL` first, so a `kill -9` at any instant loses nothing (invariant 4 of ARCHITECTURE.md).

mod archive;
mod campaigns;
mod checkpoints;
mod data_directory;
mod embeddings;
mod error;
mod labels;
mod pictures;
mod provenance;
mod rounds;
mod schema;

pub use archive::{ArchivedIndividual, GenerationRecord, StoredTaxonomy};
pub use campaigns::CampaignRecord;
pub use checkpoints::CheckpointRecord;
pub use data_directory::{DataDirectory, Holder};
pub use embeddings::Switch;
pub use error::StoreError;
pub use labels::LabelError;
pub use pictures::{Picture, SavedTraining};
pub use provenance::{Notice, Provenance};
pub use rounds::TrainingPictures;

use rusqlite::{Connection, Transaction};
use std::{
    path::Path,
    sync::{Arc, Mutex, PoisonError},
};

/// The open store; clones share one connection.
#[derive(Debug, Clone)]
pub struct Store {
    /// One connection: SQLite has one writer, and every statement here is short.
    connection: Arc<Mutex<Connection>>,
    path: Arc<Path>,
}

impl Store {
    /// Name of the database in its data directory.
    pub const FILE: &str = "murmuration.sqlite";

    /// Opens or creates the database in `directory`, which must be held (see [`DataDirectory::hold`]).
    ///
    /// # Errors
    /// Says what is wrong with the file: not a database, damaged, read-only, of a newer version, on a full disk.
    pub fn open(directory: &DataDirectory) -> Result<Self, StoreError> {
        let path = directory.path().join(Self::FILE);
        let named = |source| StoreError::from_sqlite(source, &path);
        let mut connection = Connection::open(&path).map_err(named)?;
        let version = schema::version(&connection, &path)?;
        connection
            .execute_batch(
                "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;
                 PRAGMA busy_timeout = 5000;",
            )
            .map_err(named)?;
        schema::migrate(&mut connection, version).map_err(named)?;
        Ok(Self {
            connection: Arc::new(Mutex::new(connection)),
            path: path.into(),
        })
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
        let transaction = connection
            .transaction()
            .map_err(|source| StoreError::from_sqlite(source, &self.path))?;
        let value = change(&transaction).map_err(|error| error.at(&self.path))?;
        transaction
            .commit()
            .map_err(|source| StoreError::from_sqlite(source, &self.path))?;
        Ok(value)
    }

    fn read<T>(&self, query: impl FnOnce(&Connection) -> Result<T, StoreError>) -> Result<T, StoreError> {
        let connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        query(&connection).map_err(|error| error.at(&self.path))
    }
}

#[cfg(test)]
mod tests;
