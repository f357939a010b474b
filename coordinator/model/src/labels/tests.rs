//! Tests of the public state of a label log.

mod class_changes;

use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

fn change(annotator: &str, action: Action) -> Change {
    Change {
        annotator: annotator.parse().unwrap(),
        time_ms: 7,
        action,
    }
}

fn answer(annotator: &str, index: u64, answer: &str) -> Change {
    let answer = answer.parse().unwrap();
    change(annotator, Action::Answer { index, answer })
}

fn undo(annotator: &str) -> Change {
    change(annotator, Action::Undo)
}

fn class(name: &str) -> ClassName {
    name.parse().unwrap()
}

fn rename(from: &str, to: &str) -> Change {
    let (class, to) = (class(from), class(to));
    change("ana", Action::Rename { class, to })
}

fn merge(from: &str, into: &str) -> Change {
    let (class, into) = (class(from), class(into));
    change("ana", Action::Merge { class, into })
}

fn replay(log: &[Entry]) -> Result<Labels, BrokenLog> {
    let mut labels = Labels::default();
    labels.follow(log.to_vec()).map(|()| labels)
}

/// Applies changes, which must all be accepted, and checks the standing answers. Returns the state and the log.
#[track_caller]
fn check(changes: &[Change], standing: &[(u64, &str, &str)]) -> (Labels, Vec<Entry>) {
    let mut labels = Labels::default();
    let log: Vec<Entry> = changes
        .iter()
        .map(|change| labels.record(change.clone()).unwrap())
        .collect();
    let stands: Vec<_> = labels.standing().collect();
    let stands: Vec<_> = stands
        .iter()
        .map(|label| (label.index, label.annotator.as_str(), label.answer.as_str()))
        .collect();
    assert_eq!(stands, standing);
    assert_eq!(replay(&log).as_ref(), Ok(&labels));
    (labels, log)
}

fn classes(labels: &Labels) -> Vec<(String, u64)> {
    let classes = labels.classes().into_iter();
    classes
        .map(|class| (class.name.to_string(), class.labels))
        .collect()
}

#[test]
fn the_last_answer_of_each_annotator_stands() {
    let (labels, log) = check(
        &[
            answer("ana", 3, "ring"),
            answer("ben", 3, "clump"),
            answer("ana", 1, "not sure"),
            answer("ana", 3, "clump"),
        ],
        &[(1, "ana", "not sure"), (3, "ana", "clump"), (3, "ben", "clump")],
    );
    let superseded: Vec<_> = log.iter().map(|entry| entry.supersedes).collect();
    assert_eq!(superseded, [None, None, None, Some(0)]);
    // No answer names the class `ring` any more.
    assert_eq!(classes(&labels), [("clump".into(), 2)]);
    assert_eq!(labels.by_individual(), BTreeMap::from([(3, class("clump"))]));
    assert_eq!(labels.individuals(), 2);
}

#[test]
fn an_undo_restores_what_was_superseded_and_goes_back_step_by_step() {
    let message = [
        answer("ana", 3, "ring"),
        answer("ana", 4, "ring"),
        answer("ben", 3, "wall"),
        answer("ana", 3, "clump"),
        undo("ana"),
        undo("ana"),
        undo("ana"),
    ];
    let (labels, log) = check(&message, &[(3, "ben", "wall")]);
    let undone: Vec<_> = log[4..].iter().map(|entry| entry.supersedes).collect();
    assert_eq!(undone, [Some(3), Some(1), Some(0)]);
    check(
        &message[..5],
        &[(3, "ana", "ring"), (3, "ben", "wall"), (4, "ana", "ring")],
    );
    let nothing = labels.clone().record(undo("ana"));
    assert_eq!(nothing, Err(Refusal::NothingToUndo("ana".parse().unwrap())));
    // After an undo, a new answer supersedes the restored answer.
    let mut again = message[..5].to_vec();
    again.push(answer("ana", 3, "wall"));
    let (_, log) = check(
        &again,
        &[(3, "ana", "wall"), (3, "ben", "wall"), (4, "ana", "ring")],
    );
    assert_eq!(log[5].supersedes, Some(0));
}

#[test]
fn answers_follow_their_class_through_renaming_and_merging() {
    let (labels, _) = check(
        &[
            answer("ana", 1, "ring"),
            answer("ana", 2, "circle"),
            rename("ring", "milling"),
            merge("circle", "milling"),
            rename("milling", "mill"),
            // The old names are free again.
            answer("ana", 3, "ring"),
        ],
        &[(1, "ana", "mill"), (2, "ana", "mill"), (3, "ana", "ring")],
    );
    assert_eq!(classes(&labels), [("mill".into(), 2), ("ring".into(), 1)]);
}

