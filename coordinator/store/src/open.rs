//! Opens the database: creates it whole or not at all, checks it before use, and secures it after the disk failed.

use super::{
    FileSystem, Store, StoreError,
    files::{log_of, sync, with_suffix},
    find_database,
    lease::give_to_owner,
    schema,
    studies::take_over,
};
use rusqlite::{
    Connection, OpenFlags, Transaction,
    backup::{Backup, StepResult},
    config::DbConfig,
    ffi,
};
use std::{
    fs,
    io::{self, Read as _},
    os::unix::{ffi::OsStrExt as _, fs::OpenOptionsExt as _},
    path::Path,
    time::Duration,
};
use tempfile::TempPath;

/// Largest database, in bytes, whose structure is checked at every opening. The check takes half a second if the database is in
/// memory.
const CHECKED_BYTES: u64 = 1 << 30;
/// Longest wait of a change for another program that has locked the database.
const LOCK_LIMIT: Duration = Duration::from_millis(500);

/// Size of a log, in bytes, above which the store shortens the log. Overlapping readers can keep SQLite from restarting the log.
pub(super) const LONG_LOG: u64 = if cfg!(test) { 1 << 20 } else { 64 << 20 };

/// Makes an empty database of the newest schema in `folder`. The database gets its name only once it is on disk, so that an empty
/// file is never taken for a new database.
pub(super) fn create(folder: &Path) -> Result<(), StoreError> {
    let path = folder.join(format!("{}.new", Store::FILE));
    for begun in [path.clone(), with_suffix(&path, "-journal")] {
        match fs::remove_file(&begun) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                return Err(StoreError::from_io(error, "remove", &begun));
            }
            _ => {}
        }
    }
    let named = |source| StoreError::from_sqlite(source, &path);
    let mut connection = Connection::open(&path).map_err(named)?;
    schema::create(&mut connection).map_err(named)?;
    connection.close().map_err(|(_, source)| named(source))?;
    let placed = sync(&path)
        .and_then(|()| {
            // This never replaces a database that appeared after the check.
            let placed = TempPath::try_from_path(&path)?.persist_noclobber(folder.join(Store::FILE));
            placed.map_err(|refused| refused.error)
        })
        .and_then(|()| sync(folder));
    placed.map_err(|error| StoreError::from_io(error, "write", &path))
}

/// Opens a database that this process writes, or whose log it reads. On a shared file system, the index of the log is in this
/// process's own memory, so no other process can use the database at the same time.
fn connect(path: &Path, flags: OpenFlags, file_system: &FileSystem) -> Result<Connection, StoreError> {
    let flags = flags | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let opened = match file_system.is_local() {
        true => Connection::open_with_flags(path, flags),
        false => Connection::open_with_flags_and_vfs(path, flags, c"unix-excl"),
    };
    opened.map_err(|source| StoreError::from_sqlite(source, path))
}

/// Replaces the database and its log by copies of themselves, so that a process which still has the former files open cannot
/// change the new ones. The new files have `new` in their names until they take their places, which `check` must allow.
pub(super) fn renew(
    folder: &Path,
    new: &str,
    check: &dyn Fn() -> Result<(), StoreError>,
) -> Result<(), StoreError> {
    let database = folder.join(Store::FILE);
    if !find_database(&database)? {
        return Ok(());
    }
    // SQLite keeps the log beside the file itself.
    let failed = |error| StoreError::from_io(error, "find", &database);
    let database = database.canonicalize().map_err(failed)?;
    check()?;
    remove_abandoned(&database);
    for path in [log_of(&database), database.clone()] {
        let failed = |error| StoreError::from_io(error, "copy", &path);
        let mut former = match fs::File::open(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            former => former.map_err(failed)?,
        };
        let copy = with_suffix(&path, &format!("{RENEWED}{new}"));
        // The check must come after the copy is on disk, so no library that writes, syncs and renames in one step helps here.
        let created = fs::File::options()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&copy);
        let mut file = created.map_err(failed)?;
        let copied = copy_in_parts(&mut former, &mut file, check, failed).and_then(|()| {
            let kept = file
                .set_permissions(former.metadata().map_err(failed)?.permissions())
                .and_then(|()| give_to_owner(&copy, &path))
                .and_then(|()| file.sync_all());
            kept.map_err(failed)
        });
        let placed = copied
            .and_then(|()| check())
            .and_then(|()| fs::rename(&copy, &path).map_err(failed));
        if placed.is_err() {
            let _ = fs::remove_file(&copy);
        }
        placed?;
    }
    let folder = folder_of(&database);
    sync(folder).map_err(|error| StoreError::from_io(error, "write", folder))
}

/// Copies a file, whose copy can take minutes, with a check after each part.
fn copy_in_parts(
    from: &mut fs::File,
    to: &mut fs::File,
    check: &dyn Fn() -> Result<(), StoreError>,
    failed: impl Fn(io::Error) -> StoreError,
) -> Result<(), StoreError> {
    while io::copy(&mut from.take(PART_BYTES), to).map_err(&failed)? > 0 {
        check()?;
    }
    Ok(())
}

