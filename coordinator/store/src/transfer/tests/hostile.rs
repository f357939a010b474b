//! Files that no export wrote: each is refused with a reason, and leaves the store unchanged.

use super::{super::untrusted::read_schema, *};
use crate::{chunks::tests::edit, schema};
use murmuration_swarm::{Purpose, RandomStream};
use rand::RngExt as _;
use rusqlite::{Connection, config::DbConfig};
use std::{os::unix::fs::symlink, process::Command, sync::LazyLock};

/// The database of a full campaign.
static SOUND: LazyLock<Vec<u8>> = LazyLock::new(|| {
    on_a_runtime(async {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("data");
        let place = full().store(&data).await;
        fs::read(exported(&place, &data, &folder.path().join("exported")).await).unwrap()
    })
});

/// Why a file is refused. Opening the file and importing it must give the same reason, and the store must stay unchanged.
fn refused(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let (file, data) = (folder.path().join("file"), folder.path().join("data"));
    fs::write(&file, bytes).unwrap();
    let looked_at = contents(&file).map(drop).unwrap_err().to_string();
    let message = on_a_runtime(async {
        let place = Place::with_another(&data).await;
        let before = place.campaigns();
        let refused = import((&place.store, &place.checkpoints), &data, &file)
            .await
            .unwrap_err();
        assert_eq!((place.campaigns(), left(&data)), (before, Vec::new()));
        assert_eq!(place.store.checkpoints().unwrap().len(), 1);
        refused.to_string()
    });
    assert!(message.ends_with(&looked_at), "{message}: {looked_at}");
    looked_at
}

/// The sound file after these statements.
fn changed(statements: &str) -> Vec<u8> {
    changed_by(|connection| connection.execute_batch(statements).unwrap())
}

/// The sound file after a change, which is made without triggers and foreign keys.
fn changed_by(change: impl FnOnce(&Connection)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, &*SOUND).unwrap();
    let connection = Connection::open(&file).unwrap();
    for setting in [
        DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER,
        DbConfig::SQLITE_DBCONFIG_ENABLE_FKEY,
    ] {
        connection.set_db_config(setting, false).unwrap();
    }
    change(&connection);
    connection.close().unwrap();
    fs::read(&file).unwrap()
}

#[track_caller]
fn assert_refused(statements: &str, reason: &str) {
    let message = refused(&changed(statements));
    assert!(message.contains(reason), "{statements}\n{message}\n{reason}");
}

#[test]
fn what_is_no_database_is_said_to_be_none() {
    let random: Vec<u8> = {
        let mut dice = RandomStream::derive(1, Purpose::Jitter, 1);
        (0..40_000).map(|_| dice.random()).collect()
    };
    for bytes in [&[][..], b"PAR1", b"SQLite format 3\0", &random, &SOUND[1..]] {
        assert_eq!(refused(bytes), "it is not a SQLite database, or it is encrypted");
    }
    let header_alone = refused(&SOUND[..100]);
    assert!(!header_alone.is_empty());
    let longer = [&SOUND[..], &[0; 4096]].concat();
    assert!(refused(&longer).contains("bytes, and its database"));
    for cut in [4096, SOUND.len() / 3, SOUND.len() - 4096, SOUND.len() - 1] {
        assert!(!refused(&SOUND[..cut]).is_empty(), "cut off at {cut}");
    }
}

#[test]
fn most_changed_bytes_are_found_and_no_read_value_is_out_of_bounds() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, &*SOUND).unwrap();
    let sound = contents(&file).unwrap();
    let mut dice = RandomStream::derive(1, Purpose::Jitter, 2);
    let mut found = 0;
    for _ in 0..300 {
        let mut bytes = SOUND.clone();
        let place = dice.random_range(0..bytes.len());
        bytes[place] ^= 1 << dice.random_range(0..8);
        fs::write(&file, bytes).unwrap();
        match contents(&file) {
            // Only values that no digest covers can differ: the digests of the archive and the embedders match.
            Ok(read) => {
                assert_eq!(read.campaign.digest, sound.campaign.digest);
                let models = |contents: &Contents| {
                    contents
                        .checkpoints
                        .iter()
                        .map(|(_, model)| model.clone())
                        .collect::<Vec<_>>()
                };
                assert!(read.members.len() == sound.members.len() && models(&read) == models(&sound));
            }
            Err(_) => found += 1,
        }
    }
    assert!(found > 50, "{found}");
    fs::write(&file, &*SOUND).unwrap();
    assert!(contents(&file).unwrap() == sound);
}

