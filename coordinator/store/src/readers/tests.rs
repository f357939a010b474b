//! Readers beside a writer, and a writer beside readers.

use super::*;
use crate::blocking::in_background;
use crate::{ArchivedIndividual, DataDirectory, GenerationRecord, Provenance, Store};
use murmuration_model::{CampaignId, CampaignState, Weight};
use murmuration_swarm::CampaignSpec;
use rusqlite::Transaction;
use std::{
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread,
    time::Duration,
};

/// Far longer than any step of these tests: a thread without an answer after this time waits for ever.
const FOR_GOOD: Duration = Duration::from_secs(60);

/// A store with a campaign of one generation of one individual.
fn open(folder: &Path) -> (Store, CampaignId) {
    let store = Store::open(&DataDirectory::hold(folder).unwrap()).unwrap();
    let text = "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n[search]\npopulation = 1";
    let spec = CampaignSpec::from_toml(text).unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    let record = GenerationRecord::of(0, &[0.0], 0);
    let individual = ArchivedIndividual::still(0, 0);
    store
        .commit_generation(&id, &record, &[individual], &Provenance::default())
        .unwrap();
    (store, id)
}

/// The output of `work` on another thread, which must not be blocked.
#[track_caller]
fn meanwhile<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, result) = mpsc::channel();
    thread::spawn(move || done.send(work()));
    result.recv_timeout(FOR_GOOD).expect("it is held up")
}

/// Reads all data that lists, statuses and pages show.
fn look(store: &Store, id: &CampaignId) -> CampaignState {
    let record = store.campaign(id.as_str()).unwrap();
    assert_eq!(store.campaigns().unwrap(), std::slice::from_ref(&record));
    assert_eq!(store.notices(id).unwrap(), []);
    assert_eq!(
        store.label_entries(id).unwrap() + store.count_labels().unwrap(),
        0
    );
    assert_eq!(store.labels(id).unwrap().entries(), 0);
    assert_eq!(store.taxonomy(id).unwrap(), None);
    assert_eq!(store.generations(id).unwrap().len(), 1);
    let individuals = store.individuals(id, record.spec.model(), 0..9, true);
    assert_eq!(individuals.unwrap().len(), 1);
    store.answers().unwrap();
    record.state
}

#[test]
fn who_looks_waits_for_no_change_and_sees_what_is_committed() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let look = |store: &Store| {
        let (store, id) = (store.clone(), id.clone());
        meanwhile(move || look(&store, &id))
    };
    store
        .write(|transaction| {
            transaction.execute("UPDATE campaigns SET state = 'paused'", [])?;
            assert_eq!(look(&store), CampaignState::Running);
            Ok(())
        })
        .unwrap();
    assert_eq!(look(&store), CampaignState::Paused);
    // A reader does not wait for a change of labels either.
    let labelled = store.add_to_log(&id, |transaction, _, _| {
        let (store, id) = (store.clone(), id.clone());
        let state = meanwhile(move || store.campaign(id.as_str()).unwrap().state);
        assert_eq!(state, CampaignState::Paused);
        transaction
            .execute("UPDATE campaigns SET state = 'running'", [])
            .map_err(StoreError::from)?;
        Ok(())
    });
    labelled.unwrap();
    assert_eq!(look(&store), CampaignState::Running);
}

#[test]
fn labels_are_told_while_another_campaign_is_changed() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let (labelling, labelled) = mpsc::channel();
    store
        .write(|_| {
            // The labelling thread waits for this change.
            let (waiting, of) = (store.clone(), id.clone());
            thread::spawn(move || {
                let added = waiting.add_to_log(&of, |_, _, _| Ok(()));
                labelling.send(added.is_ok())
            });
            let (store, id) = (store.clone(), id.clone());
            assert_eq!(meanwhile(move || store.labels(&id).unwrap().entries()), 0);
            Ok(())
        })
        .unwrap();
    assert!(labelled.recv_timeout(FOR_GOOD).unwrap());
}

#[test]
fn a_slow_reader_holds_up_neither_readers_nor_changes() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    store
        .read(|connection| {
            let state = || -> rusqlite::Result<String> {
                connection.query_row("SELECT state FROM campaigns", [], |row| row.get(0))
            };
            assert_eq!(state()?, "running");
            let (other, id) = (store.clone(), id.clone());
            let changed = move || {
                other.set_state(&id, CampaignState::Paused, "").unwrap();
                look(&other, &id)
            };
            assert_eq!(meanwhile(changed), CampaignState::Paused);
            // The read still sees the database as of the instant at which the read began.
            assert_eq!(state()?, "running");
            Ok(())
        })
        .unwrap();
}

