//! The cached labels equal the labels that follow from the log, after any changes and failures.

use super::{
    super::tests::{answer, change, open, request},
    *,
};
use murmuration_model::labels::{Action, Change, Entry};
use proptest::prelude::*;
use std::thread;

/// The labels of the log on disk, read from its beginning.
fn replayed(store: &Store, id: &CampaignId) -> Labels {
    let mut labels = Labels::default();
    labels.follow(store.label_log(id).unwrap()).unwrap();
    labels
}

#[derive(Debug, Clone)]
enum Step {
    /// A request with this id and these changes; some requests are refused, some are repeated.
    Say(u8, Vec<Change>),
    /// An undo request with this id.
    Undo(u8),
    /// The disk fails after this change was applied.
    Fail(Change),
    /// A caller reads the labels, and keeps them.
    Look,
    /// The cache drops the labels.
    Forget,
}

fn anything() -> impl Strategy<Value = Change> {
    let class = prop::sample::select(vec!["a", "b", "c"]);
    prop_oneof![
        // The archive has three individuals, so index 3 is refused.
        6 => (0u64..4, class.clone()).prop_map(|(index, class)| answer(index, class)),
        2 => Just(change(8, Action::Undo)),
        1 => (class.clone(), class).prop_map(|(class, into)| {
            let (class, into) = (class.parse().unwrap(), into.parse().unwrap());
            change(8, Action::Merge { class, into })
        }),
    ]
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        6 => (0u8..20, prop::collection::vec(anything(), 1..4)).prop_map(|(id, message)| Step::Say(id, message)),
        2 => (0u8..20).prop_map(Step::Undo),
        1 => anything().prop_map(Step::Fail),
        2 => Just(Step::Look),
        2 => Just(Step::Forget),
    ]
}

proptest! {
    // There are few cases, because each step waits for the disk.
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn what_is_kept_equals_a_replay_of_the_log(steps in prop::collection::vec(step(), 0..24)) {
        let folder = tempfile::tempdir().unwrap();
        let (store, id) = open(folder.path());
        let mut seen: Vec<(Arc<Labels>, Labels)> = Vec::new();
        for step in steps {
            match step {
                // Refusals are part of the test.
                Step::Say(name, message) => drop(store.add_labels(&id, &request(&name.to_string()), message)),
                Step::Undo(name) => {
                    let ana = "ana".parse().unwrap();
                    drop(store.undo_labels(&id, &request(&name.to_string()), &ana, 9));
                }
                Step::Fail(message) => {
                    let failed = store.add_to_log(&id, |_, _, labels| {
                        let _ = labels.record(message);
                        Err::<(), _>(LabelError::Store(StoreError::damaged("the disk is gone".to_owned())))
                    });
                    prop_assert!(failed.is_err());
                }
                Step::Look => {
                    let labels = store.labels(&id).unwrap();
                    seen.push((Arc::clone(&labels), (*labels).clone()));
                }
                Step::Forget => store.followed.forget(&id),
            }
            prop_assert_eq!(&*store.labels(&id).unwrap(), &replayed(&store, &id));
        }
        // Labels that a caller keeps do not change.
        for (shared, copy) in seen {
            prop_assert_eq!(&*shared, &copy);
        }
    }
}

#[test]
fn many_at_once_write_one_log() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    thread::scope(|scope| {
        for writer in 0..3 {
            let (store, id) = (&store, &id);
            scope.spawn(move || {
                for turn in 0..10 {
                    let name = request(&format!("{writer}-{turn}"));
                    store.add_labels(id, &name, vec![answer(turn % 3, "a")]).unwrap();
                    assert!(store.labels(id).unwrap().entries() > turn);
                }
            });
        }
    });
    let log = store.label_log(&id).unwrap();
    let numbers: Vec<u64> = log.iter().map(|entry: &Entry| entry.number).collect();
    assert_eq!(numbers, (0..30).collect::<Vec<_>>());
    assert_eq!(*store.labels(&id).unwrap(), replayed(&store, &id));
}

#[test]
fn logs_that_were_forgotten_come_to_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let (mut store, first) = open(folder.path());
    let bound = 4 * BYTES_AN_ENTRY;
    store.followed = Arc::new(Followed(kept::Kept::within(bound)));
    let spec = store.campaign(first.as_str()).unwrap().spec;
    let mut ids = vec![first];
    for turn in 0..6 {
        let id = store
            .create_campaign(&spec, murmuration_model::Weight::default(), turn)
            .unwrap();
        ids.push(id);
    }
    for (turn, id) in ids.iter().cycle().take(4 * ids.len()).enumerate() {
        let class = ["a", "b", "c"][turn % 3];
        let create = change(
            8,
            Action::Create {
                class: class.parse().unwrap(),
            },
        );
        // Some requests are refused, because the class exists.
        drop(store.add_labels(id, &request(&turn.to_string()), vec![create]));
        assert_eq!(*store.labels(id).unwrap(), replayed(&store, id));
        assert!(store.followed.0.bytes() <= bound);
    }
    for id in &ids {
        assert_eq!(*store.labels(id).unwrap(), replayed(&store, id));
    }
}