#[test]
fn spellings_of_a_name_are_one_class_that_is_shown_as_it_was_first() {
    let (labels, _) = check(
        &[
            answer("ana", 1, "Two rings"),
            answer("ben", 2, "two rings"),
            answer("ben", 3, "TWO-RINGS"),
        ],
        &[
            (1, "ana", "Two rings"),
            (2, "ben", "Two rings"),
            (3, "ben", "Two rings"),
        ],
    );
    assert_eq!(classes(&labels), [("Two rings".into(), 3)]);
    let mut labels = labels;
    let refused = labels.record(change(
        "ana",
        Action::Create {
            class: class("Two Rings"),
        },
    ));
    assert_eq!(refused, Err(Refusal::ClassExists(class("Two rings"))));
    let itself = merge("two rings", "Two rings");
    assert_eq!(
        labels.record(itself),
        Err(Refusal::IntoItself(class("two rings")))
    );
    // A person may choose another spelling.
    labels.record(rename("two rings", "two_rings")).unwrap();
    assert_eq!(classes(&labels), [("two_rings".into(), 3)]);
}

#[test]
fn the_papers_classes_are_shown_as_the_paper_spells_them() {
    let (labels, _) = check(
        &[
            answer("ana", 1, "Wall following"),
            change(
                "ana",
                Action::Create {
                    class: class("MILLING"),
                },
            ),
            rename("wall following", "Nested Cycle"),
        ],
        &[(1, "ana", "nested_cycle")],
    );
    assert_eq!(
        classes(&labels),
        [("nested_cycle".into(), 1), ("milling".into(), 0)]
    );
}

#[test]
fn a_log_that_told_spellings_apart_is_still_followed() {
    let create = Action::Create { class: class("RING") };
    let colour = Action::Colour {
        class: class("Ring"),
        colour: "#010203".parse().unwrap(),
    };
    let message = [
        answer("ana", 1, "ring"),
        answer("ana", 2, "Ring"),
        change("ana", create),
        merge("Ring", "RING"),
        rename("ring", "milling"),
        answer("ana", 3, "clump"),
        rename("clump", "Milling"),
        change("ana", colour),
    ];
    let entries = (0..).zip(message).map(|(number, change)| Entry {
        number,
        change,
        supersedes: None,
    });
    let entries: Vec<Entry> = entries.collect();
    let labels = replay(&entries).unwrap();
    assert_eq!(classes(&labels), [("Milling".into(), 3)]);

    // A class that never existed cannot be renamed.
    let never = Entry {
        number: 0,
        change: rename("wall", "x"),
        supersedes: None,
    };
    assert_eq!(replay(&[never]), Err(BrokenLog(0)));
}

#[test]
fn a_class_without_an_answer_is_gone_and_comes_back_with_its_colour() {
    let clump = |labels: &Labels| {
        labels
            .classes()
            .into_iter()
            .find(|known| known.name == class("clump"))
    };
    let (mut labels, _) = check(
        &[answer("ana", 1, "ring"), answer("ana", 2, "clump")],
        &[(1, "ana", "ring"), (2, "ana", "clump")],
    );
    let colour = "#010203".parse().unwrap();
    let class = class("clump");
    labels
        .record(change("ana", Action::Colour { class, colour }))
        .unwrap();
    labels.record(answer("ana", 2, "ring")).unwrap();
    assert_eq!(clump(&labels), None);
    labels.record(undo("ana")).unwrap();
    assert_eq!(clump(&labels).unwrap().colour, colour);

    // The class is not present, so its name is free.
    labels.record(answer("ana", 2, "ring")).unwrap();
    labels.record(rename("ring", "clump")).unwrap();
    assert_eq!(classes(&labels), [("clump".into(), 2)]);

    // A class that was created explicitly stays.
    let class = "wall".parse().unwrap();
    labels.record(change("ana", Action::Create { class })).unwrap();
    assert_eq!(classes(&labels), [("clump".into(), 2), ("wall".into(), 0)]);
}

#[test]
fn classes_with_nearly_the_same_name_know_of_each_other() {
    let (labels, _) = check(
        &[
            answer("ana", 1, "dispersal"),
            answer("ana", 2, "dispresal"),
            answer("ana", 3, "ring"),
        ],
        &[
            (1, "ana", "dispersal"),
            (2, "ana", "dispresal"),
            (3, "ana", "ring"),
        ],
    );
    let near: Vec<Vec<ClassName>> = labels.classes().into_iter().map(|class| class.near).collect();
    assert_eq!(near, [vec![class("dispresal")], vec![class("dispersal")], vec![]]);
}

#[test]
fn what_cannot_be_said_is_refused_and_changes_nothing() {
    let (mut labels, _) = check(
        &[answer("ana", 1, "ring"), answer("ana", 2, "clump")],
        &[(1, "ana", "ring"), (2, "ana", "clump")],
    );
    let before = labels.clone();
    let create = |name: &str| change("ana", Action::Create { class: class(name) });
    for (message, refusal) in [
        (rename("wall", "x"), Refusal::NoClass(class("wall"))),
        (rename("ring", "clump"), Refusal::ClassExists(class("clump"))),
        (merge("ring", "wall"), Refusal::NoClass(class("wall"))),
        (merge("ring", "ring"), Refusal::IntoItself(class("ring"))),
        (create("ring"), Refusal::ClassExists(class("ring"))),
    ] {
        assert_eq!(labels.record(message), Err(refusal));
        assert_eq!(labels, before);
    }
    for index in 3..1001 {
        labels.record(create(&index.to_string())).unwrap();
    }
    let one_more = labels.record(answer("ana", 1, "wall"));
    assert_eq!(one_more, Err(Refusal::TooManyClasses(class("wall"))));
    assert_eq!(labels.by_individual(), before.by_individual());
}