#[test]
fn what_is_no_regular_file_is_not_opened() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("sound"), &*SOUND).unwrap();
    symlink(at("sound"), at("link")).unwrap();
    fs::create_dir(at("folder")).unwrap();
    assert!(Command::new("mkfifo").arg(at("fifo")).status().unwrap().success());
    for path in [at("link"), at("folder"), at("fifo"), "/dev/zero".into()] {
        let message = contents(&path).map(drop).unwrap_err().to_string();
        assert_eq!(message, "it is not a regular file", "{}", path.display());
    }
    let message = contents(&at("nothing")).map(drop).unwrap_err().to_string();
    assert!(message.contains("cannot read"), "{message}");
}

/// Statements that give a schema a longer text than an import reads.
const LONG_SCHEMA: &str = "PRAGMA writable_schema = ON;
    UPDATE sqlite_schema SET sql = sql || printf('--%.100000c', 'x') WHERE name = 'image_chunks'";

/// Statements that give a schema more entries than an import reads.
const MANY_VIEWS: &str = "PRAGMA writable_schema = ON;
    WITH RECURSIVE numbers (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < 50000)
    INSERT INTO sqlite_schema SELECT 'view', 'v' || n, 'v' || n, 0, 'CREATE VIEW v' || n || ' AS SELECT 1' FROM numbers";

#[test]
fn a_schema_that_is_too_large_is_not_read_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    let read = |bytes: &[u8]| {
        fs::write(&file, bytes).unwrap();
        read_schema(&mut Connection::open(&file).unwrap())
    };
    read(&SOUND).unwrap();
    for statements in [LONG_SCHEMA, MANY_VIEWS] {
        assert!(
            matches!(read(&changed(statements)), Err(Unsound::Foreign(_))),
            "{statements}"
        );
    }
}

#[test]
fn another_schema_is_refused() {
    let reason = "its tables, indices or triggers are not those";
    for statements in [
        "CREATE TABLE extra (x)",
        "CREATE VIEW extra AS SELECT * FROM labels",
        "CREATE TRIGGER extra AFTER INSERT ON labels BEGIN DELETE FROM campaigns; END",
        "CREATE INDEX extra ON labels (annotator)",
        "CREATE VIRTUAL TABLE extra USING fts5 (x)",
        "DROP TRIGGER labels_stay",
        "DROP TABLE notices",
        "ALTER TABLE individual_chunks ADD COLUMN extra TEXT",
        "PRAGMA writable_schema = ON; UPDATE sqlite_schema SET sql = replace(sql, 'first INTEGER NOT NULL', 'first INTEGER')
            WHERE name = 'image_chunks'",
        LONG_SCHEMA,
        MANY_VIEWS,
    ] {
        assert_refused(statements, reason);
    }
    let newer = schema::VERSION + 1;
    assert_refused(
        &format!("PRAGMA user_version = {newer}"),
        &format!("it has schema version {newer}, and this murmuration"),
    );
    assert_refused("PRAGMA user_version = 4", "it has schema version 4");
    assert_refused("PRAGMA user_version = 0", "it has schema version 0");
    assert_refused("PRAGMA application_id = 0", "it is a database of another program");
    assert_refused("PRAGMA journal_mode = WAL", "it is in SQLite's mode WAL");
}

