//! Makes the database of a data directory from the mirror.

use super::{
    CLAIM_WITH_DATA, MirrorError,
    entries::{Entries, Listed, Snapshot, What, snapshot_begins},
};
use crate::{
    Store, StoreError,
    files::{log_of, sync},
    open::{self, settle, shorten_log},
    schema,
};
use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use rusqlite::{Connection, config::DbConfig};
use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, Write as _},
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
    pin::pin,
};
use tempfile::TempDir;

/// Number of entries that are read at the same time.
const READ_AHEAD: usize = 8;
/// Beginning of the name of the folder in which a database is made.
const ARRIVING: &str = ".restored-";

/// The log that a restore gives to SQLite.
struct Log {
    epoch: u64,
    bytes: u64,
    file: File,
}

/// A database that is made from the mirror, in a folder of its own within the data directory.
pub(super) struct Restore {
    arriving: TempDir,
    /// The epoch of the snapshot from which the database is made.
    epoch: u64,
    log: Option<Log>,
    /// Number of the last entry that the database has.
    last: u64,
}

impl Restore {
    /// Begins a database in `folder`, with the entries `all`.
    pub(super) async fn begin(
        entries: &Entries,
        all: &BTreeMap<u64, Listed>,
        folder: &Path,
    ) -> Result<Self, MirrorError> {
        let (begins, snapshot) = newest_snapshot(entries, all).await?;
        remove_leftovers(folder);
        let arriving = tempfile::Builder::new().prefix(ARRIVING).tempdir_in(folder)?;
        let mut restore = Self {
            arriving,
            epoch: snapshot.epoch,
            log: None,
            last: begins.saturating_sub(1),
        };
        entries.get_snapshot(&snapshot, &restore.database()).await?;
        let newest = all.keys().next_back().copied().unwrap_or_default();
        restore.add(entries, newest).await?;
        Ok(restore)
    }

    fn database(&self) -> PathBuf {
        self.arriving.path().join(Store::FILE)
    }

    /// Size of the database once its log is written into it. The database must be checked already.
    pub(super) async fn bytes(&self) -> Result<u64, MirrorError> {
        let database = self.database();
        let measure = move || -> Result<u64, StoreError> {
            let named = |source| StoreError::from_sqlite(source, &database);
            let connection = Connection::open(&database).map_err(named)?;
            // The log stays, so that further entries can follow.
            let stays = DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE;
            connection.set_db_config(stays, true).map_err(named)?;
            let figure = |name: &str| connection.pragma_query_value(None, name, |row| row.get::<_, i64>(0));
            let pages = figure("page_count").map_err(named)?;
            let size = figure("page_size").map_err(named)?;
            connection.close().map_err(|(_, source)| named(source))?;
            Ok(pages.unsigned_abs().saturating_mul(size.unsigned_abs()))
        };
        let measured = crate::blocking::changing(measure)
            .await
            .map_err(StoreError::from)?;
        Ok(measured?)
    }

    /// Adds the entries up to `newest`. Returns whether they follow: after another snapshot, the database must be made from it.
    pub(super) async fn extend(&mut self, entries: &Entries, newest: u64) -> Result<bool, MirrorError> {
        Ok(!self.add(entries, newest).await?)
    }

    /// Adds the entries up to `newest`. Returns whether there is a snapshot among them.
    async fn add(&mut self, entries: &Entries, newest: u64) -> Result<bool, MirrorError> {
        let read = async |number| Ok::<_, MirrorError>((number, entries.read(number).await?));
        let mut read = pin!(
            stream::iter(self.last + 1..=newest)
                .map(read)
                .buffered(READ_AHEAD)
        );
        let mut has_snapshot = false;
        while let Some((number, (entry, payload))) = read.try_next().await? {
            match entry.what {
                What::Frames { from } if entry.epoch >= self.epoch => {
                    let follows = self.add_frames(entry.epoch, from, &payload).await?;
                    if !follows {
                        return Err(MirrorError::Damaged {
                            object: entries.objects.to_string(),
                            reason: format!("entry {number} does not follow the entry before it"),
                        });
                    }
                }
                What::Snapshot(_) => has_snapshot = true,
                What::Frames { .. } | What::Claim => {}
            }
            self.last = number;
        }
        Ok(has_snapshot)
    }

