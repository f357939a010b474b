//! Tests of changes of classes: deletions, keys, and their reversal.

use super::*;

fn delete(name: &str) -> Change {
    let class = class(name);
    change("ana", Action::Delete { class })
}

fn shortcut(name: &str, key: Option<&str>) -> Change {
    let shortcut = key.map(|key| key.parse().unwrap());
    let class = class(name);
    change("ana", Action::Shortcut { class, shortcut })
}

fn revert(entry: u64) -> Change {
    change("ben", Action::Revert { entry })
}

fn keys(labels: &Labels) -> Vec<(String, Option<String>)> {
    let classes = labels.classes().into_iter();
    classes
        .map(|class| (class.name.to_string(), class.shortcut.map(|key| key.to_string())))
        .collect()
}

#[test]
fn a_deleted_class_takes_its_answers_along_and_a_reversal_brings_them_back() {
    let message = [
        answer("ana", 1, "ring"),
        answer("ben", 1, "ring"),
        answer("ana", 2, "clump"),
        answer("ana", 3, "ring"),
        delete("Ring"),
    ];
    let (labels, _) = check(&message, &[(2, "ana", "clump")]);
    assert_eq!(classes(&labels), [("clump".into(), 1)]);
    assert_eq!(labels.set_aside().count(), 3);

    // A later answer takes precedence over an answer that a reversal restores.
    let since = [answer("ana", 3, "clump"), revert(4)];
    let (labels, _) = check(
        &[&message[..], &since].concat(),
        &[
            (1, "ana", "ring"),
            (1, "ben", "ring"),
            (2, "ana", "clump"),
            (3, "ana", "clump"),
        ],
    );
    assert_eq!(classes(&labels), [("ring".into(), 2), ("clump".into(), 2)]);
}

#[test]
fn an_answer_after_a_deletion_makes_a_class_of_its_own_until_the_deletion_is_reverted() {
    let message = [answer("ana", 1, "ring"), delete("ring"), answer("ana", 2, "ring")];
    let (labels, _) = check(&message, &[(2, "ana", "ring")]);
    assert_eq!(classes(&labels), [("ring".into(), 1)]);
    let (labels, _) = check(
        &[&message[..], &[revert(1)]].concat(),
        &[(1, "ana", "ring"), (2, "ana", "ring")],
    );
    assert_eq!(classes(&labels), [("ring".into(), 2)]);
}

#[test]
fn an_undo_does_not_bring_back_an_answer_of_a_deleted_class() {
    check(
        &[
            answer("ana", 1, "ring"),
            answer("ana", 1, "clump"),
            delete("ring"),
            undo("ana"),
        ],
        &[],
    );
}

#[test]
fn an_answer_that_was_withdrawn_meanwhile_stays_away() {
    let withdraw = change("ana", Action::Withdraw { index: 1 });
    check(
        &[
            answer("ana", 1, "ring"),
            answer("ana", 2, "ring"),
            delete("ring"),
            withdraw,
            revert(2),
        ],
        &[(2, "ana", "ring")],
    );
}

#[test]
fn an_answer_that_was_withdrawn_after_another_took_its_place_stays_away() {
    let message = [
        answer("ana", 1, "ring"),
        answer("ben", 1, "ring"),
        delete("ring"),
        answer("ana", 1, "clump"),
        change("ana", Action::Withdraw { index: 1 }),
        revert(2),
    ];
    let (mut labels, _) = check(&message, &[(1, "ben", "ring")]);
    let again = labels.record(change("ana", Action::Withdraw { index: 1 }));
    assert!(
        matches!(again, Err(Refusal::NothingToWithdraw { .. })),
        "{again:?}"
    );
}

#[test]
fn an_undo_restores_an_answer_of_a_deleted_class_once_the_deletion_is_reverted() {
    let message = [
        answer("ana", 1, "ring"),
        answer("ana", 1, "clump"),
        delete("ring"),
        undo("ana"),
    ];
    let (labels, _) = check(&message, &[]);
    assert_eq!(labels.set_aside().count(), 1);
    check(&[&message[..], &[revert(2)]].concat(), &[(1, "ana", "ring")]);
    // A later answer or withdrawal by the same annotator takes precedence over the restored answer.
    let answered = [answer("ana", 1, "wall"), revert(2)];
    check(&[&message[..], &answered].concat(), &[(1, "ana", "wall")]);
    let withdrawn = [change("ana", Action::Withdraw { index: 1 }), revert(2)];
    check(&[&message[..], &withdrawn].concat(), &[]);
}

