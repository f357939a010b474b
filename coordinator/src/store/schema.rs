//! The tables, and the way from older versions of them.

use super::StoreError;
use rusqlite::Connection;
use std::path::Path;

/// Each entry takes the schema from its index to the next version. Entries are never edited once released.
const MIGRATIONS: [&str; 6] = [
    "
    CREATE TABLE campaigns (
        number INTEGER PRIMARY KEY,
        id TEXT NOT NULL UNIQUE,
        spec TEXT NOT NULL,
        simulator_version TEXT NOT NULL,
        state TEXT NOT NULL,
        error TEXT NOT NULL,
        created_ms INTEGER NOT NULL
    ) STRICT;
    CREATE TABLE generations (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        generation INTEGER NOT NULL,
        best_novelty REAL NOT NULL,
        mean_novelty REAL NOT NULL,
        filtered INTEGER NOT NULL,
        PRIMARY KEY (campaign, generation)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE individuals (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        place INTEGER NOT NULL,
        generation INTEGER NOT NULL,
        controller BLOB NOT NULL,
        seed INTEGER NOT NULL,
        features BLOB NOT NULL,
        novelty REAL NOT NULL,
        PRIMARY KEY (campaign, place)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE images (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        place INTEGER NOT NULL,
        image BLOB NOT NULL,
        UNIQUE (campaign, place)
    ) STRICT;
    CREATE TABLE taxonomies (
        campaign INTEGER PRIMARY KEY REFERENCES campaigns (number),
        medoids BLOB NOT NULL,
        clusters BLOB NOT NULL,
        loss REAL NOT NULL
    ) STRICT;
",
    "
    CREATE TABLE checkpoints (
        number INTEGER PRIMARY KEY,
        digest TEXT NOT NULL UNIQUE,
        size INTEGER NOT NULL,
        parent TEXT NOT NULL,
        data_digest TEXT NOT NULL,
        label_digest TEXT NOT NULL,
        configuration TEXT NOT NULL,
        metrics TEXT NOT NULL,
        created_ms INTEGER NOT NULL
    ) STRICT;
",
    "
    ALTER TABLE campaigns ADD COLUMN checkpoint INTEGER REFERENCES checkpoints (number);
    ALTER TABLE campaigns ADD COLUMN next_checkpoint INTEGER REFERENCES checkpoints (number);
    CREATE TABLE pictures (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        place INTEGER NOT NULL,
        controller BLOB NOT NULL,
        seed INTEGER NOT NULL,
        image BLOB NOT NULL,
        UNIQUE (campaign, place)
    ) STRICT;
    CREATE TABLE trainings (
        campaign INTEGER PRIMARY KEY REFERENCES campaigns (number),
        epoch INTEGER NOT NULL,
        saved BLOB NOT NULL
    ) STRICT;
    CREATE TABLE embeddings (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        checkpoint INTEGER NOT NULL REFERENCES checkpoints (number),
        place INTEGER NOT NULL,
        embedding BLOB NOT NULL,
        PRIMARY KEY (campaign, checkpoint, place)
    ) STRICT, WITHOUT ROWID;
",
    "
    CREATE TABLE labels (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        entry INTEGER NOT NULL,
        request TEXT NOT NULL,
        annotator TEXT NOT NULL,
        time_ms INTEGER NOT NULL,
        action TEXT NOT NULL,
        place INTEGER,
        class TEXT,
        value TEXT,
        supersedes INTEGER,
        PRIMARY KEY (campaign, entry)
    ) STRICT, WITHOUT ROWID;
    CREATE INDEX labels_by_request ON labels (campaign, request);
    CREATE TRIGGER labels_stay BEFORE UPDATE ON labels
        BEGIN SELECT RAISE (ABORT, 'labels are never changed'); END;
    CREATE TRIGGER labels_remain BEFORE DELETE ON labels
        BEGIN SELECT RAISE (ABORT, 'labels are never deleted'); END;
",
    "
    ALTER TABLE campaigns ADD COLUMN rounds INTEGER NOT NULL DEFAULT 0;
    ALTER TABLE campaigns ADD COLUMN lesson INTEGER;
    ALTER TABLE checkpoints ADD COLUMN labelled BLOB NOT NULL DEFAULT x'';
",
    "
    ALTER TABLE generations ADD COLUMN evaluators BLOB NOT NULL DEFAULT x'';
    CREATE TABLE notices (
        number INTEGER PRIMARY KEY,
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        time_ms INTEGER NOT NULL,
        text TEXT NOT NULL
    ) STRICT;
    CREATE INDEX notices_by_campaign ON notices (campaign, number);
",
];

/// The newest schema version.
pub(super) const VERSION: u32 = MIGRATIONS.len() as u32;

/// The version of the database, which this murmuration must know; looking changes nothing.
pub(super) fn version(connection: &Connection, path: &Path) -> Result<u32, StoreError> {
    let found = connection
        .pragma_query_value(None, "user_version", |row| row.get(0))
        .map_err(|source| StoreError::from_sqlite(source, path))?;
    // Databases appear under their name with their tables: this one was cut off, and must not pass for a new one.
    if found == 0 {
        return Err(StoreError::Damaged {
            path: path.to_path_buf(),
            reason: "it holds no tables".to_owned(),
        });
    }
    if found > VERSION {
        return Err(StoreError::Newer {
            path: path.to_path_buf(),
            found,
            known: VERSION,
        });
    }
    Ok(found)
}

/// Brings the database from version `from` to the newest, one committed step after the other.
pub(super) fn migrate(connection: &mut Connection, from: u32) -> rusqlite::Result<()> {
    for (version, migration) in (1..).zip(MIGRATIONS).skip(from as usize) {
        let transaction = connection.transaction()?;
        transaction.execute_batch(migration)?;
        transaction.pragma_update(None, "user_version", version)?;
        transaction.commit()?;
    }
    Ok(())
}