#[test]
fn rows_that_are_missing_or_too_many_are_counted() {
    for (statements, reason) in [
        (
            "DELETE FROM individual_chunks WHERE first = 4",
            "individuals of individual_chunks = 4: must be 8",
        ),
        (
            "UPDATE individual_chunks SET individuals = 3 WHERE first = 4",
            "individuals of individual_chunks = 7: must be 8",
        ),
        (
            "UPDATE individual_chunks SET individuals = 9223372036854775807",
            "individuals of individual_chunks = 9223372036854775807: must be 8",
        ),
        (
            "DELETE FROM image_chunks WHERE first = 4",
            "individuals of image_chunks = 4: must be 8",
        ),
        (
            "DELETE FROM embedding_chunks WHERE first = 4",
            "individuals of embedding_chunks = 4: must be 8",
        ),
        (
            "INSERT INTO image_chunks SELECT campaign, 2, individuals, ends, images FROM image_chunks WHERE first = 4",
            "individuals of image_chunks = 12: must be 8",
        ),
        (
            "DELETE FROM generations WHERE generation = 0",
            "rows of generations = 1",
        ),
        ("DELETE FROM labels WHERE entry = 0", "rows of labels = "),
        ("DELETE FROM taxonomies", "rows of taxonomies = 0: must be 1"),
        ("DELETE FROM embedders", "rows of embedders = 0: must be 2"),
        ("DELETE FROM exported", "rows of exported = 0: must be 1"),
        ("DELETE FROM campaigns", "to missing rows of campaigns"),
        (
            "UPDATE individual_chunks SET first = 5 WHERE first = 4",
            "individuals[4].index = 5",
        ),
        (
            "UPDATE individual_chunks SET first = 3 WHERE first = 4",
            "individuals[4].seed",
        ),
        (
            "UPDATE image_chunks SET first = 12 WHERE first = 4",
            "individuals[4].image",
        ),
        (
            "UPDATE embedding_chunks SET first = 5 WHERE first = 4",
            "individuals[4].embedding",
        ),
        (
            "UPDATE generations SET generation = 5 WHERE generation = 0",
            "generations = 6",
        ),
        (
            "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
                SELECT 9, 'case-9', spec, simulator_version, state, error, created_ms FROM campaigns",
            "rows of campaigns = 2: must be 1",
        ),
        (
            "INSERT INTO labels VALUES (9, 0, 'r', 'ana', 5, 'create', NULL, 'ring', NULL, NULL)",
            "labels: 1 row refers to missing rows of campaigns",
        ),
        (
            "INSERT INTO notices VALUES (1, 7, 5, 'text', 0)",
            "rows of notices = 1: must be 0",
        ),
        (
            "INSERT INTO trainings VALUES (7, 1, x'00')",
            "rows of trainings = 1",
        ),
        (
            "INSERT INTO quarantined VALUES (1, 'm', 5, NULL)",
            "rows of quarantined = 1",
        ),
    ] {
        assert_refused(statements, reason);
    }
}

#[test]
fn values_of_another_length_or_range_are_refused_before_they_are_read() {
    for (table, change) in [
        ("campaigns", "spec = printf('%.2000000c', 'x')"),
        ("campaigns", "study = 'mine'"),
        ("individual_chunks", "individuals = iif(first = 0, 257, -249)"),
        ("individual_chunks", "first = first - 1"),
        ("individual_chunks", "seeds = x''"),
        ("individual_chunks", "features = zeroblob(50000000)"),
        ("individual_chunks", "controllers = x''"),
        ("individual_chunks", "novelty = zeroblob(50000000)"),
        ("individual_chunks", "verdicts = x'01'"),
        ("image_chunks", "ends = x'00'"),
        ("image_chunks", "first = first + 2"),
        ("image_chunks", "images = zeroblob(50000000)"),
        ("image_chunks", "individuals = iif(first = 0, 8, 0)"),
        ("embedding_chunks", "embeddings = x'00'"),
        (
            "embedding_chunks",
            "checkpoint = (SELECT min(number) FROM checkpoints)",
        ),
        ("campaigns", "created_ms = -77"),
        ("campaigns", "rollbacks = -5"),
        ("campaigns", "label_cutoff = -3"),
        ("campaigns", "note = printf('%.40000c', 'x')"),
        ("checkpoints", "created_ms = -5"),
        ("generations", "filtered = -1"),
        ("generations", "filtered = 9223372036854775807"),
        ("labels", "annotator = printf('%.5000c', 'x')"),
        ("labels", "time_ms = -5"),
        ("checkpoints", "configuration = printf('%.70000000c', 'x')"),
        ("embedders", "model = zeroblob(67108865)"),
        ("exported", "digest = 'short'"),
        ("taxonomies", "points = x'00'"),
        ("taxonomies", "stands = 0"),
        ("taxonomies", "clusters = x'00'"),
        ("taxonomies", "made_ms = 5"),
    ] {
        assert_refused(
            &format!("UPDATE {table} SET {change}"),
            &format!("its table {table} has a value that `murmuration export` never writes"),
        );
    }
}