/// Bytes that are copied between two checks.
const PART_BYTES: u64 = 16 << 20;

/// Part of the names of copies before they take their places.
const RENEWED: &str = "-renewed-";

/// Removes copies that another process began. Ignores failures, because leftovers do no harm.
fn remove_abandoned(database: &Path) {
    let Some(name) = database.file_name().and_then(|name| name.to_str()) else {
        return;
    };
    let entries = fs::read_dir(folder_of(database)).into_iter().flatten().flatten();
    for entry in entries {
        let found = entry.file_name();
        let is_copy = found
            .to_str()
            .is_some_and(|found| found.starts_with(name) && found.contains(RENEWED));
        if is_copy {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// A writing connection to an existing database, which is checked and migrated to the newest schema. `is_held` fails if this process
/// may not change the database.
pub(super) fn to_write(
    path: &Path,
    file_system: &FileSystem,
    is_held: &dyn Fn() -> Result<(), StoreError>,
) -> Result<Connection, StoreError> {
    let named = |source| StoreError::from_sqlite(source, path);
    let mut connection = connect(path, OpenFlags::SQLITE_OPEN_READ_WRITE, file_system)?;
    // The last connection to close would write the log into the database, and remove the log by its path. A process that has taken
    // over, on any file system through which it reaches the directory, can be copying the one and have the other in use.
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)
        .map_err(named)?;
    // Nor may a commit write into the database before the lease is checked again. The store writes a long log into the database
    // itself.
    connection
        .pragma_update(None, "wal_autocheckpoint", 0)
        .map_err(named)?;
    let version = schema::version(&connection, path)?;
    check(&connection, path)?;
    is_held()?;
    connection
        .execute_batch(
            "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;
             PRAGMA busy_timeout = 5000;",
        )
        .and_then(|()| connection.pragma_update(None, "journal_size_limit", LONG_LOG.cast_signed()))
        .map_err(named)?;
    if version < schema::VERSION {
        let to = schema::VERSION;
        tracing::info!(from = version, to, "the database is converted to a newer schema");
    }
    schema::migrate(&mut connection, version).map_err(named)?;
    take_over(&mut connection, folder_of(path))?;
    if version < schema::VERSION {
        // The log of the conversion can be as long as the database. After this, the next change restarts it.
        shorten_log(&connection).map_err(named)?;
    }
    // Changes wait for one connection, one after the other.
    connection.busy_timeout(LOCK_LIMIT).map_err(named)?;
    Ok(connection)
}

/// A connection that reads a database which another connection of this process writes.
pub(super) fn to_read(path: &Path, file_system: &FileSystem) -> Result<Connection, StoreError> {
    match file_system.is_local() {
        // Such a connection never writes the log into the database, even as the last one to close.
        true => connect(path, OpenFlags::SQLITE_OPEN_READ_ONLY, file_system),
        false => to_read_alone(path, file_system),
    }
}

/// A connection that reads a database which no other process has open. It can read the log, which a connection that cannot write
/// can do only with shared memory.
fn to_read_alone(path: &Path, file_system: &FileSystem) -> Result<Connection, StoreError> {
    let named = |source| StoreError::from_sqlite(source, path);
    let connection = connect(path, OpenFlags::SQLITE_OPEN_READ_WRITE, file_system)?;
    connection
        .pragma_update(None, "query_only", true)
        .map_err(named)?;
    connection
        .set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, true)
        .map_err(named)?;
    Ok(connection)
}

/// A connection that changes nothing on disk, and the schema version of the database on disk. With `alone`, the caller guarantees
/// that no other process writes the database. If the database then has no log either, SQLite makes no files beside it.
pub(super) fn to_look(path: &Path, alone: bool) -> Result<(Connection, u32), StoreError> {
    let named = |source| StoreError::from_sqlite(source, path);
    let connection = unchanged(path, alone)?;
    let version = schema::version(&connection, path)?;
    if version == schema::VERSION {
        return Ok((connection, version));
    }
    // A database with an older schema is copied into memory, and the copy is migrated.
    let mut copy = Connection::open_in_memory().map_err(named)?;
    copy_whole(&connection, &mut copy).map_err(named)?;
    // The doctor reports references to rows that are not there.
    copy.pragma_update(None, "foreign_keys", false).map_err(named)?;
    schema::migrate(&mut copy, version).map_err(named)?;
    take_over(&mut copy, folder_of(path))?;
    Ok((copy, version))
}

/// Checks that this program can open a database, which no other process writes, and changes nothing. Returns the database's count
/// of [`changes`].
pub(super) fn expect_sound(path: &Path) -> Result<u32, StoreError> {
    let connection = unchanged(path, true)?;
    schema::version(&connection, path)?;
    check(&connection, path)?;
    changes(&connection).map_err(|source| StoreError::from_sqlite(source, path))
}

/// Number of changes that a database has had while it had a mirror, modulo 2^32. An older copy of the database has a smaller count.
/// The count is in the number that SQLite's header has for the application.
pub(super) fn changes(connection: &Connection) -> rusqlite::Result<u32> {
    let count: i32 = connection.pragma_query_value(None, "application_id", |row| row.get(0))?;
    Ok(count.cast_unsigned())
}

/// Counts one more of the [`changes`], and returns the new count.
pub(super) fn count_change(transaction: &Transaction<'_>) -> rusqlite::Result<u32> {
    let count = changes(transaction)?.wrapping_add(1);
    transaction.pragma_update(None, "application_id", count.cast_signed())?;
    Ok(count)
}

/// A connection to the database on disk that changes nothing. [`to_look`] explains `alone`.
fn unchanged(path: &Path, alone: bool) -> Result<Connection, StoreError> {
    let named = |source| StoreError::from_sqlite(source, path);
    let log = log_of(path);
    let log_bytes = match log.metadata() {
        Ok(log) => log.len(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => 0,
        Err(error) => return Err(StoreError::from_io(error, "read", &log)),
    };
    let unchanging = alone && log_bytes == 0;
    let file_system = FileSystem::of(path);
    let flags =
        OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
    if unchanging {
        let uri = format!("file:{}?immutable=1", uri_path(path));
        Connection::open_with_flags(uri, flags).map_err(named)
    } else if file_system.is_local() {
        Connection::open_with_flags(path, flags).map_err(named)
    } else if alone {
        to_read_alone(path, &file_system)
    } else {
        let path = folder_of(path).to_path_buf();
        Err(StoreError::Unshared { path, file_system })
    }
}

/// The data directory of a database.
fn folder_of(path: &Path) -> &Path {
    path.parent().unwrap_or(path)
}

/// Secures all committed changes after the disk failed during a change.
///
/// After a failed write, the content of the log beyond the last commit is unknown: the system may drop the write, and still
/// report success the next time. So this function writes all committed changes into the database, and empties the log, before the
/// store acknowledges anything else.
pub(super) fn settle(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    let busy: i64 = connection
        .query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |row| row.get(0))
        .map_err(|source| StoreError::from_sqlite(source, path))?;
    match busy {
        0 => Ok(()),
        _ => Err(StoreError::Unwritable {
            path: path.to_path_buf(),
            reason: "another process reads the database: its log cannot be emptied".to_owned(),
        }),
    }
}

/// Length of the database's log in bytes.
pub(super) fn log_len(path: &Path) -> u64 {
    let log = log_of(path);
    log.metadata().map_or(0, |log| log.len())
}

/// Writes the log into the database, as far as exports and other processes that read allow. Returns whether the whole log was
/// written, so that the next change restarts the log.
pub(super) fn shorten_log(connection: &Connection) -> rusqlite::Result<bool> {
    connection.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |row| {
        let (frames, written): (i64, i64) = (row.get(1)?, row.get(2)?);
        Ok(frames == written)
    })
}

