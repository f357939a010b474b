//! The tables, and the way from older versions of them.

use super::StoreError;
use rusqlite::Connection;
use std::path::Path;

/// The first version that is still opened; databases of lower ones were made before any release.
const FIRST: u32 = 16;

/// The tables of version [`FIRST`]. Never edited once released.
const TABLES: &str = "
    CREATE TABLE checkpoints (
        number INTEGER PRIMARY KEY,
        digest TEXT NOT NULL UNIQUE,
        size INTEGER NOT NULL,
        parent TEXT NOT NULL,
        data_digest TEXT NOT NULL,
        label_digest TEXT NOT NULL,
        configuration TEXT NOT NULL,
        metrics TEXT NOT NULL,
        created_ms INTEGER NOT NULL,
        labelled BLOB NOT NULL DEFAULT x''
    ) STRICT;
    CREATE TABLE campaigns (
        number INTEGER PRIMARY KEY,
        id TEXT NOT NULL UNIQUE,
        spec TEXT NOT NULL,
        simulator_version TEXT NOT NULL,
        state TEXT NOT NULL,
        error TEXT NOT NULL,
        created_ms INTEGER NOT NULL,
        weight INTEGER NOT NULL DEFAULT 100,
        decisions INTEGER NOT NULL DEFAULT 0,
        rollbacks INTEGER NOT NULL DEFAULT 0,
        checkpoint INTEGER REFERENCES checkpoints (number),
        next_checkpoint INTEGER REFERENCES checkpoints (number),
        rounds INTEGER NOT NULL DEFAULT 0,
        label_cutoff INTEGER,
        last_label_cutoff INTEGER NOT NULL DEFAULT 0
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
    CREATE TABLE embeddings (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        checkpoint INTEGER NOT NULL REFERENCES checkpoints (number),
        place INTEGER NOT NULL,
        embedding BLOB NOT NULL,
        PRIMARY KEY (campaign, checkpoint, place)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE taxonomies (
        campaign INTEGER PRIMARY KEY REFERENCES campaigns (number),
        medoids BLOB NOT NULL,
        clusters BLOB NOT NULL,
        loss REAL NOT NULL,
        measures BLOB NOT NULL,
        robust_trials BLOB NOT NULL
    ) STRICT;
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
    CREATE TABLE notices (
        number INTEGER PRIMARY KEY,
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        time_ms INTEGER NOT NULL,
        text TEXT NOT NULL
    ) STRICT;
    CREATE INDEX notices_by_campaign ON notices (campaign, number);
    CREATE TABLE quarantined (
        machine INTEGER PRIMARY KEY,
        name TEXT NOT NULL,
        time_ms INTEGER NOT NULL,
        lifted_ms INTEGER
    ) STRICT;
    CREATE TABLE provenance (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        result TEXT NOT NULL,
        place INTEGER NOT NULL,
        machines BLOB NOT NULL,
        kinds BLOB NOT NULL DEFAULT x'',
        PRIMARY KEY (campaign, result, place)
    ) STRICT, WITHOUT ROWID;
";

/// Each takes the tables to the next version, the first of them to that after [`FIRST`]. Never edited once released.
const MIGRATIONS: &[&str] = &[
    // What the judge said of each trial, a byte each; empty where nobody asked it.
    "ALTER TABLE individuals ADD COLUMN verdicts BLOB NOT NULL DEFAULT x''",
    // Which study a campaign was started for, by which request, and when it stopped; what each epoch of a training measured;
    // how many generations there were when something was noted. Numbers of deleted campaigns are not given again, and labels
    // go only with a campaign that nobody sees any more.
    "ALTER TABLE campaigns ADD COLUMN study TEXT NOT NULL DEFAULT '';
     ALTER TABLE campaigns ADD COLUMN request TEXT;
     ALTER TABLE campaigns ADD COLUMN ended_ms INTEGER;
     ALTER TABLE notices ADD COLUMN generations INTEGER;
     CREATE UNIQUE INDEX campaigns_by_request ON campaigns (request) WHERE request IS NOT NULL;
     CREATE TABLE epochs (
         campaign INTEGER NOT NULL REFERENCES campaigns (number),
         round INTEGER NOT NULL,
         epoch INTEGER NOT NULL,
         generations INTEGER NOT NULL,
         loss REAL,
         accuracy REAL,
         PRIMARY KEY (campaign, round, epoch)
     ) STRICT, WITHOUT ROWID;
     CREATE TABLE deleted (
         number INTEGER PRIMARY KEY
     ) STRICT;
     DROP TRIGGER labels_remain;
     CREATE TRIGGER labels_remain BEFORE DELETE ON labels
         WHEN EXISTS (SELECT 1 FROM campaigns WHERE number = OLD.campaign AND state <> 'hidden')
         BEGIN SELECT RAISE (ABORT, 'labels are never deleted'); END",
    // Taxonomies stay as versions, each with what it was made of and where its individuals were on the map.
    "CREATE TABLE versions (
         campaign INTEGER NOT NULL REFERENCES campaigns (number),
         version INTEGER NOT NULL,
         stands INTEGER NOT NULL,
         made_ms INTEGER,
         checkpoint INTEGER REFERENCES checkpoints (number),
         rounds INTEGER NOT NULL,
         generations INTEGER NOT NULL,
         medoids BLOB NOT NULL,
         clusters BLOB NOT NULL,
         loss REAL NOT NULL,
         measures BLOB NOT NULL,
         robust_trials BLOB NOT NULL,
         points BLOB NOT NULL,
         PRIMARY KEY (campaign, version)
     ) STRICT;
     INSERT INTO versions
         SELECT t.campaign, 1, 1, c.ended_ms, c.checkpoint, c.rounds,
             (SELECT coalesce(max(generation) + 1, 0) FROM generations WHERE campaign = t.campaign),
             t.medoids, t.clusters, t.loss, t.measures, t.robust_trials, x''
         FROM taxonomies t JOIN campaigns c ON c.number = t.campaign;
     DROP TABLE taxonomies;
     ALTER TABLE versions RENAME TO taxonomies",
    // The label log may hold comparisons, in the columns that it has: an older murmuration, which could not read them, is kept away.
    "-- no table changes",
    // When an epoch ended: how long a training took.
    "ALTER TABLE epochs ADD COLUMN ended_ms INTEGER",
];

/// The newest version.
pub(super) const VERSION: u32 = FIRST + MIGRATIONS.len() as u32;

/// The version of the database, which this murmuration must know; looking changes nothing.
pub(super) fn version(connection: &Connection, path: &Path) -> Result<u32, StoreError> {
    let found = connection
        .pragma_query_value(None, "user_version", |row| row.get(0))
        .map_err(|source| StoreError::from_sqlite(source, path))?;
    match found {
        // Databases appear under their name with their tables: this one was cut off, and must not pass for a new one.
        0 => Err(StoreError::Damaged {
            path: path.to_path_buf(),
            reason: "it holds no tables".to_owned(),
        }),
        1..FIRST => Err(StoreError::Unreleased {
            path: path.to_path_buf(),
            found,
            oldest: FIRST,
        }),
        FIRST..=VERSION => Ok(found),
        _ => Err(StoreError::Newer {
            path: path.to_path_buf(),
            found,
            known: VERSION,
        }),
    }
}

/// Makes the tables of the newest version in an empty database.
pub(super) fn create(connection: &mut Connection) -> rusqlite::Result<()> {
    step(connection, TABLES, FIRST)?;
    migrate(connection, FIRST)
}

/// Brings the database from version `from` to the newest, one committed step after the other.
pub(super) fn migrate(connection: &mut Connection, from: u32) -> rusqlite::Result<()> {
    migrate_by(MIGRATIONS, connection, from)
}

fn migrate_by(migrations: &[&str], connection: &mut Connection, from: u32) -> rusqlite::Result<()> {
    for (version, migration) in (FIRST + 1..).zip(migrations) {
        if version > from {
            step(connection, migration, version)?;
        }
    }
    Ok(())
}

fn step(connection: &mut Connection, change: &str, version: u32) -> rusqlite::Result<()> {
    let transaction = connection.transaction()?;
    transaction.execute_batch(change)?;
    transaction.pragma_update(None, "user_version", version)?;
    transaction.commit()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DataDirectory, Store};

    fn version_of(connection: &Connection) -> u32 {
        let version = connection.pragma_query_value(None, "user_version", |row| row.get(0));
        version.unwrap()
    }

    #[test]
    fn what_an_older_version_holds_is_there_after_each_step_or_the_step_was_not_taken() {
        let mut connection = Connection::open_in_memory().unwrap();
        step(&mut connection, TABLES, FIRST).unwrap();
        let notice = "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
                          VALUES (1, 'old-1', '', '1', 'paused', '', 5);
                      INSERT INTO notices VALUES (1, 1, 5, 'kept')";
        connection.execute_batch(notice).unwrap();

        let further = [
            "ALTER TABLE notices ADD COLUMN page TEXT NOT NULL DEFAULT 'none'",
            "UPDATE notices SET page = 'search'",
        ];
        let interrupted = [
            further[0],
            "UPDATE notices SET page = 'lost'; SELECT 1 FROM nowhere",
        ];
        migrate_by(&interrupted, &mut connection, FIRST).unwrap_err();
        assert_eq!(version_of(&connection), FIRST + 1);
        let page = |connection: &Connection| -> (String, String) {
            let row = connection.query_row("SELECT text, page FROM notices", [], |row| {
                Ok((row.get(0)?, row.get(1)?))
            });
            row.unwrap()
        };
        assert_eq!(page(&connection), ("kept".to_owned(), "none".to_owned()));

        migrate_by(&further, &mut connection, FIRST + 1).unwrap();
        assert_eq!(version_of(&connection), FIRST + 2);
        assert_eq!(page(&connection), ("kept".to_owned(), "search".to_owned()));
        // What is of the newest version already stays as it is.
        migrate_by(&further, &mut connection, FIRST + 2).unwrap();
    }

    #[test]
    fn a_database_of_an_unknown_version_is_refused_and_not_changed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(Store::FILE);
        let mut connection = Connection::open(&path).unwrap();
        create(&mut connection).unwrap();
        assert_eq!(version_of(&connection), VERSION);
        for (version, said) in [
            (0, "it holds no tables"),
            (1, "before the first release"),
            (FIRST - 1, "before the first release"),
            (VERSION + 1, "written by a newer"),
        ] {
            connection.pragma_update(None, "user_version", version).unwrap();
            let refused = [
                Store::look(folder.path(), true).unwrap_err(),
                Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap_err(),
            ];
            for error in refused {
                assert!(error.to_string().contains(said), "{error}");
            }
            assert_eq!(version_of(&connection), version);
        }
    }
}
