//! The tables of the database, and the migrations from released schema versions.

use super::{
    StoreError,
    chunks::{EMBEDDINGS, IMAGES, INDIVIDUALS},
};
use rusqlite::{Connection, Transaction};
use std::path::Path;

/// The tables of schema version 1, which is released: this text must not change.
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
        last_label_cutoff INTEGER NOT NULL DEFAULT 0,
        study TEXT NOT NULL DEFAULT '',
        request TEXT,
        ended_ms INTEGER
    ) STRICT;
    CREATE UNIQUE INDEX campaigns_by_request ON campaigns (request) WHERE request IS NOT NULL;
    -- Numbers of deleted campaigns, which are not given again.
    CREATE TABLE deleted (
        number INTEGER PRIMARY KEY
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
        -- The judge's verdict of each trial, a byte each; empty without a judge.
        verdicts BLOB NOT NULL DEFAULT x'',
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
    CREATE TABLE epochs (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        round INTEGER NOT NULL,
        epoch INTEGER NOT NULL,
        generations INTEGER NOT NULL,
        loss REAL,
        accuracy REAL,
        ended_ms INTEGER NOT NULL,
        PRIMARY KEY (campaign, round, epoch)
    ) STRICT, WITHOUT ROWID;
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
    -- Labels go with a deleted campaign, once nothing shows it.
    CREATE TRIGGER labels_remain BEFORE DELETE ON labels
        WHEN EXISTS (SELECT 1 FROM campaigns WHERE number = OLD.campaign AND state <> 'hidden')
        BEGIN SELECT RAISE (ABORT, 'labels are never deleted'); END;
    CREATE TABLE notices (
        number INTEGER PRIMARY KEY,
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        time_ms INTEGER NOT NULL,
        text TEXT NOT NULL,
        generations INTEGER NOT NULL
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
        kinds BLOB NOT NULL,
        PRIMARY KEY (campaign, result, place)
    ) STRICT, WITHOUT ROWID;
";

/// A step from a schema version to the next.
enum Migration {
    Sql(&'static str),
    Rust(fn(&Transaction<'_>) -> rusqlite::Result<()>),
}
use Migration::{Rust, Sql};

/// Each migration changes the tables to the next schema version; the first leads to version 2. A released migration must not
/// change.
const MIGRATIONS: &[Migration] = &[
    // Writes the former defaults of the behaviour space and the choice of medoids into specifications. The field `space` goes to
    // the beginning, because fields outside of tables must precede all tables.
    Sql(r#"
    UPDATE campaigns SET spec = replace(
        'space = "' || iif(spec LIKE '%method = "latent"%' OR spec LIKE '%method = "untrained"%', 'embedding', 'features')
            || '"' || char(10) || replace(spec, 'by_class = true' || char(10), ''),
        '[taxonomy]' || char(10),
        '[taxonomy]' || char(10) || 'choose = "'
            || iif(spec LIKE '%by_class = true%', 'by-class', 'medoids') || '"' || char(10)
    ) WHERE spec NOT LIKE '%space = "%';
    "#),
    // Pictures of datasets get features, by which the in-batch recipe shows rare behaviours more often. Earlier campaigns and
    // checkpoints get `flattening = 0`, because they showed all behaviours equally often. The training configurations of a
    // campaign and of its checkpoint must stay equal (see `repetition`).
    Sql("
    ALTER TABLE pictures ADD COLUMN features BLOB NOT NULL DEFAULT x'';
    UPDATE campaigns SET spec = replace(
        spec,
        '[training.recipe.in-batch]' || char(10),
        '[training.recipe.in-batch]' || char(10) || 'flattening = 0' || char(10)
    ) WHERE spec NOT LIKE '%flattening = %';
    UPDATE checkpoints SET configuration = replace(
        configuration,
        '[recipe.in-batch]' || char(10),
        '[recipe.in-batch]' || char(10) || 'flattening = 0' || char(10)
    ) WHERE configuration NOT LIKE '%flattening = %';
    "),
    // Adds tables for studies. Earlier versions kept studies as files in folders (`studies::take_over`).
    Sql("
    CREATE TABLE studies (
        name TEXT PRIMARY KEY,
        toml TEXT NOT NULL,
        folder TEXT NOT NULL,
        quick INTEGER NOT NULL,
        measures TEXT NOT NULL,
        -- How often what was measured changed, and the classes that people gave.
        measured INTEGER NOT NULL DEFAULT 0,
        classes INTEGER NOT NULL DEFAULT 0
    ) STRICT;
    CREATE TABLE study_records (
        study TEXT NOT NULL REFERENCES studies (name),
        kind TEXT NOT NULL,
        key TEXT NOT NULL,
        measures TEXT NOT NULL,
        content BLOB NOT NULL,
        PRIMARY KEY (study, kind, key)
    ) STRICT;
    "),
    Rust(into_chunks),
    // Adds the tags (with spaces between them) and the note of a campaign.
    Sql("
    ALTER TABLE campaigns ADD COLUMN tags TEXT NOT NULL DEFAULT '';
    ALTER TABLE campaigns ADD COLUMN note TEXT NOT NULL DEFAULT '';
    "),
];

/// The tables of chunks (see `chunks`).
const CHUNKS: &str = "
    CREATE TABLE individual_chunks (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        first INTEGER NOT NULL,
        individuals INTEGER NOT NULL,
        generation INTEGER NOT NULL,
        seeds BLOB NOT NULL,
        controllers BLOB NOT NULL,
        features BLOB NOT NULL,
        novelty BLOB NOT NULL,
        verdicts BLOB NOT NULL,
        UNIQUE (campaign, first)
    ) STRICT;
    CREATE TABLE image_chunks (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        first INTEGER NOT NULL,
        individuals INTEGER NOT NULL,
        ends BLOB NOT NULL,
        images BLOB NOT NULL,
        UNIQUE (campaign, first)
    ) STRICT;
    CREATE TABLE embedding_chunks (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        checkpoint INTEGER NOT NULL REFERENCES checkpoints (number),
        first INTEGER NOT NULL,
        individuals INTEGER NOT NULL,
        embeddings BLOB NOT NULL,
        UNIQUE (campaign, checkpoint, first)
    ) STRICT;
    CREATE TRIGGER individual_chunks_overlap BEFORE INSERT ON individual_chunks
        WHEN (SELECT first + individuals FROM individual_chunks WHERE campaign = NEW.campaign
            AND first < NEW.first + NEW.individuals ORDER BY first DESC LIMIT 1) > NEW.first
        BEGIN SELECT RAISE (ABORT, 'there are such individuals already'); END;
    CREATE TRIGGER image_chunks_overlap BEFORE INSERT ON image_chunks
        WHEN (SELECT first + individuals FROM image_chunks WHERE campaign = NEW.campaign
            AND first < NEW.first + NEW.individuals ORDER BY first DESC LIMIT 1) > NEW.first
        BEGIN SELECT RAISE (ABORT, 'there are pictures of such individuals already'); END;
    CREATE TRIGGER embedding_chunks_overlap BEFORE INSERT ON embedding_chunks
        WHEN (SELECT first + individuals FROM embedding_chunks WHERE campaign = NEW.campaign AND checkpoint = NEW.checkpoint
            AND first < NEW.first + NEW.individuals ORDER BY first DESC LIMIT 1) > NEW.first
        BEGIN SELECT RAISE (ABORT, 'there are embeddings of such individuals already'); END;
";

/// Moves the rows of single individuals into chunks.
fn into_chunks(transaction: &Transaction<'_>) -> rusqlite::Result<()> {
    transaction.execute_batch(CHUNKS)?;
    INDIVIDUALS.fill(
        transaction,
        "SELECT campaign, generation, place, seed, controller, features, novelty, verdicts
         FROM individuals ORDER BY campaign, place",
    )?;
    IMAGES.fill(
        transaction,
        "SELECT campaign, (SELECT generation FROM individuals i WHERE i.campaign = m.campaign AND i.place = m.place), place, image
         FROM images m ORDER BY campaign, place",
    )?;
    EMBEDDINGS.fill(
        transaction,
        "SELECT campaign, checkpoint, place, embedding FROM embeddings ORDER BY campaign, checkpoint, place",
    )?;
    transaction.execute_batch("DROP TABLE embeddings; DROP TABLE images; DROP TABLE individuals")?;
    transaction.execute_batch(PROVENANCE)
}

/// The provenance of 100 results is longer than a row without a rowid can be on its page, and would take a page of its own.
const PROVENANCE: &str = "
    ALTER TABLE provenance RENAME TO provenance_before;
    CREATE TABLE provenance (
        campaign INTEGER NOT NULL REFERENCES campaigns (number),
        result TEXT NOT NULL,
        place INTEGER NOT NULL,
        machines BLOB NOT NULL,
        kinds BLOB NOT NULL,
        UNIQUE (campaign, result, place)
    ) STRICT;
    INSERT INTO provenance SELECT campaign, result, place, machines, kinds FROM provenance_before
        ORDER BY campaign, result, place;
    DROP TABLE provenance_before;
";

/// The newest schema version.
pub(super) const VERSION: u32 = 1 + MIGRATIONS.len() as u32;

/// The schema version of the database; an error if this program cannot read that version. Changes nothing.
pub(super) fn version(connection: &Connection, path: &Path) -> Result<u32, StoreError> {
    let found = connection
        .pragma_query_value(None, "user_version", |row| row.get(0))
        .map_err(|source| StoreError::from_sqlite(source, path))?;
    match found {
        // A database gets its name only once it has tables. So a database without tables was cut off, and is not a new database.
        0 => Err(StoreError::Damaged {
            path: path.to_path_buf(),
            reason: "the database has no tables".to_owned(),
        }),
        1..=VERSION => Ok(found),
        _ => Err(StoreError::Newer {
            path: path.to_path_buf(),
            found,
            known: VERSION,
        }),
    }
}

/// Makes the tables of the newest version in an empty database.
pub(super) fn create(connection: &mut Connection) -> rusqlite::Result<()> {
    step(connection, &Sql(TABLES), 1)?;
    migrate(connection, 1)
}

/// Migrates the database from schema version `from` to the newest version, with a commit after each step.
pub(super) fn migrate(connection: &mut Connection, from: u32) -> rusqlite::Result<()> {
    migrate_by(MIGRATIONS, connection, from)
}

fn migrate_by(migrations: &[Migration], connection: &mut Connection, from: u32) -> rusqlite::Result<()> {
    for (version, migration) in (2..).zip(migrations) {
        if version > from {
            step(connection, migration, version)?;
        }
    }
    Ok(())
}

fn step(connection: &mut Connection, change: &Migration, version: u32) -> rusqlite::Result<()> {
    let transaction = connection.transaction()?;
    match change {
        Sql(statements) => transaction.execute_batch(statements)?,
        Rust(change) => change(&transaction)?,
    }
    transaction.pragma_update(None, "user_version", version)?;
    transaction.commit()
}

/// Makes the tables of an older version in an empty database.
#[cfg(test)]
pub(super) fn create_older(connection: &mut Connection, version: u32) {
    step(connection, &Sql(TABLES), 1).unwrap();
    migrate_by(&MIGRATIONS[..version as usize - 1], connection, 1).unwrap();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DataDirectory, Store};
    use murmuration_swarm::{BehaviourSpace, CampaignSpec, Choice, EmbedderSource, training::Configuration};

    fn version_of(connection: &Connection) -> u32 {
        let version = connection.pragma_query_value(None, "user_version", |row| row.get(0));
        version.unwrap()
    }

    #[test]
    fn what_an_older_version_holds_is_there_after_each_step_or_the_step_was_not_taken() {
        let mut connection = Connection::open_in_memory().unwrap();
        step(&mut connection, &Sql(TABLES), 1).unwrap();
        let notice = "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
                          VALUES (1, 'old-1', '', '1', 'paused', '', 5);
                      INSERT INTO notices VALUES (1, 1, 5, 'kept', 0)";
        connection.execute_batch(notice).unwrap();

        let page_column = "ALTER TABLE notices ADD COLUMN page TEXT NOT NULL DEFAULT 'none'";
        let further = [
            Sql(page_column),
            Rust(|transaction| transaction.execute_batch("UPDATE notices SET page = 'search'")),
        ];
        let interrupted = [
            Sql(page_column),
            Sql("UPDATE notices SET page = 'lost'; SELECT 1 FROM nowhere"),
        ];
        migrate_by(&interrupted, &mut connection, 1).unwrap_err();
        assert_eq!(version_of(&connection), 2);
        let page = |connection: &Connection| -> (String, String) {
            let row = connection.query_row("SELECT text, page FROM notices", [], |row| {
                Ok((row.get(0)?, row.get(1)?))
            });
            row.unwrap()
        };
        assert_eq!(page(&connection), ("kept".to_owned(), "none".to_owned()));

        migrate_by(&further, &mut connection, 2).unwrap();
        assert_eq!(version_of(&connection), 3);
        assert_eq!(page(&connection), ("kept".to_owned(), "search".to_owned()));
        // A database of the newest version stays as it is.
        migrate_by(&further, &mut connection, 3).unwrap();
    }

    #[test]
    fn specifications_of_version_1_keep_their_space_and_their_medoids() {
        let before = |method: &str, taxonomy: &str| {
            let spec = format!(
                "model = \"single-sensor\"\nmethod = \"{method}\"\n[taxonomy]\nmedoids = 5\n{taxonomy}"
            );
            let mut connection = Connection::open_in_memory().unwrap();
            step(&mut connection, &Sql(TABLES), 1).unwrap();
            let add = "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
                           VALUES (1, 'old-1', ?1, '1', 'paused', '', 5)";
            connection.execute(add, [spec]).unwrap();
            migrate(&mut connection, 1).unwrap();
            let row = connection.query_row("SELECT spec FROM campaigns", [], |row| row.get(0));
            let text: String = row.unwrap();
            let spec = CampaignSpec::from_toml(&text).unwrap();
            (spec.space(), spec.choice(), spec.medoids())
        };
        let medoids = |space| (space, Choice::Medoids, 5);
        assert_eq!(before("latent", ""), medoids(BehaviourSpace::Embedding));
        assert_eq!(before("untrained", ""), medoids(BehaviourSpace::Embedding));
        assert_eq!(before("random", ""), medoids(BehaviourSpace::Features));
        assert_eq!(
            before("latent", "by_class = true\n[feedback]\nrounds = 1\n"),
            (BehaviourSpace::Embedding, Choice::ByClass, 5)
        );
    }

    #[test]
    fn campaigns_of_version_2_show_their_network_every_behaviour_equally_often() {
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"latent\"").unwrap();
        let now = spec.to_toml();
        let before = now.replace("flattening = 2\n", "");
        assert_ne!(now, before);
        let mut connection = Connection::open_in_memory().unwrap();
        step(&mut connection, &Sql(TABLES), 1).unwrap();
        step(&mut connection, &MIGRATIONS[0], 2).unwrap();
        let add = "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
                       VALUES (1, 'old-1', ?1, '1', 'paused', '', 5)";
        connection.execute(add, [before]).unwrap();
        let Some(EmbedderSource::Trained { training, .. }) = spec.embedder() else {
            panic!("it trains its embedder");
        };
        let add = "INSERT INTO checkpoints (digest, size, parent, data_digest, label_digest, configuration, metrics, created_ms)
                       VALUES ('1f0c', 1, '', '', '', ?1, '', 5)";
        let before = training.to_toml().replace("flattening = 2\n", "");
        connection.execute(add, [before]).unwrap();

        migrate(&mut connection, 2).unwrap();
        let text = |query: &str| -> String { connection.query_row(query, [], |row| row.get(0)).unwrap() };
        let migrated = CampaignSpec::from_toml(&text("SELECT spec FROM campaigns")).unwrap();
        let equally = now.replace("flattening = 2\n", "flattening = 0\n");
        assert_eq!(migrated, CampaignSpec::from_toml(&equally).unwrap());
        let Some(EmbedderSource::Trained { training, .. }) = migrated.embedder() else {
            panic!("it trains its embedder");
        };
        let trained = Configuration::from_toml(&text("SELECT configuration FROM checkpoints")).unwrap();
        assert_eq!(trained, **training, "its checkpoint is its own");
    }

    #[test]
    fn a_database_of_an_unknown_version_is_refused_and_not_changed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(Store::FILE);
        let mut connection = Connection::open(&path).unwrap();
        create(&mut connection).unwrap();
        assert_eq!(version_of(&connection), VERSION);
        for (version, expected) in [
            (0, "the database has no tables"),
            (VERSION + 1, "written by a newer"),
        ] {
            connection.pragma_update(None, "user_version", version).unwrap();
            let refused = [
                Store::look(folder.path(), true).unwrap_err(),
                Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap_err(),
            ];
            for error in refused {
                assert!(error.to_string().contains(expected), "{error}");
            }
            assert_eq!(version_of(&connection), version);
        }
    }
}
