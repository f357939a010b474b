//! The store: one SQLite database in a data directory, changed by whole transactions only.
//!
//! Limits: this crate reads and writes rows, and does not search. Every change is committed with `synchronous = FULL` before a
//! client gets the acknowledgement, so a `kill -9` at any instant loses nothing acknowledged (invariant 4 of ARCHITECTURE.md).

mod archive;
pub mod backup;
pub mod blocking;
mod campaigns;
mod checkpoint_rows;
pub mod checkpoints;
mod chunks;
mod data_directory;
mod deletion;
pub mod digest;
pub mod doctor;
mod embeddings;
mod epochs;
mod error;
mod file_system;
pub mod files;
mod hidden;
mod images;
mod individual;
mod inspection;
pub mod kept;
mod labels;
mod lease;
pub mod mirror;
mod notes;
mod numbers;
mod objects;
mod open;
mod pictures;
mod provenance;
mod readers;
mod repetition;
mod rollback;
mod round_pictures;
mod rounds;
mod runs;
mod scalars;
mod schema;
mod studies;
mod taxonomies;
pub mod transfer;

pub use archive::GenerationRecord;
pub use campaigns::Started;
pub use checkpoint_rows::CheckpointRecord;
pub use data_directory::{DataDirectory, remove_new};
pub use deletion::{Deletion, DeletionError};
pub use embeddings::Switch;
pub use epochs::EpochRecord;
pub use error::{LockHolder, StoreError, UnknownCampaign};
pub use file_system::FileSystem;
pub use images::StoredImage;
pub use individual::{ArchivedIndividual, Trial};
pub use labels::{LabelBudget, LabelError, OverBudget, Undone};
pub use notes::NotesError;
pub use pictures::Picture;
pub use provenance::{Notice, Provenance, Suspect, Suspects};
pub use round_pictures::{FurtherStart, RoundPicture, RoundPictures};
pub use runs::{Decision, DecisionError};
pub use studies::{StudyEntry, StudyVersion};
pub use taxonomies::{ClusterMeasures, StoredTaxonomy, TaxonomyVersion};

