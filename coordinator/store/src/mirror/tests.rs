use super::{writers::FILE, *};
use crate::{doctor, files::log_of, open::LONG_LOG};
use murmuration_model::Weight;
use murmuration_swarm::CampaignSpec;
use proptest::prelude::*;
use rusqlite::Connection;
use std::{
    fs::{self, File},
    sync::atomic::Ordering,
    time::{Duration, SystemTime},
};

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
        let store = Store::open_claimed(&data, &claimed)?.mirrored(claimed).await?;
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
    let data = DataDirectory::hold(&place.folder.path().join("first")).unwrap();
    let alone = Store::open(&data).unwrap_err().to_string();
    assert!(
        alone.contains(&place.mirror()) && alone.contains("mirror.json"),
        "{alone}"
    );
    drop(data);
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
async fn a_writer_that_changes_nothing_notices_its_successor_too() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let second = place.start("second", true).await.unwrap();
    let told = tokio::time::timeout(Duration::from_secs(30), first.store.mirror_taken_over()).await;
    assert!(matches!(told, Ok(StoreError::MirrorTaken(_))), "{told:?}");
    second.add(10).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_that_go_on_at_once_the_last_one_does() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    let (early, early_claim) = place.claim("early", true).await.unwrap();
    let late = place.start("late", true).await.unwrap();
    let refused = Store::open_claimed(&early, &early_claim)
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
async fn a_change_waits_for_a_mirror_that_fails_no_longer_than_its_limit() {
    let place = Place::new();
    let node = place.start("first", false).await.unwrap();
    node.add(10).await.unwrap();
    // As if the file system of the mirror were not mounted any more: there is an empty folder in its place.
    let [mirror, away] = ["mirror", "away"].map(|name| place.folder.path().join(name));
    fs::rename(&mirror, &away).unwrap();
    let unknown = node.add(10).await.unwrap_err();
    assert!(matches!(unknown, StoreError::Unmirrored { .. }), "{unknown}");
    let refused = node.add(10).await.unwrap_err();
    assert!(matches!(refused, StoreError::NoMirror { .. }), "{refused}");
    assert!(
        refused.to_string().contains("the mirror has lost its entries"),
        "{refused}"
    );
    // Nothing is written where the claim is not, so the folder was not made anew.
    fs::rename(&away, &mirror).unwrap();
    while node.add(10).await.is_err() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let acknowledged = node.end();
    assert_eq!(acknowledged.len(), 3);
    assert!(place.start("second", true).await.unwrap().rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_change_that_is_not_noted_is_not_acknowledged_when_it_is_repeated() {
    let place = Place::new();
    let node = place.start("first", false).await.unwrap();
    node.add(10).await.unwrap();
    let mirror = node.store.mirror.clone().unwrap();
    mirror.miss_next_note();
    assert!(matches!(node.add(10).await, Err(StoreError::Unmirrored { .. })));
    node.store.reach_mirror().await.unwrap();
    let acknowledged = node.end();
    assert_eq!(acknowledged.len(), 2);
    assert!(place.start("second", true).await.unwrap().rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_that_is_refused_is_refused_again() {
    let place = Place::new();
    drop(Store::open(&DataDirectory::hold(&place.folder.path().join("stranger")).unwrap()).unwrap());
    // The first coordinator has claimed the mirror, and has not written its snapshot yet.
    let (data, claimed) = place.claim("first", false).await.unwrap();
    let (early, _) = place.claim("stranger", false).await.unwrap();
    assert_eq!(Writers::read(early.path()).unwrap().here.former, "");
    drop(early);
    let late = Store::open_claimed(&data, &claimed)
        .unwrap()
        .mirrored(claimed)
        .await;
    assert!(matches!(
        late,
        Err(MirrorError::Store(StoreError::MirrorTaken(_)))
    ));
    drop((late, data));
    // An empty directory must not end a coordinator that writes its first snapshot.
    let refused = place.start("empty", true).await.err().unwrap();
    assert!(matches!(refused, MirrorError::Damaged { .. }), "{refused}");
    let stranger = place.start("stranger", false).await.unwrap();
    stranger.add(10).await.unwrap();
    stranger.end();
    let elsewhere = place.folder.path().join("elsewhere").display().to_string();
    let data = DataDirectory::hold(&place.folder.path().join("stranger")).unwrap();
    let known = fs::read(data.path().join(FILE)).unwrap();
    let other = claim(&data, &elsewhere, false).await.unwrap();
    drop(other);
    fs::write(data.path().join(FILE), &known).unwrap();
    // A mirror that refuses the directory leaves it with its own.
    let other = Place::new();
    let node = other.start("other", false).await.unwrap();
    node.add(10).await.unwrap();
    node.end();
    let refused = claim(&data, &other.mirror(), false).await.unwrap_err();
    assert!(matches!(refused, MirrorError::Foreign(_)), "{refused}");
    assert!(fs::read(data.path().join(FILE)).unwrap() == known);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_empty_folder_does_not_replace_a_mirror_that_had_data() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    first.end();
    fs::rename(place.mirror(), place.folder.path().join("away")).unwrap();
    let refused = place.start("first", false).await.err().unwrap();
    assert!(matches!(refused, MirrorError::Gone(_)), "{refused}");
    fs::remove_file(place.folder.path().join("first").join(FILE)).unwrap();
    place.start("first", false).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_database_of_a_newer_version_is_not_taken_from_its_writer() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    let newer =
        |store: &Store| store.write(|change| Ok(change.pragma_update(None, "user_version", 9_999)?));
    first.store.change(newer).await.unwrap();
    let refused = place.start("second", true).await.err().unwrap();
    assert!(
        matches!(refused, MirrorError::Store(StoreError::Newer { .. })),
        "{refused}"
    );
    first.add(10).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mirror_with_claims_alone_is_empty() {
    let place = Place::new();
    drop(place.claim("first", false).await.unwrap());
    drop(place.claim("second", true).await.unwrap());
    let third = place.start("third", false).await.unwrap();
    third.add(10).await.unwrap();
    let acknowledged = third.end();
    assert!(place.start("fourth", true).await.unwrap().rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_database_that_is_a_link_is_mirrored() {
    let place = Place::new();
    let [data, elsewhere] = ["first", "elsewhere"].map(|name| place.folder.path().join(name));
    drop(Store::open(&DataDirectory::hold(&data).unwrap()).unwrap());
    fs::create_dir(&elsewhere).unwrap();
    let [database, file] = [&data, &elsewhere].map(|folder| folder.join(Store::FILE));
    fs::rename(&database, &file).unwrap();
    let _ = fs::remove_file(log_of(&database));
    std::os::unix::fs::symlink(&file, &database).unwrap();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    assert!(place.start("second", true).await.unwrap().rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn only_the_database_that_was_made_from_the_mirror_goes_on_with_it() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    place.start("second", true).await.unwrap().end();
    // As a process leaves it that ends just after the database has its place.
    let data = place.folder.path().join("second");
    let inode = data.join(Store::FILE).metadata().unwrap().ino();
    let known = |database| {
        let mut writers = Writers::read(&data).unwrap();
        writers.here.restoring = true;
        writers.here.database = Some(database);
        writers
    };
    known(inode + 1).write(&data).unwrap();
    let other = place.start("second", true).await.err().unwrap();
    assert!(matches!(other, MirrorError::NotEmpty { .. }), "{other}");
    known(inode).write(&data).unwrap();
    assert!(place.start("second", true).await.unwrap().rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_older_database_that_was_put_back_in_place_is_refused() {
    let place = Place::new();
    let data = place.folder.path().join("first");
    let files = || [Store::FILE.to_owned(), format!("{}-wal", Store::FILE)].map(|name| data.join(name));
    // Keeps the inode of each file, as `cp` does.
    let put_back = |contents: [Vec<u8>; 2]| {
        for (file, contents) in files().iter().zip(contents) {
            fs::write(file, contents).unwrap();
        }
    };
    let read = || files().map(|file| fs::read(file).unwrap_or_default());
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    // A copy of the same run of the coordinator that later ends abruptly.
    let older = read();
    first.add(10).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    let newer = read();
    put_back(older);
    for from_mirror in [false, true] {
        let refused = place.start("first", from_mirror).await.err().unwrap();
        assert!(
            matches!(refused, MirrorError::SetBack { missing: 2, .. }),
            "{refused}"
        );
    }
    // The refusal changed nothing, and the newest database goes on.
    put_back(newer);
    let again = place.start("first", false).await.unwrap();
    assert!(again.rows() == acknowledged);
    let older = read();
    again.add(10).await.unwrap();
    again.store.close();
    let acknowledged = again.end();
    put_back(older);
    let refused = place.start("first", false).await.err().unwrap();
    assert!(
        matches!(refused, MirrorError::SetBack { missing: 1, .. }),
        "{refused}"
    );
    assert!(place.start("second", true).await.unwrap().rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mirror_within_the_data_directory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let data = DataDirectory::hold(folder.path()).unwrap();
    let within = folder.path().join("mirror").display().to_string();
    let refused = claim(&data, &within, false).await.unwrap_err();
    assert!(matches!(refused, MirrorError::Location { .. }), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn snapshots_of_a_successor_are_not_removed() {
    let folder = tempfile::tempdir().unwrap();
    let objects = open(&folder.path().display().to_string(), Path::new("/nowhere")).unwrap();
    let entries = Entries { objects };
    let snapshots = folder.path().join("snapshots");
    fs::create_dir(&snapshots).unwrap();
    let names = [1_u64, 5, 9].map(|begins| entries::snapshot_name(begins, "a"));
    names
        .iter()
        .for_each(|name| fs::write(folder.path().join(name), "").unwrap());
    tokio::time::sleep(Duration::from_millis(20)).await;
    entries.remove_before(5, &names[1]).await;
    let left = names.iter().map(|name| folder.path().join(name).exists());
    assert_eq!(left.collect::<Vec<_>>(), [false, true, true]);
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
    let newest = entries
        .last()
        .map(|entry| fs::read_dir(entry.parent().unwrap()).unwrap().count());
    // A mirror from which no database can be made is not taken from its writer.
    assert_eq!(newest, Some(entries.len()));
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

#[tokio::test(flavor = "multi_thread")]
async fn an_attempt_that_fails_does_not_forget_that_the_mirror_had_data() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    // Killed before its snapshot.
    drop(place.claim("first", false).await.unwrap());
    let [mirror, away] = ["mirror", "away"].map(|name| place.folder.path().join(name));
    fs::rename(&mirror, &away).unwrap();
    fs::create_dir(&mirror).unwrap();
    for _ in 0..2 {
        let refused = place.start("first", false).await.err().unwrap();
        assert!(matches!(refused, MirrorError::Gone(_)), "{refused}");
    }
    fs::remove_dir_all(&mirror).unwrap();
    fs::rename(&away, &mirror).unwrap();
    let again = place.start("first", false).await.unwrap();
    assert!(again.end() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_attempt_with_another_mirror_leaves_the_directory_its_own() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    for name in ["one", "other"] {
        let elsewhere = place.folder.path().join(name);
        fs::create_dir(&elsewhere).unwrap();
        // Nothing can be written there.
        fs::write(elsewhere.join("log"), "").unwrap();
        let data = DataDirectory::hold(&place.folder.path().join("first")).unwrap();
        claim(&data, &elsewhere.display().to_string(), false)
            .await
            .unwrap_err();
    }
    let again = place.start("first", false).await.unwrap();
    again.add(10).await.unwrap();
    assert_eq!(again.end()[..1], acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn once_another_mirror_has_the_database_the_former_one_is_foreign() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    first.end();
    let elsewhere = place.folder.path().join("elsewhere").display().to_string();
    let data = DataDirectory::hold(&place.folder.path().join("first")).unwrap();
    let claimed = claim(&data, &elsewhere, false).await.unwrap();
    drop(
        Store::open_claimed(&data, &claimed)
            .unwrap()
            .mirrored(claimed)
            .await
            .unwrap(),
    );
    drop(data);
    // Its database could be another one by now, or an older one.
    let refused = place.start("first", false).await.err().unwrap();
    assert!(matches!(refused, MirrorError::Foreign(_)), "{refused}");
    let data = DataDirectory::hold(&place.folder.path().join("first")).unwrap();
    claim(&data, &elsewhere, false).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_new_database_does_not_pass_for_the_one_that_had_the_mirror() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    first.end();
    fs::remove_file(place.folder.path().join("first").join(Store::FILE)).unwrap();
    let elsewhere = place.folder.path().join("elsewhere").display().to_string();
    let data = DataDirectory::hold(&place.folder.path().join("first")).unwrap();
    // Killed before its snapshot.
    let claimed = claim(&data, &elsewhere, false).await.unwrap();
    drop(Store::open_claimed(&data, &claimed).unwrap());
    drop(data);
    let refused = place.start("first", false).await.err().unwrap();
    assert!(matches!(refused, MirrorError::Foreign(_)), "{refused}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_snapshot_that_went_elsewhere_replaces_no_former_one() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    let (data, claimed) = place.claim("first", false).await.unwrap();
    // The file system of the mirror is not mounted while the snapshot is written.
    let [mirror, away] = ["mirror", "away"].map(|name| place.folder.path().join(name));
    fs::rename(&mirror, &away).unwrap();
    let store = Store::open_claimed(&data, &claimed).unwrap();
    let starting = tokio::spawn(store.mirrored(claimed));
    let is_written = || {
        let snapshots = fs::read_dir(mirror.join("snapshots"))
            .into_iter()
            .flatten()
            .flatten();
        snapshots
            .into_iter()
            .any(|file| !file.file_name().to_string_lossy().contains('#'))
    };
    while !is_written() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    while fs::remove_dir_all(&mirror)
        .and_then(|()| fs::rename(&away, &mirror))
        .is_err()
    {}
    // It can be refused, or be written anew.
    if let Ok(store) = starting.await.unwrap() {
        add(&store, 10).await.unwrap();
    }
    drop(data);
    let second = place.start("second", true).await.unwrap();
    assert_eq!(second.rows()[..1], acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_claim_among_removed_entries_does_not_count() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    let data = DataDirectory::hold(&place.folder.path().join("late")).unwrap();
    let mut late = Claimed {
        entries: Entries {
            objects: open(&place.mirror(), data.path()).unwrap(),
        },
        writer: "late".to_owned(),
        claim: (0, Bytes::new()),
        next: 1,
        epoch: 1,
        epoch_begins: 1,
        changes: None,
        is_placed: false,
    };
    late.follow(2, 1).unwrap();
    let third = place.folder.path().join("mirror/log/00000000000000000003");
    first.add(2000).await.unwrap();
    assert!(third.exists());
    // A later snapshot makes the earlier entries needless.
    while third.exists() {
        first.add(LONG_LOG as usize).await.unwrap();
    }
    let mut known = Writers::default();
    assert!(!late.place_claim(data.path(), &mut known, &[]).await.unwrap());
    first.add(10).await.unwrap();
    let acknowledged = first.end();
    let second = place.start("second", true).await.unwrap();
    assert!(second.rows() == acknowledged);
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_written_where_the_claim_is_not() {
    let place = Place::new();
    let node = place.start("first", false).await.unwrap();
    node.add(10).await.unwrap();
    let [mirror, away] = ["mirror", "away"].map(|name| place.folder.path().join(name));
    fs::rename(&mirror, &away).unwrap();
    assert!(matches!(node.add(10).await, Err(StoreError::Unmirrored { .. })));
    assert!(!mirror.exists());
    node.end();
    // Earlier versions wrote an entry into the empty folder under a file system that was not mounted.
    let newest = fs::read_dir(away.join("log"))
        .unwrap()
        .map(|file| file.unwrap().file_name())
        .max()
        .unwrap();
    fs::create_dir_all(mirror.join("log")).unwrap();
    fs::copy(away.join("log").join(&newest), mirror.join("log").join(&newest)).unwrap();
    let refused = place.start("first", false).await.err().unwrap();
    assert!(matches!(refused, MirrorError::Gone(_)), "{refused}");
    fs::remove_dir_all(&mirror).unwrap();
    fs::rename(&away, &mirror).unwrap();
    assert_eq!(place.start("first", false).await.unwrap().rows().len(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_database_does_not_end_the_coordinator_that_has_the_mirror() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(10).await.unwrap();
    let copy = place.folder.path().join("copy");
    fs::create_dir(&copy).unwrap();
    fs::copy(place.folder.path().join("first").join(FILE), copy.join(FILE)).unwrap();
    fs::write(
        copy.join(Store::FILE),
        "no database, but long enough to be opened as one".repeat(100),
    )
    .unwrap();
    let refused = place.start("copy", false).await.err().unwrap();
    assert!(matches!(refused, MirrorError::Store(_)), "{refused}");
    first.add(10).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mirror_without_room_is_not_taken_from_its_writer() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    first.add(1 << 20).await.unwrap();
    // No object can be written into a folder that is a file.
    let trials = place.folder.path().join("mirror").join("trials");
    fs::write(&trials, "").unwrap();
    let refused = place.start("second", true).await.err().unwrap();
    assert!(
        matches!(refused, MirrorError::NoRoom { bytes, .. } if bytes > 1 << 20),
        "{refused}"
    );
    first.add(10).await.unwrap();
    fs::remove_file(&trials).unwrap();
    let second = place.start("second", true).await.unwrap();
    assert!(second.rows() == first.rows());
}

#[tokio::test(flavor = "multi_thread")]
async fn old_files_that_killed_processes_left_unfinished_are_removed() {
    let place = Place::new();
    let mirror = PathBuf::from(place.mirror());
    let names = [
        "trials/0123456789abcdef#1",
        "log/00000000000000000002#1",
        "log/00000000000000000007#12",
        "snapshots/00000000000000000001-ab#1",
    ];
    let make = |name: &str, age: Duration| {
        let path = mirror.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "part").unwrap();
        let file = File::options().write(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() - age).unwrap();
    };
    for name in names {
        make(name, Duration::from_secs(7200));
    }
    // A living process may be writing a young file, and the others are not the mirror's.
    let kept = ["log/00000000000000000003#1", "log/notes#", "log/notes#2a"];
    make(kept[0], Duration::from_secs(600));
    make(kept[1], Duration::from_secs(7200));
    make(kept[2], Duration::from_secs(7200));
    let node = place.start("first", false).await.unwrap();
    let until = Instant::now() + Duration::from_secs(10);
    while names.iter().any(|name| mirror.join(name).exists()) && Instant::now() < until {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(names.map(|name| mirror.join(name).exists()), [false; 4]);
    assert_eq!(kept.map(|name| mirror.join(name).exists()), [true; 3]);
    drop(node);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_missing_from_a_mirror_is_named() {
    let place = Place::new();
    let first = place.start("first", false).await.unwrap();
    for _ in 0..3 {
        first.add(2000).await.unwrap();
    }
    first.end();
    let log = place.folder.path().join("mirror/log");
    fs::remove_file(log.join("00000000000000000003")).unwrap();
    let refused = place.start("second", true).await.err().unwrap().to_string();
    assert!(
        refused.contains("00000000000000000003") && refused.contains("damaged"),
        "{refused}"
    );
    // The time can end before the attempts.
    let data = DataDirectory::hold(&place.folder.path().join("third")).unwrap();
    let refused = claim_within(&data, &place.mirror(), true, Duration::from_millis(10)).await;
    assert!(matches!(refused, Err(MirrorError::Damaged { .. })), "{refused:?}");
    fs::remove_dir_all(&log).unwrap();
    let refused = place.start("second", true).await.err().unwrap().to_string();
    assert!(refused.contains("it has snapshots"), "{refused}");
}
