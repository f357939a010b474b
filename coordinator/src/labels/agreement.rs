//! How far two annotators agree, over the individuals to which both gave a class.

use super::ClassName;
use std::{cmp::Reverse, collections::BTreeMap};

/// Two annotators compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// Individuals to which both gave a class.
    pub both: u64,
    /// Those to which they gave the same.
    pub agreed: u64,
    /// Cohen's kappa (1960), at most 1: the agreement beyond what chance would give, as a share of what there could be.
    /// `None` where chance leaves nothing to be shared: both gave one and the same class throughout, or there is no
    /// individual.
    pub kappa: Option<f64>,
    /// Which classes are taken for which, the most frequent first.
    pub confusions: Vec<Confusion>,
    /// Where they differ, by individual.
    pub disagreements: Vec<Disagreement>,
}

/// Two different classes for the same individuals.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confusion {
    /// What the first annotator gave.
    pub first: ClassName,
    /// What the second gave.
    pub second: ClassName,
    /// To how many individuals.
    pub individuals: u64,
}

/// Two different classes for one individual.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Disagreement {
    /// Index of the individual.
    pub index: u64,
    /// What the first annotator gave.
    pub first: ClassName,
    /// What the second gave.
    pub second: ClassName,
}

impl Agreement {
    /// Compares the classes that two annotators gave, by individual.
    #[must_use]
    pub fn between(first: &BTreeMap<u64, ClassName>, second: &BTreeMap<u64, ClassName>) -> Self {
        let both = first
            .iter()
            .filter_map(|(index, one)| Some((*index, one, second.get(index)?)));
        let both: Vec<(u64, &ClassName, &ClassName)> = both.collect();
        let differ: Vec<_> = both.iter().filter(|(_, one, other)| one != other).collect();
        let agreed = both.len() - differ.len();
        Self {
            both: both.len() as u64,
            agreed: agreed as u64,
            kappa: kappa(&both, agreed),
            confusions: confusions(differ.iter().map(|(_, one, other)| (*one, *other))),
            disagreements: differ
                .iter()
                .map(|&&(index, one, other)| Disagreement {
                    index,
                    first: one.clone(),
                    second: other.clone(),
                })
                .collect(),
        }
    }
}

/// (observed - chance) / (1 - chance), both as counts over the square of the number of individuals: one rounding.
fn kappa(both: &[(u64, &ClassName, &ClassName)], agreed: usize) -> Option<f64> {
    let mut counts: BTreeMap<&ClassName, [u64; 2]> = BTreeMap::new();
    for (_, one, other) in both {
        counts.entry(one).or_default()[0] += 1;
        counts.entry(other).or_default()[1] += 1;
    }
    let all = both.len() as f64;
    let by_chance: f64 = counts.values().map(|[one, other]| (one * other) as f64).sum();
    let room = all * all - by_chance;
    (room > 0.0).then(|| (agreed as f64 * all - by_chance) / room)
}

fn confusions<'a>(pairs: impl Iterator<Item = (&'a ClassName, &'a ClassName)>) -> Vec<Confusion> {
    let mut counts: BTreeMap<_, u64> = BTreeMap::new();
    for pair in pairs {
        *counts.entry(pair).or_default() += 1;
    }
    let mut confusions: Vec<_> = counts
        .into_iter()
        .map(|((first, second), individuals)| Confusion {
            first: first.clone(),
            second: second.clone(),
            individuals,
        })
        .collect();
    confusions.sort_by_key(|confusion| Reverse(confusion.individuals));
    confusions
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn classes(names: &[&str]) -> BTreeMap<u64, ClassName> {
        let names = names.iter().map(|name| name.parse().unwrap());
        (0..).zip(names).collect()
    }

    /// Two annotators who gave the class of each row and column so many times.
    fn table<const N: usize>(names: [&str; N], counts: [[usize; N]; N]) -> Agreement {
        let (mut first, mut second) = (Vec::new(), Vec::new());
        for (row, one) in counts.iter().zip(names) {
            for (count, other) in row.iter().zip(names) {
                first.extend(std::iter::repeat_n(one, *count));
                second.extend(std::iter::repeat_n(other, *count));
            }
        }
        Agreement::between(&classes(&first), &classes(&second))
    }

    #[test]
    fn kappa_by_hand() {
        // Observed 35/50, by chance (25 * 30 + 25 * 20) / 2500 = 0.5.
        let two = table(["ring", "clump"], [[20, 5], [10, 15]]);
        assert_eq!((two.both, two.agreed, two.kappa), (50, 35, Some(0.4)));
        // Observed 13/20, by chance (8 * 7 + 6 * 6 + 6 * 7) / 400 = 134/400: (260 - 134) / (400 - 134).
        let three = table(["a", "b", "c"], [[5, 1, 2], [1, 4, 1], [1, 1, 4]]);
        assert_eq!(three.kappa, Some(126.0 / 266.0));
        // As often right as by chance, and always wrong.
        assert_eq!(table(["a", "b"], [[1, 1], [1, 1]]).kappa, Some(0.0));
        assert_eq!(table(["a", "b"], [[0, 3], [3, 0]]).kappa, Some(-1.0));
    }

    #[test]
    fn without_room_there_is_no_kappa() {
        assert_eq!(table(["a", "b"], [[9, 0], [0, 0]]).kappa, None);
        assert_eq!(Agreement::between(&classes(&["a"]), &classes(&[])).kappa, None);
    }

    #[test]
    fn disagreements_are_listed_and_counted() {
        let first = classes(&["ring", "ring", "clump", "ring", "wall", "ring"]);
        let mut second = classes(&["ring", "clump", "ring", "clump", "wall", "ring"]);
        second.remove(&5);
        let agreement = Agreement::between(&first, &second);
        assert_eq!((agreement.both, agreement.agreed), (5, 2));
        let confusions: Vec<_> = agreement
            .confusions
            .iter()
            .map(|confusion| {
                (
                    confusion.first.as_str(),
                    confusion.second.as_str(),
                    confusion.individuals,
                )
            })
            .collect();
        assert_eq!(confusions, [("ring", "clump", 2), ("clump", "ring", 1)]);
        let places: Vec<_> = agreement
            .disagreements
            .iter()
            .map(|difference| difference.index)
            .collect();
        assert_eq!(places, [1, 2, 3]);
    }

    fn some_classes() -> impl Strategy<Value = BTreeMap<u64, ClassName>> {
        let class = prop::sample::select(vec!["a", "b", "c"]).prop_map(|name| name.parse().unwrap());
        prop::collection::btree_map(0u64..30, class, 0..30)
    }

    proptest! {
        #[test]
        fn who_comes_first_does_not_matter(first in some_classes(), second in some_classes()) {
            let (there, back) = (Agreement::between(&first, &second), Agreement::between(&second, &first));
            prop_assert_eq!(there.kappa, back.kappa);
            prop_assert_eq!((there.both, there.agreed), (back.both, back.agreed));
            prop_assert_eq!(there.both - there.agreed, there.disagreements.len() as u64);
            prop_assert!(there.kappa.is_none_or(|kappa| (-1.0..=1.0).contains(&kappa)));
            let confused: u64 = there.confusions.iter().map(|confusion| confusion.individuals).sum();
            prop_assert_eq!(confused, there.both - there.agreed);
        }

        #[test]
        fn one_agrees_with_oneself(own in some_classes()) {
            let agreement = Agreement::between(&own, &own);
            prop_assert!(agreement.kappa.is_none_or(|kappa| kappa == 1.0));
            prop_assert!(agreement.disagreements.is_empty());
        }
    }
}