/// Copies every page of a database as of one instant, even while other connections write.
pub(super) fn copy_whole(from: &Connection, to: &mut Connection) -> rusqlite::Result<()> {
    let backup = Backup::new(from, to)?;
    // One step copies all pages, so that the copy is one read transaction.
    match backup.step(-1)? {
        StepResult::Done => Ok(()),
        _ => Err(rusqlite::Error::SqliteFailure(
            ffi::Error::new(ffi::SQLITE_BUSY),
            Some("the database is being opened by another process, try again".to_owned()),
        )),
    }
}

pub(super) fn check(connection: &Connection, path: &Path) -> Result<(), StoreError> {
    if path.metadata().map_or(0, |file| file.len()) > CHECKED_BYTES {
        tracing::info!(path = %path.display(), "not checked at start, for its size: `murmuration doctor` does");
        return Ok(());
    }
    let message: String = connection
        .query_row("PRAGMA quick_check(1)", [], |row| row.get(0))
        .map_err(|source| StoreError::from_sqlite(source, path))?;
    match message.as_str() {
        "ok" => Ok(()),
        _ => Err(StoreError::Damaged {
            path: path.to_path_buf(),
            reason: message.replace('\n', " "),
        }),
    }
}

/// A path for a URI of SQLite: escapes the bytes `%`, `?` and `#`, and all bytes that are not ASCII, since a path need not be text.
pub(super) fn uri_path(path: &Path) -> String {
    let bytes = path.as_os_str().as_bytes().iter();
    let escaped = |&byte: &u8| match byte {
        b'%' | b'?' | b'#' | 128.. => format!("%{byte:02x}"),
        _ => char::from(byte).to_string(),
    };
    bytes.map(escaped).collect()
}
