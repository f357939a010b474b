//! The label log on disk.

use super::*;
use crate::{ArchivedIndividual, DataDirectory, GenerationRecord, Provenance};
use murmuration_model::{Weight, labels::ClassName};
use murmuration_swarm::CampaignSpec;
use std::path::Path;

/// A store with a campaign of three individuals.
pub(super) fn open(folder: &Path) -> (Store, CampaignId) {
    let store = Store::open(&DataDirectory::hold(folder).unwrap()).unwrap();
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    let record = GenerationRecord::of(0, &[0.0], 0);
    store
        .commit_generation(
            &id,
            &record,
            &[0, 1, 2].map(|index| ArchivedIndividual::still(index, 0)),
            &Provenance::default(),
        )
        .unwrap();
    (store, id)
}

pub(super) fn change(time_ms: u64, action: Action) -> Change {
    Change {
        annotator: "ana".parse().unwrap(),
        time_ms,
        action,
    }
}

pub(super) fn answer(index: u64, answer: &str) -> Change {
    let answer = answer.parse().unwrap();
    change(7, Action::Answer { index, answer })
}

pub(super) fn request(id: &str) -> RequestId {
    id.parse().unwrap()
}

#[test]
fn a_class_that_is_given_its_own_name_makes_no_entry() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    store
        .add_labels(&id, &request("1"), vec![answer(2, "ring")])
        .unwrap();
    let class: ClassName = "ring".parse().unwrap();
    let to = class.clone();
    let same = change(8, Action::Rename { class, to });
    assert_eq!(store.add_labels(&id, &request("2"), vec![same]).unwrap(), []);
    assert_eq!(store.label_entries(&id).unwrap(), 1);
}

#[test]
fn every_action_reads_back_and_survives_reopening() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let [class, to, into] = ["a", "b", "c"].map(|name| name.parse::<ClassName>().unwrap());
    let shortcut = |key: Option<&str>| {
        let (class, shortcut) = (into.clone(), key.map(|key| key.parse().unwrap()));
        change(8, Action::Shortcut { class, shortcut })
    };
    let message = vec![
        answer(2, "a"),
        answer(2, "not sure"),
        change(8, Action::Undo),
        change(8, Action::Create { class: into.clone() }),
        change(
            8,
            Action::Rename {
                class,
                to: to.clone(),
            },
        ),
        change(
            8,
            Action::Merge {
                class: to,
                into: into.clone(),
            },
        ),
        change(
            8,
            Action::Colour {
                class: into.clone(),
                colour: "#012345".parse().unwrap(),
            },
        ),
        shortcut(Some("w")),
        shortcut(None),
        change(8, Action::Delete { class: into }),
        change(8, Action::Revert { entry: 9 }),
        answer(1, "d"),
        change(8, Action::Withdraw { index: 1 }),
    ];
    let added = store.add_labels(&id, &request("1"), message.clone()).unwrap();
    assert!(added.iter().map(|entry| &entry.change).eq(&message));
    let labels = store.labels(&id).unwrap();
    drop(store);
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    assert_eq!(store.label_log(&id).unwrap(), added);
    assert_eq!(store.labels(&id).unwrap(), labels);
    assert_eq!(labels.by_individual()[&2].as_str(), "c");
}

#[test]
fn a_request_made_again_adds_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let added = store
        .add_labels(&id, &request("1"), vec![answer(0, "a"), answer(1, "b")])
        .unwrap();
    store
        .add_labels(&id, &request("2"), vec![answer(0, "c")])
        .unwrap();
    let mut later = vec![answer(0, "a"), answer(1, "b")];
    later[0].time_ms = 99;
    let again = store.add_labels(&id, &request("1"), later).unwrap();
    assert_eq!(again, added);
    assert_eq!(store.label_log(&id).unwrap().len(), 3);
    for other in [vec![answer(0, "a")], vec![answer(0, "a"), answer(1, "c")]] {
        let refused = store.add_labels(&id, &request("1"), other);
        assert!(matches!(refused, Err(LabelError::OtherRequest(_))), "{refused:?}");
    }
    let undone = store.add_labels(&id, &request("3"), vec![change(9, Action::Undo)]);
    let again = store.add_labels(&id, &request("3"), vec![change(9, Action::Undo)]);
    assert_eq!(undone.unwrap(), again.unwrap());
    assert_eq!(store.labels(&id).unwrap().by_individual()[&0].as_str(), "a");
}