#[test]
fn classes_have_colours_of_their_own_until_they_are_given_one() {
    let (mut labels, _) = check(
        &[answer("ana", 1, "ring"), answer("ana", 2, "clump")],
        &[(1, "ana", "ring"), (2, "ana", "clump")],
    );
    let colours =
        |labels: &Labels| -> Vec<Colour> { labels.classes().into_iter().map(|class| class.colour).collect() };
    assert_ne!(colours(&labels)[0], colours(&labels)[1]);
    let colour = "#010203".parse().unwrap();
    let class = class("clump");
    labels
        .record(change("ana", Action::Colour { class, colour }))
        .unwrap();
    assert_eq!(colours(&labels)[1], colour);
}

/// If this digest changes, checkpoints no longer match the labels that they were trained on.
#[test]
fn the_digest_covers_individuals_and_classes_alone() {
    let ring = [answer("ana", 2, "ring"), answer("ana", 1, "clump")];
    let (labels, _) = check(&ring, &[(1, "ana", "clump"), (2, "ana", "ring")]);
    let mut hasher = blake3::Hasher::new_derive_key("murmuration labels v1");
    for (index, class) in [(1u64, "clump"), (2, "ring")] {
        hasher.update(&index.to_le_bytes());
        hasher.update(&(class.len() as u64).to_le_bytes());
        hasher.update(class.as_bytes());
    }
    assert_eq!(
        labels.digest().to_string(),
        hasher.finalize().to_hex().to_string()
    );
    let (otherwise, _) = check(
        &[
            answer("ben", 1, "wall"),
            answer("ben", 2, "ring"),
            answer("ben", 3, "skip"),
            answer("ana", 1, "clump"),
        ],
        &[
            (1, "ana", "clump"),
            (1, "ben", "wall"),
            (2, "ben", "ring"),
            (3, "ben", "skip"),
        ],
    );
    assert_eq!(otherwise.digest(), labels.digest());
    let (other, _) = check(&ring[..1], &[(2, "ana", "ring")]);
    assert_ne!(other.digest(), labels.digest());
}

#[test]
fn a_log_that_nobody_could_have_written_is_noticed() {
    let (_, mut log) = check(
        &[answer("ana", 1, "ring"), answer("ana", 1, "clump")],
        &[(1, "ana", "clump")],
    );
    log[1].supersedes = None;
    assert_eq!(replay(&log), Err(BrokenLog(1)));
    log.remove(0);
    assert_eq!(replay(&log), Err(BrokenLog(1)));
}

#[test]
fn names_of_very_many_classes_are_not_compared() {
    let mut labels = Labels::default();
    let names = |labels: &Labels| {
        labels
            .classes()
            .iter()
            .map(|class| class.near.len())
            .sum::<usize>()
    };
    for number in 0..=200_u8 {
        // Any two names differ by two letters at most.
        let [one, other] = [number / 26, number % 26].map(|letter| char::from(b'a' + letter));
        let create = Action::Create {
            class: class(&format!("formation {one}{other}")),
        };
        labels.record(change("ana", create)).unwrap();
        match number {
            199 => assert_eq!(names(&labels), 200 * 199),
            200 => assert_eq!(names(&labels), 0),
            _ => {}
        }
    }
}

fn anything() -> impl Strategy<Value = Change> {
    let who = prop::sample::select(vec!["ana", "ben"]);
    let word = prop::sample::select(vec!["a", "b", "c", "B", "not sure", "skip"]);
    prop_oneof![
        6 => (who.clone(), 0u64..4, word).prop_map(|(who, index, word)| answer(who, index, word)),
        3 => who.clone().prop_map(undo),
        1 => (who, 0u64..4).prop_map(|(who, index)| change(who, Action::Withdraw { index })),
        3 => class_changes::class_change(),
        2 => (0u64..40).prop_map(|entry| change("ben", Action::Revert { entry })),
    ]
}

proptest! {
    #[test]
    fn replaying_any_log_gives_the_labels_that_it_was_written_with(
        message in prop::collection::vec(anything(), 0..60),
    ) {
        let mut labels = Labels::default();
        let log: Vec<Entry> = message.into_iter().filter_map(|change| labels.record(change).ok()).collect();
        prop_assert_eq!(replay(&log), Ok(labels));
    }

    /// An answer and its undo leave the labels unchanged.
    #[test]
    fn an_undo_removes_the_answer_before_it(
        message in prop::collection::vec(anything(), 0..40), index in 0u64..4,
    ) {
        let mut labels = Labels::default();
        for change in message {
            // Some changes are refused.
            let _ = labels.record(change);
        }
        let before: Vec<Label> = labels.standing().collect();
        if labels.record(answer("ana", index, "a")).is_ok() {
            labels.record(undo("ana")).unwrap();
        }
        prop_assert_eq!(labels.standing().collect::<Vec<_>>(), before);
    }
}
