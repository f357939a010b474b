//! Opens a file that claims to be the database of a campaign, so that nothing in it can do harm.
//!
//! SQLite reads the file as it is on disk, without a log beside it, and runs no code of the file's schema. That schema must equal
//! an export's schema to the letter. Limits: this module checks tables and lengths of values, not the meaning of values.

use super::{APPLICATION, FURTHER_TABLES};
use crate::{Store, StoreError, numbers::clamped, open::uri_path, schema};
use murmuration_model::{Note, Tag, Tags};
use murmuration_onnx::MAX_MODEL_BYTES;
use murmuration_swarm::{Invalid, Text};
use rusqlite::{Connection, ErrorCode, OpenFlags, config::DbConfig, limits::Limit};
use std::{
    fs::{self, File},
    io::Read as _,
    path::Path,
};

/// Maximum number of bytes of a value, and so of the memory that SQLite takes for a value.
const MAX_VALUE_BYTES: i32 = 128 << 20;

/// Maximum number of bytes of a value while the schema is read.
const MAX_SCHEMA_BYTES: i32 = 64 << 10;

/// Maximum number of steps of SQLite's virtual machine in one statement while the schema is read; an export's schema takes a few
/// hundred.
const MAX_SCHEMA_STEPS: i32 = 20_000;

/// Maximum number of bytes of a campaign's tags, with spaces between them, and of its note. A character has up to 4 bytes.
const MAX_NOTES_BYTES: usize = 4 * (Tags::MOST * (Tag::MOST + 1) + Note::MOST);

/// Tables that may have rows in the database of a campaign; all other tables must be empty.
const FILLED: [&str; 10] = [
    "campaigns",
    "checkpoints",
    "embedders",
    "embedding_chunks",
    "exported",
    "generations",
    "image_chunks",
    "individual_chunks",
    "labels",
    "taxonomies",
];

/// Errors in the database of a campaign.
#[derive(Debug, thiserror::Error)]
pub enum Unsound {
    /// A value that no campaign can have.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// The database cannot be read.
    #[error("{}", Text::line(&.0.reason()))]
    Unreadable(#[from] StoreError),
    /// The database differs from the databases that `murmuration export` writes.
    #[error("{0}")]
    Foreign(String),
    /// The archive does not have the digest that the file names.
    #[error(
        "its archive has digest {found}, and was exported with {wanted}: it was changed after the export"
    )]
    Digest {
        /// The digest that the file names.
        wanted: String,
        /// The digest of the archive in the file.
        found: String,
    },
}

impl From<rusqlite::Error> for Unsound {
    fn from(error: rusqlite::Error) -> Self {
        StoreError::from(error).into()
    }
}

pub(super) fn foreign(what: impl Into<String>) -> Unsound {
    Unsound::Foreign(what.into())
}

/// Opens the file to read it, and checks its structure, its schema and which tables have rows.
pub(super) fn open(path: &Path) -> Result<Store, Unsound> {
    check_header(path)?;
    let flags =
        OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX | OpenFlags::SQLITE_OPEN_URI;
    let mut connection = Connection::open_with_flags(format!("file:{}?immutable=1", uri_path(path)), flags)?;
    for (setting, is_on) in [
        (DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true),
        (DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false),
    ] {
        connection.set_db_config(setting, is_on)?;
    }
    connection.execute_batch("PRAGMA cell_size_check = ON; PRAGMA mmap_size = 0;")?;
    read_schema(&mut connection)?;
    check_length(&connection, path)?;
    check_schema(&connection)?;
    let store = Store::over(connection, path);
    // The search for faults also checks that every value has the type of its column, and that indices match their tables.
    let mut faults = store.faults()?;
    faults.extend(store.dangling()?);
    if let Some(first) = faults.first() {
        return Err(foreign(first.as_str()));
    }
    check_rows(&store)?;
    Ok(store)
}

/// Makes SQLite read the whole schema within limits, because SQLite's time for this is quadratic in the number of entries.
/// Afterwards, sets the limits for values.
pub(super) fn read_schema(connection: &mut Connection) -> Result<(), Unsound> {
    connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_SCHEMA_BYTES)?;
    connection.progress_handler(MAX_SCHEMA_STEPS, Some(|| true))?;
    let read = connection.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()));
    match read.as_ref().map_err(rusqlite::Error::sqlite_error_code) {
        Err(Some(ErrorCode::TooBig | ErrorCode::OperationInterrupted)) => return Err(foreign(OTHER_SCHEMA)),
        _ => read?,
    }
    connection.progress_handler(0, None::<fn() -> bool>)?;
    connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES)?;
    Ok(())
}

/// Checks that `path` is a regular file that begins like an SQLite database which does not use a write-ahead log.
fn check_header(path: &Path) -> Result<(), Unsound> {
    let failed = |error| StoreError::from_io(error, "read", path);
    if !fs::symlink_metadata(path).map_err(failed)?.is_file() {
        return Err(foreign("it is not a regular file"));
    }
    let mut header = Vec::new();
    let file = File::open(path).map_err(failed)?;
    file.take(20).read_to_end(&mut header).map_err(failed)?;
    match header.strip_prefix(b"SQLite format 3\0") {
        Some([_, _, 1, 1]) => Ok(()),
        Some([_, _, 2, 2]) => Err(foreign(
            "it was opened for writing after the export (it is in SQLite's mode WAL)",
        )),
        _ => Err(foreign("it is not a SQLite database, or it is encrypted")),
    }
}

