//! Makes the database of a data directory from the mirror.

use super::{
    MirrorError,
    entries::{Entries, Snapshot, What, snapshot_begins},
};
use crate::{
    Store, StoreError,
    files::{log_of, sync},
    open::settle,
};
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

/// The log that a restore gives to SQLite.
struct Log {
    epoch: u64,
    bytes: u64,
    file: File,
}

/// Makes the database in `folder` as of entry `newest`. The database gets its name once it is complete and on disk.
pub(super) async fn restore(entries: &Entries, newest: u64, folder: &Path) -> Result<(), MirrorError> {
    let (begins, snapshot) = newest_snapshot(entries, newest).await?;
    remove_leftovers(folder);
    let arriving = tempfile::Builder::new().prefix(ARRIVING).tempdir_in(folder)?;
    let database = arriving.path().join(Store::FILE);
    entries.get_snapshot(&snapshot, &database).await?;
    let log_path = log_of(&database);
    let mut log: Option<Log> = None;
    let read = async |number| Ok::<_, MirrorError>((number, entries.read(number).await?));
    let mut read = pin!(stream::iter(begins..=newest).map(read).buffered(READ_AHEAD));
    while let Some((number, (entry, payload))) = read.try_next().await? {
        let What::Frames { from } = entry.what else {
            continue;
        };
        if entry.epoch < snapshot.epoch {
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
    let place = folder.join(Store::FILE);
    // SQLite would take the log of a database that is gone for that of the new one.
    match fs::remove_file(log_of(&place)) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error.into()),
        _ => {}
    }
    fs::rename(&database, place)?;
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

/// The newest snapshot, and the number of the first entry of its epoch. A snapshot without an entry is not complete.
async fn newest_snapshot(entries: &Entries, newest: u64) -> Result<(u64, Snapshot), MirrorError> {
    for listed in entries.snapshots().await? {
        let Some(begins) = snapshot_begins(&listed.name) else {
            continue;
        };
        for number in begins..=newest {
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

/// Lets SQLite write the log into the database, and removes the log.
async fn write_log(database: PathBuf) -> Result<(), MirrorError> {
    let write = move || -> Result<(), StoreError> {
        let named = |source| StoreError::from_sqlite(source, &database);
        let connection = Connection::open(&database).map_err(named)?;
        settle(&connection, &database)?;
        connection.close().map_err(|(_, source)| named(source))
    };
    let written = crate::blocking::changing(write).await.map_err(StoreError::from)?;
    Ok(written?)
}
