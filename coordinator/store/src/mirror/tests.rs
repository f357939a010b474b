use super::*;
use crate::{doctor, open::LONG_LOG};
use murmuration_model::Weight;
use murmuration_swarm::CampaignSpec;
use proptest::prelude::*;
use rusqlite::Connection;
use std::{fs, sync::atomic::Ordering, time::Duration};

struct Place {
    folder: tempfile::TempDir,
}

/// A data directory with its store.
struct Node {
    data: DataDirectory,
    store: Store,
}

impl Place {
    fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
        }
    }

    fn mirror(&self) -> String {
        self.folder.path().join("mirror").display().to_string()
    }

    async fn claim(&self, name: &str, from_mirror: bool) -> Result<(DataDirectory, Claimed), MirrorError> {
        let data = DataDirectory::hold(&self.folder.path().join(name))?;
        let claimed = claim(&data, &self.mirror(), from_mirror).await?;
        Ok((data, claimed))
    }

    async fn start(&self, name: &str, from_mirror: bool) -> Result<Node, MirrorError> {
        let (data, claimed) = self.claim(name, from_mirror).await?;
        let store = Store::open(&data)?.mirrored(claimed).await?;
        Ok(Node { data, store })
    }
}

impl Node {
    async fn add(&self, bytes: usize) -> Result<(), StoreError> {
        add(&self.store, bytes).await
    }

    fn rows(&self) -> Vec<(i64, String)> {
        let read = |connection: &Connection| {
            let mut rows = connection.prepare("SELECT id, hex(note) FROM notes ORDER BY id")?;
            let rows = rows.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
            Ok(rows.collect::<Result<_, _>>()?)
        };
        self.store.read(read).unwrap()
    }

    /// Ends abruptly: what is not in the mirror is lost.
    fn end(self) -> Vec<(i64, String)> {
        let rows = self.rows();
        let Self { data, store } = self;
        drop((store, data));
        rows
    }
}