#[test]
fn an_act_is_undone_at_once_whatever_its_size() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    store
        .add_labels(&id, &request("1"), vec![answer(0, "a")])
        .unwrap();
    let bens = Change {
        annotator: "ben".parse().unwrap(),
        ..answer(0, "c")
    };
    // Ana answers twice about individual 1.
    let sheet = vec![
        answer(0, "b"),
        bens,
        answer(1, "b"),
        answer(2, "b"),
        answer(1, "c"),
    ];
    store.add_labels(&id, &request("2"), sheet).unwrap();
    let undo = |name: &str| -> Result<Vec<u64>, LabelError> {
        let undone = store.undo_labels(&id, &request(name), &"ana".parse().unwrap(), 9)?;
        Ok(undone.iter().map(|undone| undone.answer.index).collect())
    };
    for _ in 0..2 {
        assert_eq!(undo("3").unwrap(), [1, 2, 1, 0]);
    }
    let stands = |store: &Store| -> Vec<(u64, String, String)> {
        let labels = store.labels(&id).unwrap();
        labels
            .standing()
            .map(|label| (label.index, label.annotator.to_string(), label.answer.to_string()))
            .collect()
    };
    let message = |index, who: &str, class: &str| (index, who.to_owned(), class.to_owned());
    assert_eq!(stands(&store), [message(0, "ana", "a"), message(0, "ben", "c")]);
    assert!(matches!(undo("2"), Err(LabelError::OtherRequest(_))));
    assert_eq!(undo("4").unwrap(), [0]);
    assert!(matches!(
        undo("5"),
        Err(LabelError::Refused(Refusal::NothingToUndo(_)))
    ));
    assert_eq!(undo("3").unwrap(), [1, 2, 1, 0]);
    assert_eq!(store.label_log(&id).unwrap().len(), 11);
    assert_eq!(stands(&store), [message(0, "ben", "c")]);
}

#[test]
fn a_full_log_takes_no_answer_but_what_takes_back() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let answers = |count: u64| {
        (0..count)
            .map(|number| answer(number % 3, "ring"))
            .collect::<Vec<_>>()
    };
    store
        .add_labels(&id, &request("fills"), answers(MAX_ENTRIES))
        .unwrap();
    let refused = store.add_labels(&id, &request("more"), answers(1));
    let full = Refusal::Full {
        entries: MAX_ENTRIES,
        more: 1,
        most: MAX_ENTRIES,
    };
    assert!(matches!(refused, Err(LabelError::Refused(refusal)) if refusal == full));
    let again = store
        .add_labels(&id, &request("fills"), answers(MAX_ENTRIES))
        .unwrap();
    assert_eq!(again.len() as u64, MAX_ENTRIES);
    let withdraw = change(8, Action::Withdraw { index: 0 });
    assert_eq!(
        store
            .add_labels(&id, &request("0"), vec![withdraw])
            .unwrap()
            .len(),
        1
    );
    store
        .undo_labels(&id, &request("undo"), &"ana".parse().unwrap(), 9)
        .unwrap();
    assert_eq!(store.labels(&id).unwrap().standing().count(), 0);
}

#[test]
fn what_is_refused_leaves_nothing_of_its_request() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    let class = "a".parse().unwrap();
    let taken = vec![answer(0, "a"), change(7, Action::Create { class })];
    let refused = store.add_labels(&id, &request("1"), taken);
    assert!(matches!(
        refused,
        Err(LabelError::Refused(Refusal::ClassExists(_)))
    ));
    let beyond = store.add_labels(&id, &request("1"), vec![answer(0, "a"), answer(3, "a")]);
    let message = beyond.unwrap_err().to_string();
    assert!(
        message.contains("has no individual 3: its archive holds 3"),
        "{message}"
    );
    assert_eq!(store.label_log(&id).unwrap(), []);
    // The request's id is still free.
    store
        .add_labels(&id, &request("1"), vec![answer(0, "a")])
        .unwrap();
}

#[test]
fn rows_are_neither_changed_nor_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let (store, id) = open(folder.path());
    store
        .add_labels(&id, &request("1"), vec![answer(0, "a")])
        .unwrap();
    for attempt in ["UPDATE labels SET class = 'b'", "DELETE FROM labels"] {
        let done = store.write(|transaction| Ok(transaction.execute(attempt, [])?));
        assert!(
            done.unwrap_err().to_string().contains("labels are never"),
            "{attempt}"
        );
    }
}