#[test]
fn the_longest_tags_and_note_leave_room_for_a_long_error() {
    let tags: Vec<String> = (10..26).map(|tag| format!("{}{tag}", "𝔸".repeat(30))).collect();
    let (tags, note) = (tags.join(" "), "𝔸".repeat(4_000));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    let set =
        format!("UPDATE campaigns SET tags = '{tags}', note = '{note}', error = printf('%.16000c', 'x')");
    fs::write(&file, changed(&set)).unwrap();
    let notes = contents(&file).unwrap().campaign.record.notes;
    assert_eq!(
        (notes.tags.to_string(), notes.note.as_str()),
        (tags, note.as_str())
    );
    for change in [
        "error = printf('%.16400c', 'x')",
        "tags = printf('%.20000c', 'x')",
    ] {
        let reason = "its table campaigns has a value that `murmuration export` never writes";
        assert_refused(&format!("UPDATE campaigns SET {change}"), reason);
    }
}

#[test]
fn values_that_no_campaign_has_are_named() {
    for (statements, reason) in [
        ("UPDATE campaigns SET id = '../../etc-1'", "../../etc-1"),
        (
            "UPDATE campaigns SET id = 'case-1000000000001'",
            "whose N is at most",
        ),
        (
            "UPDATE campaigns SET state = 'hidden'",
            "its campaign has no state",
        ),
        ("UPDATE campaigns SET state = 'new'", "state \"new\""),
        (
            "UPDATE campaigns SET state = 'running'",
            "rows of taxonomies = 1: must be 0",
        ),
        ("UPDATE campaigns SET weight = 0", "weight"),
        ("UPDATE campaigns SET tags = 'a <b>'", "tag = \"<b>\""),
        (
            "UPDATE campaigns SET note = printf('%.5000c', 'x')",
            "note = 5,000 characters",
        ),
        ("UPDATE campaigns SET spec = 'model = 5'", "model"),
        (
            "UPDATE campaigns SET simulator_version = '0'",
            "simulator_version",
        ),
        ("UPDATE campaigns SET rounds = 4", "rounds = 4"),
        ("UPDATE campaigns SET checkpoint = NULL", "checkpoint"),
        (
            "UPDATE individual_chunks SET generation = 7 WHERE first = 4",
            "individuals[4].generation = 7",
        ),
        (
            "UPDATE individual_chunks SET generation = -1 WHERE first = 4",
            "individual 4: its generation",
        ),
        (
            "UPDATE image_chunks SET ends = CAST(x'ffffffff' || substr(ends, 5) AS BLOB) WHERE first = 4",
            "individuals 4 to 7: values whose lengths do not fit",
        ),
        (
            "UPDATE image_chunks SET images = CAST(images || x'00' AS BLOB) WHERE first = 4",
            "individuals 4 to 7: values whose lengths do not fit",
        ),
        (
            "UPDATE generations SET best_novelty = best_novelty + 1",
            "generations[0].best_novelty",
        ),
        (
            "UPDATE generations SET mean_novelty = mean_novelty / 2",
            "generations[0].mean_novelty",
        ),
        (
            "UPDATE exported SET digest = printf('%.64c', '0')",
            "and was exported with 000",
        ),
        (
            "UPDATE exported SET digest = printf('%.64c', 'G')",
            "64 hexadecimal digits",
        ),
    ] {
        assert_refused(statements, reason);
    }
}

#[test]
fn values_that_no_individual_has_are_named() {
    for (column, beginning, reason) in [
        (
            "novelty",
            &f64::INFINITY.to_le_bytes()[..],
            "individuals[5].novelty",
        ),
        (
            "novelty",
            &(-1.0_f64).to_le_bytes(),
            "individuals[5].novelty = -1",
        ),
        (
            "novelty",
            &f64::NAN.to_le_bytes(),
            "individual 5: its novelty is not a number",
        ),
        (
            "novelty",
            &1e308_f64.to_le_bytes(),
            "individuals[5].novelty = 1e308: must be 0 or more, and at most 1e30",
        ),
        ("seeds", &[7; 8], "individuals[5].seed"),
        ("verdicts", &[1, 99], "an unknown verdict"),
        ("controllers", &f64::NAN.to_le_bytes(), "individual 5"),
        ("features", &f64::NAN.to_le_bytes(), "individuals[5].features"),
        ("features", &1e300_f64.to_le_bytes(), "individuals[5].features"),
        (
            "features",
            &(-1e12_f64).to_le_bytes(),
            "individuals[5].features.average_speed = -1e12: must be from 0.000 to",
        ),
        (
            "features",
            &1000_f64.to_le_bytes(),
            "individuals[5].features.average_speed = 1e3: must be from 0.000 to",
        ),
        ("features", &1_f64.to_le_bytes(), "its archive has digest"),
        ("embeddings", &f32::NAN.to_le_bytes(), "individuals[5].embedding"),
        (
            "embeddings",
            &1e30_f32.to_le_bytes(),
            "individuals[5].embedding[0] = 1e30: must be finite, and at most 1e12",
        ),
    ] {
        let message = refused(&changed_by(|connection| {
            edit(connection, column, 5, |value| {
                value[..beginning.len()].copy_from_slice(beginning)
            });
        }));
        assert!(message.contains(reason), "{column}\n{message}\n{reason}");
    }
    let message = refused(&changed_by(|connection| {
        edit(connection, "images", 5, |image| *image = vec![0])
    }));
    assert!(
        message.contains("individual 5: its picture is not of"),
        "{message}"
    );
}