#[test]
fn labels_wait_for_no_reader_of_low_priority() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    thread::scope(|scope| {
        let (begun, reading) = mpsc::channel();
        let ends: Vec<mpsc::Sender<()>> = (0..MOST_IN_BACKGROUND)
            .map(|_| {
                let (end, ended) = mpsc::channel();
                let (store, begun) = (&store, begun.clone());
                scope.spawn(move || {
                    store.read_in(true, |_| {
                        begun.send(()).unwrap();
                        let _ = ended.recv();
                        Ok(())
                    })
                });
                end
            })
            .collect();
        ends.iter().for_each(|_| reading.recv().unwrap());
        // Labels do not wait either if a thread of low priority reads them.
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let (labels, id) = (store.clone(), id.clone());
        let asked = move || runtime.block_on(in_background(move |_| labels.labels(&id).unwrap().entries()));
        assert_eq!(meanwhile(asked), Ok(0));
        drop(ends);
    });
}

#[test]
fn what_was_refused_is_seen_by_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let refused = store.write(|transaction| {
        transaction.execute("UPDATE campaigns SET state = 'paused'", [])?;
        Err::<(), _>(StoreError::Unwritable {
            path: folder.path().to_owned(),
            reason: "as a failing disk says".to_owned(),
        })
    });
    refused.unwrap_err();
    assert_eq!(look(&store, &id), CampaignState::Running);
}

#[test]
fn the_log_is_emptied_after_the_disk_failed_once_nobody_reads() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let log = folder.path().join(format!("{}-wal", Store::FILE));
    let before = log.metadata().unwrap().len();
    store.sync_failed.store(true, Ordering::Relaxed);
    let has_read = AtomicBool::new(false);
    thread::scope(|scope| {
        let (begun, reading) = mpsc::channel();
        let (store, id, has_read) = (&store, &id, &has_read);
        scope.spawn(move || {
            store.read(|connection| {
                connection.query_row("SELECT count(*) FROM campaigns", [], |_| Ok(()))?;
                begun.send(()).unwrap();
                // Waits until the change keeps other readers away; the change waits for this reader.
                while !store
                    .readers
                    .as_ref()
                    .is_some_and(|readers| lock(&readers.turns).kept_away)
                {
                    thread::yield_now();
                }
                has_read.store(true, Ordering::SeqCst);
                Ok(())
            })
        });
        reading.recv().unwrap();
        store.set_state(id, CampaignState::Paused, "").unwrap();
        assert!(has_read.load(Ordering::SeqCst), "it did not wait for the reader");
    });
    assert!(!store.sync_failed.load(Ordering::Relaxed));
    // The log was emptied, and now has only the change of the state.
    assert!(log.metadata().unwrap().len() < before);
    assert_eq!(look(&store, &id), CampaignState::Paused);
}

#[test]
fn readers_that_overlap_do_not_have_the_log_grow_without_end() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _) = open(folder.path());
    let log = folder.path().join(format!("{}-wal", Store::FILE));
    let ended = AtomicBool::new(false);
    let longest = thread::scope(|scope| {
        // Each read begins before another ends, so that a read is always running.
        for _ in 0..MOST - 1 {
            scope.spawn(|| {
                while !ended.load(Ordering::Relaxed) {
                    let reading = store.read(|connection| {
                        for _ in 0..100 {
                            connection.query_row("SELECT count(*) FROM campaigns", [], |_| Ok(()))?;
                            thread::yield_now();
                        }
                        Ok(())
                    });
                    reading.unwrap();
                }
            });
        }
        let mut longest = 0;
        for turn in 0..40_u32 {
            let note = turn.to_string().repeat(open::LONG_LOG as usize / 8);
            store
                .write(|transaction| Ok(transaction.execute("UPDATE campaigns SET error = ?1", [note])?))
                .unwrap();
            longest = longest.max(log.metadata().unwrap().len());
        }
        ended.store(true, Ordering::Relaxed);
        longest
    });
    assert!(longest < 4 * open::LONG_LOG, "{longest}");
}

#[test]
fn a_log_in_use_by_an_export_is_written_again_only_once_it_is_much_longer() {
    let folder = tempfile::tempdir().unwrap();
    let (store, _) = open(folder.path());
    let write = |bytes: u64| {
        let note = "x".repeat(bytes as usize);
        let change = |transaction: &Transaction<'_>| -> Result<usize, StoreError> {
            Ok(transaction.execute("UPDATE campaigns SET error = ?1", [&note])?)
        };
        store.write(change).unwrap();
    };
    let exports = open::to_read(&store.path, &FileSystem::of(&store.path)).unwrap();
    let snapshot = exports.unchecked_transaction().unwrap();
    let count = |connection: &Connection| -> i64 {
        connection
            .query_row("SELECT count(*) FROM campaigns", [], |row| row.get(0))
            .unwrap()
    };
    count(&snapshot);
    write(2 * open::LONG_LOG);
    let next = store.long_log.load(Ordering::Relaxed);
    assert!(next > 3 * open::LONG_LOG, "{next}");
    write(10);
    assert_eq!(store.long_log.load(Ordering::Relaxed), next);
    drop(snapshot);
    write(2 * open::LONG_LOG);
    assert_eq!(store.long_log.load(Ordering::Relaxed), open::LONG_LOG);
}
