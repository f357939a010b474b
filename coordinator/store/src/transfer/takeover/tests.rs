//! Tests of the import of a campaign into a store that already has other campaigns.

use super::*;
use crate::DataDirectory;
use murmuration_model::Weight;
use murmuration_swarm::CampaignSpec;
use rusqlite::params;
use std::path::Path;

const SPEC: &str = "model = \"single-sensor\"\nmethod = \"random\"\n[search]\npopulation = 2\ngenerations = 3\n[taxonomy]\nmedoids = 2\n";

fn open(folder: &Path) -> Store {
    Store::open(&DataDirectory::hold(folder).unwrap()).unwrap()
}

fn run(store: &Store, statements: &str) {
    store
        .write(|transaction| Ok(transaction.execute_batch(statements)?))
        .unwrap();
}

fn count(store: &Store, query: &str) -> i64 {
    store
        .read(|connection| Ok(connection.query_row(query, [], |row| row.get(0))?))
        .unwrap()
}

fn read(store: &Store) -> ExportedCampaign {
    let record = store.campaigns().unwrap().pop().unwrap();
    ExportedCampaign {
        record,
        label_entries: 50,
        digest: String::new(),
    }
}

fn created(store: &Store) -> CampaignId {
    let spec = CampaignSpec::from_toml(SPEC).unwrap();
    store.create_campaign(&spec, Weight::default(), 7).unwrap()
}

/// A store with a campaign that has rows in every copied table. The second checkpoint, `b`, embeds the campaign, which is moving
/// to the third checkpoint, `c`.
fn source(folder: &Path) -> (Store, CampaignId) {
    let store = open(folder);
    let id = created(&store);
    for digest in ["a", "b", "c"] {
        add_checkpoint(&store, digest);
    }
    store
        .write(|transaction| {
            transaction.execute(
                "UPDATE campaigns SET checkpoint = 2, next_checkpoint = 3, state = 'paused'",
                [],
            )?;
            for place in 0..50 {
                transaction.execute("INSERT INTO generations VALUES (1, ?1, 1.0, 0.5, 3)", [place])?;
                transaction.execute(
                    "INSERT INTO individual_chunks VALUES (1, ?1, 1, ?1, zeroblob(8), x'00', zeroblob(100), zeroblob(8), x'')",
                    [place],
                )?;
                transaction.execute(
                    "INSERT INTO image_chunks VALUES (1, ?1, 1, x'c8000000', zeroblob(200))",
                    [place],
                )?;
                transaction.execute(
                    "INSERT INTO embedding_chunks VALUES (1, ?1, ?2, 1, x'0102')",
                    params![2 + place % 2, place],
                )?;
                transaction.execute(
                    "INSERT INTO labels VALUES (1, ?1, 'r', 'ana', 5, 'create', NULL, 'ring', NULL, NULL)",
                    [place],
                )?;
            }
            transaction.execute(
                "INSERT INTO taxonomies VALUES (1, 1, 1, 5, NULL, 0, 1, x'', x'', 0.5, x'', x'', x'')",
                [],
            )?;
            Ok(())
        })
        .unwrap();
    (store, id)
}

fn add_checkpoint(store: &Store, digest: &str) {
    let insert =
        "INSERT INTO checkpoints (digest, size, parent, data_digest, label_digest, configuration, metrics,
                      created_ms) VALUES (?1, 1, '', '', '', '', '{}', 5)";
    store
        .write(|transaction| Ok(transaction.execute(insert, [digest.repeat(64)])?))
        .unwrap();
}