#[test]
fn logs_that_do_not_follow_are_refused() {
    for (statements, reason) in [
        ("UPDATE labels SET action = 'drop' WHERE entry = 1", "action"),
        (
            "UPDATE labels SET supersedes = 3 WHERE entry = 4",
            "whose entries follow from each other",
        ),
        ("UPDATE labels SET entry = 90 WHERE entry = 1", "rows of labels"),
        (
            "UPDATE labels SET place = place + 800 WHERE action = 'answer'",
            "must be below 8, the individuals",
        ),
        (
            "UPDATE labels SET annotator = char(27) WHERE entry = 1",
            "annotator",
        ),
    ] {
        assert_refused(statements, reason);
    }
}

#[test]
fn checkpoints_of_others_are_refused() {
    for (statements, reason) in [
        (
            "INSERT INTO checkpoints (digest, size, parent, data_digest, label_digest, configuration, metrics, created_ms)
                VALUES (printf('%.64c', '0'), 1, '', '', '', '', '{}', 5);
             INSERT INTO embedders SELECT max(number), x'00' FROM checkpoints",
            "checkpoints that the campaign has",
        ),
        ("UPDATE checkpoints SET parent = digest", "checkpoints that the campaign has"),
        (
            "UPDATE checkpoints SET parent = printf('%.64c', '0') WHERE parent = ''",
            "is missing",
        ),
        ("UPDATE checkpoints SET size = size + 1", "embedders.model"),
        ("UPDATE embedders SET model = x'00'", "embedders.model"),
        ("UPDATE checkpoints SET metrics = '[]'", "checkpoint"),
        (
            "UPDATE checkpoints SET metrics = '{\"loss\":1e308}'",
            "checkpoints.metrics.loss = 1e308: must be finite, and at most 1e15",
        ),
        (
            "UPDATE checkpoints SET metrics = '{\"lo\\u001bss\":1}'",
            "checkpoints.metrics = \"lo\\u{1b}ss\"",
        ),
        ("UPDATE checkpoints SET digest = 'x' WHERE parent = ''", "must be 64 hexadecimal digits"),
    ] {
        assert_refused(statements, reason);
    }
}

#[test]
fn taxonomies_that_no_archive_has_are_named() {
    let swapped = "medoids = CAST(substr(medoids, 9, 8) || substr(medoids, 1, 8) AS BLOB)";
    let second =
        |index: u8| format!("medoids = CAST(substr(medoids, 1, 8) || x'{index:02x}00000000000000' AS BLOB)");
    for (change, reason) in [
        ("loss = -1".to_owned(), "loss = -1"),
        (
            "loss = 1e308".to_owned(),
            "loss = 1e308: must be 0 or more, and at most 1e30",
        ),
        (
            "measures = CAST(substr(measures, 1, 8) || x'000000000000f0bf' || substr(measures, 17) AS BLOB)"
                .to_owned(),
            "medoids[0].novelty = -1",
        ),
        (second(8), "medoids[1].index = 8"),
        (second(2), "medoids[1].index = 2"),
        (swapped.to_owned(), "medoids[0].index = 5"),
        (
            "medoids = substr(medoids, 1, 8), measures = substr(measures, 1, 16)".to_owned(),
            "do not fit each other",
        ),
        (
            "clusters = CAST(substr(clusters, 1, 16) || x'01000000' || substr(clusters, 21) AS BLOB)"
                .to_owned(),
            "the largest cluster first",
        ),
        (
            "robust_trials = x'0000000000000003'".to_owned(),
            "robust_trials = 3",
        ),
    ] {
        assert_refused(&format!("UPDATE taxonomies SET {change}"), reason);
    }
}
