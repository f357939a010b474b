//! No holder gets another holder's query, in any order of events.

use super::*;
use crate::queries::Reason;
use proptest::prelude::*;
use std::collections::BTreeSet;

fn holder(annotator: &str, session: &str) -> AnnotatorSession {
    AnnotatorSession {
        token: None,
        annotator: annotator.parse().unwrap(),
        session: session.to_owned(),
    }
}

fn ranking(count: usize) -> Vec<Query> {
    let query = |index| Query {
        index,
        reason: Reason::Random,
    };
    (0..count).map(query).collect()
}

/// Ten behaviours, some answered, and their leases.
struct Table {
    leases: QueryLeases<char>,
    answered: BTreeSet<usize>,
    now: Instant,
}

impl Table {
    fn new() -> Self {
        Self {
            leases: QueryLeases::default(),
            answered: BTreeSet::new(),
            now: Instant::now(),
        }
    }

    fn ask_first(&mut self, holder: &AnnotatorSession, kind: char, count: usize, index: usize) -> Vec<usize> {
        if !self.answered.contains(&index) {
            let reason = Reason::Again;
            self.leases
                .give_first(holder, kind, Query { index, reason }, self.now);
        }
        self.ask(holder, kind, count)
    }

    fn ask(&mut self, holder: &AnnotatorSession, kind: char, count: usize) -> Vec<usize> {
        let given = self.leases.top_up(
            holder,
            kind,
            count,
            &ranking(10),
            |index| !self.answered.contains(&index),
            self.now,
        );
        given.iter().map(|query| query.index).collect()
    }
}

#[test]
fn who_asks_again_keeps_what_they_have() {
    let (ana, ben) = (holder("ana", ""), holder("ben", ""));
    let mut table = Table::new();
    assert_eq!(table.ask(&ana, 'a', 3), [0, 1, 2]);
    assert_eq!(table.ask(&ben, 'a', 2), [3, 4]);
    table.answered.insert(1);
    assert_eq!(table.ask(&ana, 'a', 3), [0, 2, 5]);
    assert_eq!(table.ask(&ana, 'a', 1), [0]);
    assert_eq!(table.ask(&ben, 'a', 4), [3, 4, 2, 5]);
}

#[test]
fn no_token_holds_more_than_its_most_whatever_names_and_windows_it_gives() {
    let window = |name: &str, token| AnnotatorSession {
        token,
        ..holder(name, "")
    };
    let ranking = ranking(MAX_HELD + 300);
    let mut leases = QueryLeases::<char>::default();
    let mut now = Instant::now();
    let mut ask = |holder: &AnnotatorSession, count| {
        now += QUERY_LEASE_TIME / 1000;
        let given = leases.top_up(holder, 'a', count, &ranking, |_| true, now);
        given.iter().map(|query| query.index).collect::<Vec<_>>()
    };
    for place in 0..MAX_HELD / 100 {
        let given = ask(&window(&format!("ana{place}"), Some(1)), 100);
        assert_eq!(given, (100 * place..100 * (place + 1)).collect::<Vec<_>>());
    }
    // One more window takes the queries of the oldest window, which then takes the queries of the next window.
    let further = ask(&window("ana-again", Some(1)), 100);
    assert_eq!(further, (0..100).collect::<Vec<_>>());
    assert_eq!(ask(&window("ana0", Some(1)), 100), (100..200).collect::<Vec<_>>());
    assert_eq!(ask(&window("ben", Some(2)), 300).len(), 300);
    assert!(ask(&window("carl", None), 50).is_empty());
}

#[test]
fn windows_of_one_annotator_are_given_different_queries() {
    let mut table = Table::new();
    assert_eq!(table.ask(&holder("ana", "1"), 'a', 2), [0, 1]);
    assert_eq!(table.ask(&holder("ana", "2"), 'a', 2), [2, 3]);
}

#[test]
fn another_kind_of_question_gives_back_the_former() {
    let (ana, ben) = (holder("ana", ""), holder("ben", ""));
    let mut table = Table::new();
    assert_eq!(table.ask(&ana, 'a', 2), [0, 1]);
    assert_eq!(table.ask(&ben, 'a', 1), [2]);
    assert_eq!(table.ask(&ana, 'b', 3), [0, 1, 3]);
}

