//! Which class an individual has, and whether a person gave it.

use super::{Annotator, Answer, ClassName, Label};
use std::collections::BTreeMap;

/// The class of an individual. If annotators differ, the newest answer decides.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GivenClass {
    pub class: ClassName,
    /// Whether only the synthetic annotator gave this class.
    pub by_machine: bool,
}

/// The class of each individual that has a class in the standing answers, and whether a person gave the class.
pub fn given_classes(standing: impl Iterator<Item = Label>) -> BTreeMap<u64, GivenClass> {
    let mut message: BTreeMap<u64, Vec<(u64, ClassName, bool)>> = BTreeMap::new();
    let synthetic = Annotator::synthetic();
    for label in standing {
        if let Answer::Class(class) = label.answer {
            let by_machine = label.annotator == synthetic;
            message
                .entry(label.index)
                .or_default()
                .push((label.entry, class, by_machine));
        }
    }
    let newest = |(index, message): (u64, Vec<(u64, ClassName, bool)>)| {
        let (_, class, _) = message.iter().max_by_key(|(entry, ..)| entry)?;
        let by_machine = message
            .iter()
            .all(|(_, other, by_machine)| *by_machine || other != class);
        let class = class.clone();
        Some((index, GivenClass { class, by_machine }))
    };
    message.into_iter().filter_map(newest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(message: &[(&str, &str)], expected: Option<(&str, bool)>) {
        let labels = message.iter().zip(0..).map(|((annotator, answer), entry)| Label {
            entry,
            index: 3,
            annotator: Annotator::known(annotator).unwrap(),
            answer: answer.parse().unwrap(),
            time_ms: 0,
        });
        let given = given_classes(labels);
        let given = given
            .get(&3)
            .map(|given| (given.class.as_str(), given.by_machine));
        assert_eq!(given, expected);
    }

    #[test]
    fn a_class_is_the_machines_until_a_person_says_the_same() {
        check(&[("synthetic", "ring")], Some(("ring", true)));
        check(&[("synthetic", "ring"), ("ana", "ring")], Some(("ring", false)));
        check(&[("ana", "ring"), ("synthetic", "ring")], Some(("ring", false)));
        check(&[("ana", "ring")], Some(("ring", false)));
    }

    #[test]
    fn where_they_differ_what_was_said_last_counts_with_who_said_it() {
        check(&[("synthetic", "ring"), ("ana", "wall")], Some(("wall", false)));
        check(&[("ana", "wall"), ("synthetic", "ring")], Some(("ring", true)));
        check(
            &[("synthetic", "ring"), ("ana", "not sure")],
            Some(("ring", true)),
        );
        check(&[("ana", "skip")], None);
    }
}