use crate::files::is_there;
use lease::Lease;
use mirror::{Claimed, Mirror, MirrorError};
use murmuration_model::RunId;
use murmuration_search::interrupt::Interrupted;
use readers::Readers;
use rusqlite::{Connection, Transaction, TransactionBehavior};
use std::{
    io,
    os::unix::fs::MetadataExt as _,
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

/// Shortest time between two attempts to write the log into the database because the disk is full.
const PAUSE_TO_FREE: Duration = Duration::from_secs(60);

/// The open store; clones share its connections.
#[derive(Debug, Clone)]
pub struct Store {
    /// Read-only connections, if the store can write.
    readers: Option<Arc<Readers>>,
    /// The writing connection (SQLite has one writer), or the only connection of a store without `readers`.
    connection: Arc<Mutex<Connection>>,
    path: Arc<Path>,
    /// The lease of the data directory, if the store can write.
    lease: Option<Arc<Lease>>,
    /// Inode of the database's file, if the store can write and the file system is local.
    inode: Option<u64>,
    /// The mirror to which the store sends its changes, if any.
    mirror: Option<Arc<Mirror>>,
    /// Whether the disk failed during a change, so that an unknown part of the change was written. Read and set this flag only
    /// while `connection` is locked.
    sync_failed: Arc<AtomicBool>,
    /// Whether the store accepts no more changes. Read and set this flag only while `connection` is locked.
    is_closed: Arc<AtomicBool>,
    /// Why the store takes no changes, if it is a copy of a database that cannot be written.
    reads_only: Option<Arc<str>>,
    /// When the log was last written into the database because the disk was full.
    freed: Arc<Mutex<Option<Instant>>>,
    /// Length of the log from which changes write the log into the database.
    long_log: Arc<AtomicU64>,
    /// Held while an export copies a campaign: the log cannot be restarted meanwhile.
    copying: Arc<tokio::sync::Mutex<()>>,
    /// Current labels of the campaigns.
    followed: Arc<labels::Followed>,
    /// The run that writes through this handle, if any. Each write first checks that this run is still current.
    run: Option<Arc<RunId>>,
}

impl Store {
    /// Name of the database in its data directory.
    pub const FILE: &str = "murmuration.sqlite";

    /// Opens or creates the database in `directory`, checks its structure, and migrates it to the newest schema. If the database
    /// is larger than a gigabyte, only `murmuration doctor` checks its structure.
    ///
    /// # Errors
    /// The error names the cause: the file is not a database, is damaged, is read-only or is of a newer version, the disk is full, or
    /// the directory has a mirror.
    pub fn open(directory: &DataDirectory) -> Result<Self, StoreError> {
        mirror::expect_none(directory.path())?;
        Self::opened(directory)
    }

    /// As [`Store::open`], for a directory whose mirror this process has taken: [`Store::mirrored`] must follow.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_claimed(directory: &DataDirectory, _claimed: &Claimed) -> Result<Self, StoreError> {
        Self::opened(directory)
    }

    /// As [`Store::open`], for a directory whose mirror will get a new snapshot before anything else.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_beside_mirror(directory: &DataDirectory) -> Result<Self, StoreError> {
        Self::opened(directory)
    }

    fn opened(directory: &DataDirectory) -> Result<Self, StoreError> {
        let path = directory.path().join(Self::FILE);
        if !find_database(&path)? {
            open::create(directory.path())?;
        }
        let lease = directory.lease();
        let connection = open::to_write(&path, directory.file_system(), &|| lease.check())?;
        let failed = |error| StoreError::from_io(error, "find the database", &path);
        let inode = path.metadata().map_err(failed)?.ino();
        let readers = Arc::new(Readers::open(&path, directory.file_system())?);
        let store = Self {
            readers: Some(readers),
            lease: Some(lease),
            // Elsewhere, numbers of files can change.
            inode: Some(inode).filter(|_| directory.file_system().is_local()),
            ..Self::over(connection, &path)
        };
        store.check_lease()?;
        transfer::remove_leftovers(&store, directory.path());
        Ok(store)
    }

    /// Sends the whole database to a mirror, and from now on every change of the returned store.
    ///
    /// # Errors
    /// If the mirror does not work, or another process has gone on from it.
    pub async fn mirrored(mut self, claimed: Claimed) -> Result<Self, MirrorError> {
        self.mirror = Some(mirror::start(claimed, &self).await?);
        mirror::note_snapshot(self.path.parent().unwrap_or(&self.path))?;
        Ok(self)
    }

    /// Waits until the mirror, if there is one, has all changes so far.
    ///
    /// # Errors
    /// If the mirror does not work, or another process has gone on from it.
    pub async fn reach_mirror(&self) -> Result<(), StoreError> {
        if self.mirror.is_none() {
            return Ok(());
        }
        self.change(|store| store.write(|_| Ok(()))).await
    }

    /// Returns, with the reason, when another process has gone on from the mirror: this process can change nothing then.
    pub async fn mirror_taken_over(&self) -> StoreError {
        match &self.mirror {
            Some(mirror) => mirror.taken_over().await,
            None => std::future::pending().await,
        }
    }

    /// Lets no change wait for the mirror any longer: the process ends.
    pub fn end_waits_for_mirror(&self) {
        if let Some(mirror) = &self.mirror {
            mirror.begin_to_end();
        }
    }

    /// Sends the last changes to the mirror, within some seconds.
    pub async fn finish_mirror(&self) {
        if let Some(mirror) = &self.mirror {
            mirror.finish().await;
        }
    }

    /// Opens the database in `folder` read-only and without checks, and returns the version of its schema. With `alone`, the
    /// caller guarantees that no process writes the database meanwhile (see [`DataDirectory::watch`]).
    ///
    /// # Errors
    /// The errors of [`Store::open`], and [`StoreError::NoDirectory`] if `folder` has no database.
    pub fn look(folder: &Path, alone: bool) -> Result<(Self, u32), StoreError> {
        let path = folder.join(Self::FILE);
        if !find_database(&path)? {
            return Err(StoreError::NoDirectory(folder.to_path_buf()));
        }
        let (connection, version) = open::to_look(&path, alone)?;
        Ok((Self::over(connection, &path), version))
    }

    fn over(connection: Connection, path: &Path) -> Self {
        Self {
            readers: None,
            lease: None,
            inode: None,
            mirror: None,
            connection: Arc::new(Mutex::new(connection)),
            path: path.into(),
            sync_failed: Arc::default(),
            is_closed: Arc::default(),
            reads_only: None,
            freed: Arc::default(),
            long_log: Arc::new(AtomicU64::new(open::LONG_LOG)),
            copying: Arc::default(),
            followed: Arc::default(),
            run: None,
        }
    }

    /// This store, which refuses all changes from now on for this reason.
    #[must_use]
    pub fn reading_only(self, reason: &str) -> Self {
        Self {
            reads_only: Some(reason.into()),
            ..self
        }
    }

    /// Runs `work` on this store, on a thread that may block (see [`blocking::blocking`]).
    ///
    /// # Errors
    /// The errors of `work`, and [`StoreError::Broken`] if `work` panics.
    pub async fn run<T, E>(&self, work: impl FnOnce(&Self) -> Result<T, E> + Send + 'static) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
    {
        let store = self.clone();
        let done = blocking::blocking(move || work(&store)).await;
        done.map_err(StoreError::from)?
    }

    /// Runs `work` like [`Store::run`], but with normal priority in every task (see [`blocking::changing`]).
    ///
    /// # Errors
    /// The errors of [`Store::run`].
    pub async fn change<T, E>(
        &self,
        work: impl FnOnce(&Self) -> Result<T, E> + Send + 'static,
    ) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
    {
        let store = self.clone();
        let done = blocking::changing(move || work(&store)).await;
        done.map_err(StoreError::from)?
    }

    /// Checks that the database can be read.
    ///
    /// # Errors
    /// The reason why the database cannot be read.
    pub fn answers(&self) -> Result<(), StoreError> {
        self.read(|connection| {
            let tables = "SELECT count(*) FROM sqlite_schema";
            Ok(connection
                .query_row(tables, [], |row| row.get::<_, i64>(0))
                .map(drop)?)
        })
    }

    /// Runs `change` in a transaction, which is committed and on disk, and in the mirror if there is one, when this function returns
    /// `Ok`. The handle of a run refuses changes once that run is over, and does not wait for the mirror.
    fn write<T>(
        &self,
        change: impl FnOnce(&Transaction<'_>) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let (value, committed) = self.commit(change)?;
        self.await_mirror(committed)?;
        Ok(value)
    }

    /// Runs `change` in a transaction, which is committed and on disk when this function returns `Ok`. It must not be acknowledged
    /// before [`Store::await_mirror`] has returned.
    fn commit<T>(
        &self,
        change: impl FnOnce(&Transaction<'_>) -> Result<T, StoreError>,
    ) -> Result<(T, Committed), StoreError> {
        let mut connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_closed.load(Ordering::Relaxed) {
            return Err(Interrupted.into());
        }
        if let Some(reason) = &self.reads_only {
            return Err(StoreError::ReadsOnly(reason.to_string()));
        }
        self.check_lease()?;
        if let Some(mirror) = &self.mirror {
            mirror.check(self.run.is_some())?;
        }
        if self.sync_failed.load(Ordering::Relaxed) {
            // An active reader would prevent SQLite from emptying the log.
            let _kept_away = self.readers.as_ref().map(|readers| readers.keep_away());
            self.settle(&connection)?;
            self.sync_failed.store(false, Ordering::Relaxed);
        }
        let changed = changed(&mut connection, self.mirror.is_some(), |transaction| {
            self.check_run(transaction)?;
            change(transaction)
        });
        let changed = changed.map_err(|error| error.at(&self.path));
        // A change that another process cannot know of must not be acknowledged.
        match &self.lease {
            Some(lease) if changed.is_ok() => lease.check_committed()?,
            _ => {}
        }
        if matches!(changed, Err(StoreError::Unwritable { .. })) {
            self.sync_failed.store(true, Ordering::Relaxed);
        }
        if matches!(changed, Err(StoreError::DiskFull { .. })) {
            self.free_log(&connection);
        }
        let (value, changes) = changed?;
        let committed = self.mirror.as_ref().map(|mirror| mirror.committed(changes));
        self.shorten_long_log(&connection);
        Ok((value, Committed(committed)))
    }

    /// Waits until the mirror has a change. A lock that others wait for must not be held meanwhile: the mirror may not work for hours.
    ///
    /// # Errors
    /// [`StoreError::MirrorTaken`], and [`StoreError::Unmirrored`] if the process ends.
    fn await_mirror(&self, committed: Committed) -> Result<(), StoreError> {
        match (&self.mirror, committed.0) {
            // A run that goes on elsewhere computes its changes again.
            (Some(mirror), Some(end)) if self.run.is_none() => mirror.wait(end?),
            _ => Ok(()),
        }
    }

    /// Refuses all changes from now on, after the current one has ended, and writes the log into the database. Another process can
    /// take the data directory as soon as it is given back, while threads of this process still have the store.
    pub fn close(&self) {
        self.end_waits_for_mirror();
        let connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        let was_closed = self.is_closed.swap(true, Ordering::Relaxed);
        if was_closed || self.check_lease().is_err() {
            return;
        }
        // Readers can keep a part of the log in use. The next process to open the database reads the log.
        if let Err(error) = self.settle(&connection) {
            tracing::debug!(%error, "the log of the database stays beside it");
        }
    }

    fn settle(&self, connection: &Connection) -> Result<(), StoreError> {
        if let Some(mirror) = &self.mirror {
            mirror.emptying();
        }
        let settled = open::settle(connection, &self.path);
        if let Some(mirror) = &self.mirror {
            mirror.emptied(settled.is_ok());
        }
        settled
    }

    /// Fails if another process has taken the data directory over, or the database is not the one that was opened.
    fn check_lease(&self) -> Result<(), StoreError> {
        let Some(lease) = &self.lease else {
            return Ok(());
        };
        lease.check()?;
        let Some(inode) = self.inode else {
            return Ok(());
        };
        match self.path.metadata() {
            Ok(file) if file.ino() == inode => Ok(()),
            // A disk that fails for a moment ends no campaign.
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(StoreError::Unwritable {
                path: self.path.to_path_buf(),
                reason: format!("the database cannot be found: {error}"),
            }),
            _ => Err(StoreError::Replaced(self.path.to_path_buf())),
        }
    }

    /// Writes a long log into the database. If an export keeps a part of the log in use, the next attempt is made when the log is
    /// longer by [`open::LONG_LOG`], because an attempt waits for all readers.
    fn shorten_long_log(&self, connection: &Connection) {
        let len = open::log_len(&self.path);
        if len <= self.long_log.load(Ordering::Relaxed) {
            return;
        }
        if self.mirror.as_ref().is_some_and(|mirror| !mirror.catches_up()) {
            tracing::warn!(
                bytes = len,
                "the log of the database grows, because the mirror does not have it yet"
            );
            self.long_log.store(len + open::LONG_LOG, Ordering::Relaxed);
            return;
        }
        let _kept_away = self.readers.as_ref().map(|readers| readers.keep_away());
        let until = match open::shorten_log(connection) {
            Ok(true) => {
                if let Some(mirror) = &self.mirror {
                    mirror.log_written();
                }
                open::LONG_LOG
            }
            Ok(false) => len + open::LONG_LOG,
            // The changes are on disk even if the log cannot be shortened.
            Err(error) => {
                tracing::warn!(%error, "the log of the database could not be written into it");
                // On a full disk, the log is whole, and commits can still use its free part.
                let is_full = matches!(
                    StoreError::from_sqlite(error, &self.path),
                    StoreError::DiskFull { .. }
                );
                if !is_full {
                    self.sync_failed.store(true, Ordering::Relaxed);
                }
                open::LONG_LOG.max(if is_full { len } else { 0 })
            }
        };
        self.long_log.store(until, Ordering::Relaxed);
    }

    /// Writes a long log into the database after the disk was full, at most once a minute: the log may be what fills the disk, if the
    /// mirror lacked it until now. Once it is in the database, it begins anew.
    fn free_log(&self, connection: &Connection) {
        let mut freed = self.freed.lock().unwrap_or_else(PoisonError::into_inner);
        if freed.is_some_and(|freed| freed.elapsed() < PAUSE_TO_FREE) {
            return;
        }
        if self.mirror.as_ref().is_some_and(|mirror| mirror.catches_up()) {
            *freed = Some(Instant::now());
            self.long_log.store(open::LONG_LOG, Ordering::Relaxed);
            self.shorten_long_log(connection);
        }
    }

    fn read<T>(&self, query: impl FnOnce(&Connection) -> Result<T, StoreError>) -> Result<T, StoreError> {
        self.read_in(blocking::is_in_background(), query)
    }

    /// Reads with a connection for threads of low priority if `background` is true, or else with a connection for other threads.
    /// The priority of the current thread does not matter.
    fn read_in<T>(
        &self,
        background: bool,
        query: impl FnOnce(&Connection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let read = match &self.readers {
            Some(readers) => readers.read(background, query),
            None => query(&self.connection.lock().unwrap_or_else(PoisonError::into_inner)),
        };
        read.map_err(|error| error.at(&self.path))
    }
}

/// A change that is committed, and may not be in the mirror yet.
#[must_use]
struct Committed(Option<Result<mirror::End, StoreError>>);

/// Whether anything exists at `path`; an error if the system cannot determine this.
fn find(path: &Path) -> Result<bool, StoreError> {
    is_there(path).map_err(|error| StoreError::from_io(error, "find", path))
}

/// Checks that the path of a data directory is a folder, or does not exist.
///
/// # Errors
/// [`StoreError::NoFolder`].
pub fn expect_folder(path: &Path) -> Result<(), StoreError> {
    match path.metadata() {
        Ok(found) if !found.is_dir() => Err(StoreError::NoFolder(path.to_path_buf())),
        _ => Ok(()),
    }
}

/// Whether a file exists at `path`, the path of a database; an error if the system cannot determine this, or if `path` is not a
/// regular file.
fn find_database(path: &Path) -> Result<bool, StoreError> {
    path.parent().map_or(Ok(()), expect_folder)?;
    let failed = |error| StoreError::from_io(error, "open the database", path);
    if !find(path)? {
        return Ok(false);
    }
    let found = path.metadata().map_err(failed)?;
    match found.is_file() {
        true => Ok(true),
        false if found.is_dir() => Err(failed(io::Error::other("it is a folder, and no file"))),
        false => Err(failed(io::Error::other("it is not a regular file"))),
    }
}

/// Runs `change` in a transaction, and commits it. If the database `is_mirrored` and `change` changes rows, returns the new count of
/// [`open::changes`].
fn changed<T>(
    connection: &mut Connection,
    is_mirrored: bool,
    change: impl FnOnce(&Transaction<'_>) -> Result<T, StoreError>,
) -> Result<(T, Option<u32>), StoreError> {
    let rows_before = connection.total_changes();
    // A transaction that reads first and writes later would fail at once if another process writes meanwhile.
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    let value = change(&transaction)?;
    let changes = match is_mirrored && transaction.total_changes() != rows_before {
        true => Some(open::count_change(&transaction)?),
        false => None,
    };
    transaction.commit()?;
    Ok((value, changes))
}

#[cfg(test)]
mod tests;