/// Adds a row of so many bytes, as a decision: in the mirror when this returns.
async fn add(store: &Store, bytes: usize) -> Result<(), StoreError> {
    let add = move |store: &Store| {
        store.write(|transaction| {
            transaction
                .execute_batch("CREATE TABLE IF NOT EXISTS notes (id INTEGER PRIMARY KEY, note BLOB)")?;
            transaction.execute("INSERT INTO notes (note) VALUES (randomblob(?1))", [bytes as i64])?;
            Ok(())
        })
    };
    store.change(add).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_new_directory_goes_on_with_all_that_was_acknowledged() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    // Longer than a piece, and than the log before it is written into the database.
    for bytes in [10, 6 << 20, 100, 2 << 20, 1 << 20, 10] {
        first.add(bytes).await.unwrap();
    }
    let acknowledged = first.end();
    let second = place.start("second", true).await.unwrap();
    assert!(second.rows() == acknowledged);
    assert!(second.store.faults().unwrap().is_empty());
    second.add(20).await.unwrap();
    let acknowledged = second.end();
    // The same directory goes on without the mirror's help.
    let again = place.start("second", true).await.unwrap();
    again.add(30).await.unwrap();
    assert_eq!(again.rows()[..acknowledged.len()], acknowledged);
    let acknowledged = again.end();
    let third = place.start("third", true).await.unwrap();
    assert!(third.rows() == acknowledged);
    let data = third.data.path().to_path_buf();
    third.store.close();
    third.end();
    assert!(doctor::examine(&data, None).await.unwrap().is_healthy());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_writer_from_whose_mirror_another_has_gone_on_acknowledges_nothing_more() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.rows();
    let second = place.start("second", true).await.unwrap();
    let refused = first.add(10).await.unwrap_err();
    assert!(matches!(refused, StoreError::MirrorTaken(_)), "{refused}");
    let told = first.store.mirror_taken_over().await;
    assert!(matches!(told, StoreError::MirrorTaken(_)));
    assert!(second.rows() == acknowledged);
    second.add(10).await.unwrap();
    first.end();
    for from_mirror in [false, true] {
        let refused = place.start("first", from_mirror).await.err().unwrap();
        let expected = match from_mirror {
            false => matches!(refused, MirrorError::Foreign(_)),
            true => matches!(refused, MirrorError::NotEmpty { .. }),
        };
        assert!(expected, "{refused}");
    }
    let refused = place.start("third", false).await.err().unwrap();
    assert!(matches!(refused, MirrorError::Foreign(_)), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_that_go_on_at_once_the_last_one_does() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    let (early, early_claim) = place.claim("early", true).await.unwrap();
    let late = place.start("late", true).await.unwrap();
    let refused = Store::open(&early)
        .unwrap()
        .mirrored(early_claim)
        .await
        .unwrap_err();
    assert!(
        matches!(refused, MirrorError::Store(StoreError::MirrorTaken(_))),
        "{refused}"
    );
    late.add(10).await.unwrap();
    assert_eq!(late.rows()[..1], acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn without_the_mirror_decisions_are_refused_and_runs_go_on() {
    let place = Place::new();
    let node = place.start("first", false).await.unwrap();
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
    let id = node.store.create_campaign(&spec, Weight::default(), 0).unwrap();
    node.add(10).await.unwrap();
    let log = place.folder.path().join("mirror/log");
    let away = place.folder.path().join("mirror/away");
    fs::rename(&log, &away).unwrap();
    fs::write(&log, "").unwrap();
    let waiting = tokio::spawn({
        let store = node.store.clone();
        async move { add(&store, 10).await }
    });
    while node.store.mirror.as_ref().unwrap().check(false).is_ok() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let refused = node.add(10).await.unwrap_err();
    assert!(matches!(refused, StoreError::NoMirror { .. }), "{refused}");
    assert!(refused.may_pass());
    let run = node.store.campaign(id.as_str()).unwrap().run_id();
    node.store.during(run).write(|_| Ok(())).unwrap();
    fs::remove_file(&log).unwrap();
    fs::rename(&away, &log).unwrap();
    waiting.await.unwrap().unwrap();
    node.add(10).await.unwrap();
    let acknowledged = node.end();
    assert_eq!(acknowledged.len(), 3);
    assert!(place.start("second", true).await.unwrap().rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_mirror_gives_no_database() {
    let place = Place::new();
    let node = place.start("first", false).await.unwrap();
    node.add(10_000).await.unwrap();
    node.end();
    let log = place.folder.path().join("mirror/log");
    let mut entries: Vec<_> = fs::read_dir(log)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    entries.sort();
    let victim = entries.last().unwrap();
    let mut bytes = fs::read(victim).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(victim, bytes).unwrap();
    let damaged = place.start("second", true).await.err().unwrap();
    assert!(matches!(damaged, MirrorError::Damaged { .. }), "{damaged}");
    assert!(!place.folder.path().join("second").join(Store::FILE).exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn old_entries_and_snapshots_are_removed() {
    let place = Place::new();
    let node = place.start("first", false).await.unwrap();
    for _ in 0..40 {
        node.add(LONG_LOG as usize / 4).await.unwrap();
        // Changes that replace each other, so that the database stays small.
        let clear = |store: &Store| {
            store.write(|transaction| Ok(transaction.execute_batch("DELETE FROM notes WHERE id % 10 > 0")?))
        };
        node.store.change(clear).await.unwrap();
    }
    let entries = fs::read_dir(place.folder.path().join("mirror/log"))
        .unwrap()
        .count();
    let snapshots = fs::read_dir(place.folder.path().join("mirror/snapshots"))
        .unwrap()
        .count();
    assert!(entries < 60 && snapshots <= 2, "{entries} {snapshots}");
    let acknowledged = node.end();
    assert!(place.start("second", true).await.unwrap().rows() == acknowledged);
}

#[derive(Debug, Clone, Copy)]
enum Step {
    Add(usize),
    /// The disk fails, so that the log is emptied at the next change.
    FailSync,
    /// The process ends, and another one goes on in the same directory or from the mirror.
    Restart {
        elsewhere: bool,
    },
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (1_usize..300_000).prop_map(Step::Add),
        1 => Just(Step::FailSync),
        1 => any::<bool>().prop_map(|elsewhere| Step::Restart { elsewhere }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever happens, the mirror has all acknowledged changes.
    #[test]
    fn a_mirror_never_loses_an_acknowledged_change(steps in prop::collection::vec(step(), 1..25)) {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        runtime.block_on(async {
            let place = Place::new();
            let mut name = 0;
            let mut node = place.start("0", false).await.unwrap();
            node.add(1).await.unwrap();
            for step in steps {
                match step {
                    Step::Add(bytes) => node.add(bytes).await.unwrap(),
                    Step::FailSync => node.store.sync_failed.store(true, Ordering::Relaxed),
                    Step::Restart { elsewhere } => {
                        let acknowledged = node.end();
                        name += usize::from(elsewhere);
                        node = place.start(&name.to_string(), true).await.unwrap();
                        assert!(node.rows() == acknowledged);
                    }
                }
            }
            let acknowledged = node.end();
            let last = place.start("last", true).await.unwrap();
            assert!(last.rows() == acknowledged);
        });
    }
}