#[test]
fn merging_and_renaming_are_reverted_to_what_each_answer_said() {
    let message = [
        answer("ana", 1, "ring"),
        answer("ana", 2, "clump"),
        merge("ring", "clump"),
        rename("clump", "knot"),
        answer("ana", 3, "knot"),
        answer("ana", 4, "ring"),
    ];
    check(
        &message,
        &[
            (1, "ana", "knot"),
            (2, "ana", "knot"),
            (3, "ana", "knot"),
            (4, "ana", "ring"),
        ],
    );
    check(
        &[&message[..], &[revert(3), revert(2)]].concat(),
        &[
            (1, "ana", "ring"),
            (2, "ana", "clump"),
            (3, "ana", "clump"),
            (4, "ana", "ring"),
        ],
    );
}

#[test]
fn a_key_is_of_one_class_and_comes_back() {
    let message = [
        answer("ana", 1, "ring"),
        answer("ana", 2, "clump"),
        shortcut("ring", Some("w")),
        shortcut("clump", Some("W")),
    ];
    let stands = [(1, "ana", "ring"), (2, "ana", "clump")];
    let key = |key: &str| Some(key.to_owned());
    let (labels, _) = check(&message, &stands);
    assert_eq!(keys(&labels), [("ring".into(), None), ("clump".into(), key("w"))]);
    let (labels, _) = check(&[&message[..], &[shortcut("clump", None)]].concat(), &stands);
    assert_eq!(keys(&labels), [("ring".into(), None), ("clump".into(), None)]);
    let (labels, _) = check(&[&message[..], &[revert(3)]].concat(), &stands);
    assert_eq!(keys(&labels), [("ring".into(), key("w")), ("clump".into(), None)]);
}

#[test]
fn changes_are_reverted_once_and_the_newest_first() {
    let mut labels = Labels::default();
    for change in [answer("ana", 1, "ring"), rename("ring", "a"), rename("a", "b")] {
        labels.record(change).unwrap();
    }
    let refused = |labels: &mut Labels, entry| {
        let error = labels.record(revert(entry)).unwrap_err();
        assert_eq!(error, Refusal::NotNewestChange(entry));
    };
    refused(&mut labels, 0);
    refused(&mut labels, 1);
    labels.record(revert(2)).unwrap();
    refused(&mut labels, 2);
    labels.record(revert(1)).unwrap();
    refused(&mut labels, 1);
    assert_eq!(classes(&labels), [("ring".into(), 1)]);
    assert_eq!(labels.class_changes().count(), 0);
}

proptest! {
    /// A change of a class and its reversal leave the labels unchanged.
    #[test]
    fn a_reversal_restores_classes_and_answers(
        message in prop::collection::vec(anything(), 0..40), last in class_change(),
    ) {
        let mut labels = Labels::default();
        for change in message {
            // Some changes are refused.
            let _ = labels.record(change);
        }
        let seen = |labels: &Labels| (labels.classes(), labels.standing().collect::<Vec<_>>(), labels.digest());
        let before = seen(&labels);
        if let Ok(entry) = labels.record(last) {
            labels.record(revert(entry.number)).unwrap();
        }
        prop_assert_eq!(seen(&labels), before);
    }
}

/// A random change of a class.
pub(super) fn class_change() -> impl Strategy<Value = Change> {
    let name = prop::sample::select(vec!["a", "b", "c", "A"]);
    let key = prop::sample::select(vec![None, Some("w"), Some("1")]);
    prop_oneof![
        (name.clone(), name.clone()).prop_map(|(class, to)| rename(class, to)),
        (name.clone(), name.clone()).prop_map(|(class, into)| merge(class, into)),
        name.clone().prop_map(delete),
        (name.clone(), key).prop_map(|(name, key)| shortcut(name, key)),
        name.prop_map(|name| change("ana", Action::Create { class: class(name) })),
    ]
}