#[test]
fn campaigns_and_checkpoints_have_other_numbers_beside_others() {
    let folder = tempfile::tempdir().unwrap();
    let (from, id) = source(&folder.path().join("from"));
    let to = open(&folder.path().join("to"));
    // In this store the checkpoints have other numbers, and the checkpoint `c` exists already.
    for digest in ["d", "e", "c"] {
        add_checkpoint(&to, digest);
    }
    let own = CampaignSpec::from_toml(&format!("name = \"own\"\n{SPEC}")).unwrap();
    to.create_campaign(&own, Weight::default(), 0).unwrap();
    assert!(to.take_over(&from, &read(&from)).unwrap());
    let number = count(&to, &format!("SELECT number FROM campaigns WHERE id = '{id}'"));
    assert_eq!(number, 2);
    for table in TABLES {
        let all = count(&from, &format!("SELECT count(*) FROM {table}"));
        let taken = format!("SELECT count(*) FROM {table} WHERE campaign = {number}");
        assert_eq!(count(&to, &taken), all, "{table}");
    }
    for (digest, places) in [("b", 25), ("c", 25), ("a", 0)] {
        let embedded = format!(
            "SELECT count(*) FROM embedding_chunks WHERE campaign = 2
             AND checkpoint = (SELECT number FROM checkpoints WHERE substr(digest, 1, 1) = '{digest}')"
        );
        assert_eq!(count(&to, &embedded), places, "{digest}");
    }
    let of = |column: &str| {
        let query = format!(
            "SELECT unicode(digest) FROM checkpoints k JOIN campaigns c ON k.number = c.{column} WHERE c.number = 2"
        );
        count(&to, &query)
    };
    assert_eq!(
        (of("checkpoint"), of("next_checkpoint")),
        (i64::from(b'b'), i64::from(b'c'))
    );
    assert_eq!(to.dangling().unwrap(), Vec::<String>::new());
    assert!(!to.take_over(&from, &read(&from)).unwrap(), "it is there");
    assert_eq!(count(&to, "SELECT count(*) FROM campaigns"), 2);
}

#[test]
fn an_id_with_a_high_number_leaves_numbers_for_new_campaigns() {
    let folder = tempfile::tempdir().unwrap();
    let (from, id) = source(&folder.path().join("from"));
    for (number, next) in [(1_000_000_000_000_u64, 2), (40, 41)] {
        let to = open(&folder.path().join(format!("to-{number}")));
        let named = format!("{}-{number}", id.as_str().rsplit_once('-').unwrap().0);
        run(&from, &format!("UPDATE campaigns SET id = '{named}'"));
        assert!(to.take_over(&from, &read(&from)).unwrap());
        assert_eq!(created(&to).number(), Some(next), "after {named}");
    }
}

#[test]
fn nobody_sees_a_campaign_that_is_not_whole_and_nothing_of_it_stays() {
    let folder = tempfile::tempdir().unwrap();
    let (from, _) = source(&folder.path().join("from"));
    let to = open(&folder.path().join("to"));
    run(
        &to,
        "CREATE TRIGGER full BEFORE INSERT ON labels WHEN NEW.entry = 40
         BEGIN SELECT RAISE (ABORT, 'the disk is full'); END",
    );
    to.take_over(&from, &read(&from)).unwrap_err();
    for table in TABLES.into_iter().chain(["campaigns"]) {
        assert_eq!(count(&to, &format!("SELECT count(*) FROM {table}")), 0, "{table}");
    }
    run(&to, "DROP TRIGGER full");
    assert!(to.take_over(&from, &read(&from)).unwrap());
}

#[test]
fn what_a_process_that_ended_has_left_is_never_shown_and_is_removed_by_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let (from, id) = source(&folder.path().join("from"));
    let data = folder.path().join("to");
    let to = open(&data);
    let number = to.reserve(&id).unwrap().unwrap();
    let begun = from.read(|source| {
        let checkpoints = to.write(|target| take_checkpoints(source, target))?;
        Copied {
            source,
            target: &to,
            campaign: number,
            checkpoints,
        }
        .table("individual_chunks")
    });
    begun.unwrap();
    assert_eq!(count(&to, "SELECT count(*) FROM individual_chunks"), 50);
    assert!(to.campaigns().unwrap().is_empty() && to.campaign_ids().unwrap().is_empty());
    assert!(matches!(to.campaign("latest"), Err(StoreError::NoCampaign(_))));
    assert!(matches!(
        to.campaign(&hidden_id(number)),
        Err(StoreError::NoCampaign(_))
    ));
    let later = created(&to);
    assert_ne!(later.number(), Some(number.unsigned_abs()));
    let half = data.join(".transfer-abc");
    std::fs::create_dir(&half).unwrap();
    drop(to);
    let to = open(&data);
    assert_eq!(count(&to, "SELECT count(*) FROM individual_chunks"), 0);
    assert_eq!(to.campaigns().unwrap().len(), 1);
    assert!(!half.exists());
}