#[test]
fn what_nobody_answers_in_time_is_given_to_others() {
    let (ana, ben) = (holder("ana", ""), holder("ben", ""));
    let mut table = Table::new();
    table.ask(&ana, 'a', 2);
    table.now += QUERY_LEASE_TIME - Duration::from_secs(1);
    assert_eq!(table.ask(&ana, 'a', 1), [0]);
    table.now += Duration::from_secs(2);
    // The query of index 0 was renewed, and the query of index 1 was returned.
    assert_eq!(table.ask(&ben, 'a', 2), [1, 2]);
    table.now += QUERY_LEASE_TIME;
    assert_eq!(table.ask(&ana, 'a', 3), [0, 1, 2]);
}

#[test]
fn what_is_open_again_is_asked_again() {
    let ana = holder("ana", "");
    let mut table = Table::new();
    table.ask(&ana, 'a', 1);
    table.answered.insert(0);
    assert_eq!(table.ask(&ana, 'a', 1), [1]);
    table.answered.remove(&0);
    assert_eq!(table.ask(&ana, 'a', 2), [1, 0]);
}

#[test]
fn what_is_asked_again_comes_first_unless_it_is_with_somebody_else() {
    let (ana, ben) = (holder("ana", ""), holder("ben", ""));
    let mut table = Table::new();
    assert_eq!(table.ask(&ana, 'a', 2), [0, 1]);
    assert_eq!(table.ask_first(&ana, 'a', 2, 7), [7, 0]);
    assert_eq!(table.ask_first(&ana, 'a', 2, 0), [0, 7]);
    assert_eq!(table.ask_first(&ben, 'a', 2, 7), [1, 2]);
    table.now += QUERY_LEASE_TIME;
    assert_eq!(table.ask_first(&ben, 'a', 2, 7), [7, 0]);
}

#[derive(Debug, Clone)]
enum Step {
    Ask(usize, char, usize, Option<usize>),
    Answer(usize),
    Undo(usize),
    Wait(u64),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (0..3usize, prop::sample::select(vec!['a', 'b']), 1..6usize, prop::option::of(0..10usize))
            .prop_map(|(who, kind, count, first)| Step::Ask(who, kind, count, first)),
        3 => (0..10usize).prop_map(Step::Answer),
        1 => (0..10usize).prop_map(Step::Undo),
        1 => (1..400u64).prop_map(Step::Wait),
    ]
}

proptest! {
    #[test]
    fn a_query_is_with_one_holder_at_a_time(steps in prop::collection::vec(step(), 0..60)) {
        let holders = ["ana", "ben", "eva"].map(|name| holder(name, ""));
        let mut table = Table::new();
        // The queries that each holder got last, and when.
        let mut given: [(Vec<usize>, Instant); 3] = std::array::from_fn(|_| (Vec::new(), table.now));
        for step in steps {
            match step {
                Step::Answer(index) => drop(table.answered.insert(index)),
                Step::Undo(index) => drop(table.answered.remove(&index)),
                Step::Wait(seconds) => table.now += Duration::from_secs(seconds),
                Step::Ask(who, kind, count, first) => {
                    let queries = match first {
                        Some(index) => table.ask_first(&holders[who], kind, count, index),
                        None => table.ask(&holders[who], kind, count),
                    };
                    let unique: BTreeSet<_> = queries.iter().collect();
                    prop_assert_eq!(unique.len(), queries.len());
                    prop_assert!(queries.iter().all(|index| !table.answered.contains(index)));
                    let mut elsewhere = 0;
                    for (other, (theirs, since)) in given.iter().enumerate() {
                        if other != who && table.now < *since + QUERY_LEASE_TIME {
                            prop_assert!(theirs.iter().all(|index| !queries.contains(index)));
                            elsewhere += theirs.iter().filter(|index| !table.answered.contains(index)).count();
                        }
                    }
                    // No free query is withheld.
                    let free = 10 - table.answered.len() - elsewhere;
                    prop_assert_eq!(queries.len(), count.min(free));
                    given[who] = (queries, table.now);
                }
            }
        }
    }
}
