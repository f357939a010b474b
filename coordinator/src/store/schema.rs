//! The tables, and the way from older versions of them.

use super::StoreError;
use rusqlite::Connection;
use std::path::Path;

/// Each entry takes the schema from its index to the next version. Entries are never edited once released.
const MIGRATIONS: [&str; 12] = [
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
    "
    ALTER TABLE campaigns ADD COLUMN weight INTEGER NOT NULL DEFAULT 100;
",
    "
    CREATE TABLE quarantined (
        instance INTEGER PRIMARY KEY,
        name TEXT NOT NULL,
        time_ms INTEGER NOT NULL
    ) STRICT;
    CREATE TABLE provenance (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        work TEXT NOT NULL,
        place INTEGER NOT NULL,
        workers BLOB NOT NULL,
        PRIMARY KEY (campaign, work, place)
    ) STRICT, WITHOUT ROWID;
    INSERT INTO provenance
        SELECT g.campaign, 'evaluation', min(i.place), g.evaluators FROM generations g
        JOIN individuals i ON i.campaign = g.campaign AND i.generation = g.generation
        WHERE length(g.evaluators) > 0 GROUP BY g.campaign, g.generation;
    ALTER TABLE generations DROP COLUMN evaluators;
    ALTER TABLE campaigns ADD COLUMN taken_back_ms INTEGER NOT NULL DEFAULT 0;
",
    "
    ALTER TABLE campaigns ADD COLUMN learned INTEGER;
    CREATE TABLE committee (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        member INTEGER NOT NULL,
        rounds INTEGER NOT NULL,
        checkpoint INTEGER NOT NULL REFERENCES checkpoints (number),
        PRIMARY KEY (campaign, member)
    ) STRICT, WITHOUT ROWID;
",
    "
    ALTER TABLE taxonomies ADD COLUMN measures BLOB NOT NULL DEFAULT x'';
",
    "
    ALTER TABLE campaigns ADD COLUMN decisions INTEGER NOT NULL DEFAULT 0;
    ALTER TABLE campaigns ADD COLUMN taken_back INTEGER NOT NULL DEFAULT 0;
    UPDATE campaigns SET taken_back = 1 WHERE taken_back_ms > 0;
    ALTER TABLE campaigns DROP COLUMN taken_back_ms;
",
    "
    ALTER TABLE quarantined RENAME COLUMN instance TO machine;
    ALTER TABLE quarantined ADD COLUMN lifted_ms INTEGER;
    ALTER TABLE provenance ADD COLUMN kinds BLOB NOT NULL DEFAULT x'';
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{DataDirectory, Store};
    use rusqlite::params;

    const SPEC: &str = "model = \"single-sensor\"\nmethod = \"random\"";

    /// A data directory whose database is of an older version, with a campaign of one individual.
    fn older(version: usize) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let connection = Connection::open(folder.path().join(Store::FILE)).unwrap();
        for migration in &MIGRATIONS[..version] {
            connection.execute_batch(migration).unwrap();
        }
        connection
            .pragma_update(None, "user_version", version as u32)
            .unwrap();
        let campaign = "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
            VALUES (1, 'old-1', ?1, '1', 'paused', '', 5)";
        connection.execute(campaign, [SPEC]).unwrap();
        let controller: Vec<u8> = [0.5_f64; 4].iter().flat_map(|gene| gene.to_le_bytes()).collect();
        let features = vec![0_u8; 40];
        let individual = "INSERT INTO individuals VALUES (1, 0, 0, ?1, 7, ?2, 0.5)";
        connection
            .execute(individual, params![controller, features])
            .unwrap();
        folder
    }

    #[test]
    fn every_older_version_is_brought_to_the_newest_with_what_it_holds() {
        for version in 1..MIGRATIONS.len() {
            let folder = older(version);
            let look = || Store::look(folder.path(), true).unwrap();
            let check = |store: &Store| {
                let record = store.campaign("old-1").unwrap();
                assert_eq!((record.created_ms, record.rounds_done), (5, 0));
                assert_eq!((record.decisions, record.taken_back), (0, 0));
                let kept = store.individual(&record.id, record.spec.model(), 0).unwrap();
                assert_eq!((kept.seed, kept.controller.genes()), (7, [0.5; 4].as_slice()));
            };
            // Looked at, it stays as old as it was.
            for _ in 0..2 {
                let (store, found) = look();
                assert_eq!(found as usize, version);
                check(&store);
            }
            check(&Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap());
            assert_eq!(look().1, VERSION);
        }
    }
}