    /// Adds bytes to the log of an epoch. Returns whether they follow the bytes before.
    async fn add_frames(&mut self, epoch: u64, from: u64, frames: &[u8]) -> Result<bool, MirrorError> {
        if self.log.as_ref().is_none_or(|log| log.epoch != epoch) {
            self.write_log().await?;
            let file = File::create(log_of(&self.database()))?;
            self.log = Some(Log {
                epoch,
                bytes: 0,
                file,
            });
        }
        let Some(log) = self.log.as_mut().filter(|log| log.bytes == from) else {
            return Ok(false);
        };
        log.file.write_all(frames)?;
        log.bytes += frames.len() as u64;
        Ok(true)
    }

    /// Lets SQLite write the log into the database, and removes the log.
    async fn write_log(&mut self) -> Result<(), MirrorError> {
        if self.log.take().is_none() {
            return Ok(());
        }
        let database = self.database();
        let write = move || -> Result<(), StoreError> {
            let named = |source| StoreError::from_sqlite(source, &database);
            let connection = Connection::open(&database).map_err(named)?;
            settle(&connection, &database)?;
            connection.close().map_err(|(_, source)| named(source))
        };
        let written = crate::blocking::changing(write).await.map_err(StoreError::from)?;
        Ok(written?)
    }

    /// Checks that the database is whole, that this program can read it, and that the disk has room for it.
    pub(super) async fn check(&self) -> Result<(), MirrorError> {
        let database = self.database();
        let check = move || -> Result<(), StoreError> {
            let named = |source| StoreError::from_sqlite(source, &database);
            let connection = Connection::open(&database).map_err(named)?;
            // The log stays, so that further entries can follow.
            let stays = DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE;
            connection.set_db_config(stays, true).map_err(named)?;
            schema::version(&connection, &database)?;
            open::check(&connection, &database)?;
            shorten_log(&connection).map_err(named)?;
            connection.close().map_err(|(_, source)| named(source))
        };
        let checked = crate::blocking::changing(check).await.map_err(StoreError::from)?;
        Ok(checked?)
    }

    /// Keeps a damaged database in `folder`, for `murmuration doctor` and tools of SQLite, and returns its path.
    pub(super) fn keep(self, folder: &Path) -> io::Result<PathBuf> {
        let arrived = self
            .arriving
            .path()
            .file_name()
            .unwrap_or_default()
            .to_string_lossy();
        let place = folder.join(format!("damaged-{}", arrived.trim_start_matches(ARRIVING)));
        fs::rename(self.arriving.keep(), &place)?;
        Ok(place.join(Store::FILE))
    }

    /// Completes the database, has `note` write down its inode, and gives it its place in `folder`.
    pub(super) async fn finish(
        mut self,
        folder: &Path,
        note: impl FnOnce(u64) -> Result<(), MirrorError>,
    ) -> Result<(), MirrorError> {
        self.write_log().await?;
        let database = self.database();
        sync(&database)?;
        let place = folder.join(Store::FILE);
        // SQLite would take the log of a database that is gone for that of the new one.
        match fs::remove_file(log_of(&place)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
        note(database.metadata()?.ino())?;
        fs::rename(&database, place)?;
        Ok(sync(folder)?)
    }
}

/// Removes what a restore left that was killed. Ignores failures, because leftovers do no harm.
fn remove_leftovers(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(ARRIVING) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// The newest snapshot, and the number of the first entry of its epoch. A snapshot without an entry is not complete.
async fn newest_snapshot(
    entries: &Entries,
    all: &BTreeMap<u64, Listed>,
) -> Result<(u64, Snapshot), MirrorError> {
    for listed in entries.snapshots().await? {
        let Some(begins) = snapshot_begins(&listed.name) else {
            continue;
        };
        let short = all.range(begins..).filter(|(_, entry)| entry.is_short());
        for (&number, _) in short {
            match entries.read(number).await?.0.what {
                What::Snapshot(snapshot) if snapshot.object == listed.name => return Ok((begins, snapshot)),
                _ => {}
            }
        }
    }
    Err(MirrorError::Damaged {
        object: entries.objects.to_string(),
        reason: "it has no snapshot of the database".to_owned(),
    })
}

/// Whether a mirror has data, or a process has claimed it that has data and has not written a snapshot yet.
pub(super) async fn has_data(entries: &Entries, all: &BTreeMap<u64, Listed>) -> Result<bool, MirrorError> {
    for (&number, listed) in all.iter().rev() {
        if !listed.is_short() {
            return Ok(true);
        }
        match entries.read(number).await? {
            (entry, payload) if entry.what == What::Claim && payload != CLAIM_WITH_DATA => {}
            _ => return Ok(true),
        }
    }
    Ok(false)
}
