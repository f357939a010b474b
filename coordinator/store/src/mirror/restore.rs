//! Makes the database of a data directory from the mirror.

use super::{
    MirrorError,
    entries::{Entries, Entry, What, snapshot_begins},
};
use crate::{Store, StoreError, files::sync};
use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use rusqlite::Connection;
use std::{
    fs::{self, File},
    io::{self, Write as _},
    path::{Path, PathBuf},
    pin::pin,
};

/// Number of entries that are read at the same time.
const READ_AHEAD: usize = 8;
/// Beginning of the name of the folder in which a database is made.
const ARRIVING: &str = ".restored-";

/// The newest snapshot: everything after it is in the entries from `begins` on.
struct Base {
    begins: u64,
    epoch: u64,
    object: String,
    bytes: u64,
    digest: String,
}

/// The log that a restore gives to SQLite.
struct Log {
    epoch: u64,
    bytes: u64,
    file: File,
}

/// Makes the database in `folder` as of entry `newest`. The database gets its name once it is complete and on disk.
pub(super) async fn restore(entries: &Entries, newest: u64, folder: &Path) -> Result<(), MirrorError> {
    let base = base(entries, newest).await?;
    remove_leftovers(folder);
    let arriving = tempfile::Builder::new().prefix(ARRIVING).tempdir_in(folder)?;
    let database = arriving.path().join(Store::FILE);
    entries
        .get_snapshot(&base.object, (base.bytes, &base.digest), &database)
        .await?;
    let log_path = arriving.path().join(format!("{}-wal", Store::FILE));
    let mut log: Option<Log> = None;
    let read = async |number| Ok::<_, MirrorError>((number, entries.read(number).await?));
    let mut read = pin!(stream::iter(base.begins..=newest).map(read).buffered(READ_AHEAD));
    while let Some((number, (entry, payload))) = read.try_next().await? {
        let What::Frames { from } = entry.what else {
            continue;
        };
        if entry.epoch < base.epoch {
            continue;
        }
        if log.as_ref().is_none_or(|log| log.epoch != entry.epoch) {
            if log.take().is_some() {
                write_log(database.clone()).await?;
            }
            log = Some(Log {
                epoch: entry.epoch,
                bytes: 0,
                file: File::create(&log_path)?,
            });
        }
        let Some(log) = &mut log else { continue };
        if log.bytes != from {
            return Err(MirrorError::Damaged {
                object: entries.objects.to_string(),
                reason: format!("entry {number} does not follow the entry before it"),
            });
        }
        log.file.write_all(&payload)?;
        log.bytes += payload.len() as u64;
    }
    if log.is_some() {
        write_log(database.clone()).await?;
    }
    sync(&database)?;
    // Files of a database that is gone: SQLite would take them for those of the new one.
    for former in ["-wal", "-shm"].map(|suffix| folder.join(format!("{}{suffix}", Store::FILE))) {
        match fs::remove_file(&former) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
            _ => {}
        }
    }
    fs::rename(&database, folder.join(Store::FILE))?;
    Ok(sync(folder)?)
}

/// Removes what a restore left that was killed. Ignores failures, because leftovers do no harm.
fn remove_leftovers(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(ARRIVING) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

async fn base(entries: &Entries, newest: u64) -> Result<Base, MirrorError> {
    for listed in entries.snapshots().await? {
        let Some(begins) = snapshot_begins(&listed.name) else {
            continue;
        };
        for number in begins..=newest {
            let (entry, _) = entries.read(number).await?;
            if let Some(base) = base_of(entry, begins, &listed.name) {
                return Ok(base);
            }
        }
    }
    Err(MirrorError::Damaged {
        object: entries.objects.to_string(),
        reason: "it has no snapshot of the database".to_owned(),
    })
}

/// The base of a snapshot's entry, if it is about this object. A snapshot without an entry is not complete.
fn base_of(entry: Entry, begins: u64, name: &str) -> Option<Base> {
    let What::Snapshot { object, bytes } = entry.what else {
        return None;
    };
    (object == name).then_some(Base {
        begins,
        epoch: entry.epoch,
        object,
        bytes,
        digest: entry.digest,
    })
}

/// Lets SQLite write the log into the database, and removes the log.
async fn write_log(database: PathBuf) -> Result<(), MirrorError> {
    let write = move || -> Result<(), StoreError> {
        let named = |source| StoreError::from_sqlite(source, &database);
        let connection = Connection::open(&database).map_err(named)?;
        crate::open::settle(&connection, &database)?;
        connection.close().map_err(|(_, source)| named(source))
    };
    let written = crate::blocking::changing(write).await.map_err(StoreError::from)?;
    Ok(written?)
}