/// Checks that the file ends where its database ends.
fn check_length(connection: &Connection, path: &Path) -> Result<(), Unsound> {
    let length = "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size";
    let length: i64 = connection.query_row(length, [], |row| row.get(0))?;
    let failed = |error| StoreError::from_io(error, "read", path);
    let found = path.metadata().map_err(failed)?.len();
    match length.unsigned_abs() == found {
        true => Ok(()),
        false => Err(foreign(format!(
            "it has {found} bytes, and its database {length}"
        ))),
    }
}

/// Checks that the database has exactly the tables, indices and triggers of a campaign's database of this version.
fn check_schema(connection: &Connection) -> Result<(), Unsound> {
    let number = |pragma| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    if number("application_id")? != i64::from(APPLICATION) {
        return Err(foreign("it is a database of another program"));
    }
    let (version, known) = (number("user_version")?, i64::from(schema::VERSION));
    if version != known {
        return Err(foreign(format!(
            "it has schema version {version}, and this murmuration ({}) reads {known}: import it with the version that exported it",
            env!("CARGO_PKG_VERSION")
        )));
    }
    let mut own = Connection::open_in_memory()?;
    schema::create(&mut own)?;
    own.execute_batch(FURTHER_TABLES)?;
    match declared(connection)? == declared(&own)? {
        true => Ok(()),
        false => Err(foreign(OTHER_SCHEMA)),
    }
}

const OTHER_SCHEMA: &str = "its tables, indices or triggers are not those that `murmuration export` writes";

type Declared = (String, String, String, Option<String>);

fn declared(connection: &Connection) -> rusqlite::Result<Vec<Declared>> {
    let mut statement =
        connection.prepare("SELECT type, name, tbl_name, sql FROM sqlite_schema ORDER BY type, name")?;
    let rows = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)))?;
    rows.collect()
}

/// Checks which tables have rows, and the lengths and ranges of values, before these rows are read.
fn check_rows(store: &Store) -> Result<(), Unsound> {
    let tables: Vec<String> = store.read(|connection| {
        let mut statement = connection.prepare("SELECT name FROM sqlite_schema WHERE type = 'table'")?;
        let names = statement.query_map([], |row| row.get(0))?;
        Ok(names.collect::<Result<_, _>>()?)
    })?;
    for table in tables.iter().filter(|table| !FILLED.contains(&table.as_str())) {
        expect_count(store, table, 0)?;
    }
    expect_count(store, "campaigns", 1)?;
    expect_count(store, "exported", 1)?;
    expect_none(
        store,
        "campaigns",
        &format!(
            "octet_length(id) + octet_length(state) + octet_length(error) + octet_length(simulator_version) > 16384
            OR octet_length(tags) + octet_length(note) > {MAX_NOTES_BYTES}
            OR octet_length(spec) > 1048576 OR octet_length(study) > 0 OR request IS NOT NULL
            OR min(created_ms, weight, decisions, rollbacks, rounds, last_label_cutoff) < 0 OR label_cutoff < 0 OR ended_ms < 0"
        ),
    )?;
    expect_none(store, "checkpoints", "created_ms < 0 OR size < 0")?;
    expect_none(
        store,
        "checkpoints",
        "(SELECT sum(octet_length(digest) + octet_length(parent) + octet_length(data_digest) + octet_length(label_digest)
            + octet_length(configuration) + octet_length(metrics) + octet_length(labelled)) FROM checkpoints) > 67108864",
    )?;
    expect_none(
        store,
        "embedders",
        &format!("octet_length(model) > {MAX_MODEL_BYTES}"),
    )?;
    expect_none(store, "exported", "octet_length(digest) <> 64")?;
    expect_none(
        store,
        "labels",
        "octet_length(request) + octet_length(annotator) + octet_length(action) + coalesce(octet_length(class), 0)
            + coalesce(octet_length(value), 0) > 4096 OR time_ms < 0 OR place < 0 OR supersedes < 0",
    )
}

/// Checks that a table has `wanted` rows.
pub(super) fn expect_count(store: &Store, table: &str, wanted: u64) -> Result<(), Unsound> {
    expect_number(store, ("rows", "count(*)"), table, wanted)
}

/// Checks that the chunks of a table have `wanted` individuals.
pub(super) fn expect_individuals(store: &Store, table: &str, wanted: u64) -> Result<(), Unsound> {
    expect_number(store, ("individuals", "total(individuals)"), table, wanted)
}

/// Checks that an SQL expression about a table, which has this name, has the value `wanted`.
fn expect_number(
    store: &Store,
    (name, expression): (&str, &str),
    table: &str,
    wanted: u64,
) -> Result<(), Unsound> {
    let query = format!("SELECT CAST({expression} AS INTEGER) FROM {table}");
    let found: i64 = store.read(|connection| Ok(connection.query_row(&query, [], |row| row.get(0))?))?;
    match found == clamped(wanted) {
        true => Ok(()),
        false => Err(Invalid::new(format!("{name} of {table}"), found, wanted.to_string()).into()),
    }
}

/// Checks that a table has no row for which this condition holds.
pub(super) fn expect_none(store: &Store, table: &str, condition: &str) -> Result<(), Unsound> {
    let exists = format!("SELECT EXISTS (SELECT 1 FROM {table} WHERE {condition})");
    match store.read(|connection| Ok(connection.query_row(&exists, [], |row| row.get(0))?))? {
        false => Ok(()),
        true => Err(foreign(format!(
            "its table {table} has a value that `murmuration export` never writes: its length, range or row is wrong"
        ))),
    }
}
