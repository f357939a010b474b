//! Agreement of two annotators, over the individuals to which both gave a class.

use super::{ClassName, ConfusionMatrix};
use std::{cmp::Reverse, collections::BTreeMap};

/// The comparison of two annotators.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// Individuals to which both gave a class.
    pub both: u64,
    /// Individuals to which both gave the same class.
    pub agreed: u64,
    /// Cohen's kappa, from [`ConfusionMatrix::kappa`].
    pub kappa: Option<f64>,
    /// Pairs of classes that the annotators confuse, the most frequent first.
    pub confusions: Vec<Confusion>,
    /// The individuals to which the annotators gave different classes.
    pub disagreements: Vec<Disagreement>,
}

/// Two different classes for the same individuals.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Confusion {
    /// The class from the first annotator.
    pub first: ClassName,
    /// The class from the second annotator.
    pub second: ClassName,
    /// Number of individuals with these two classes.
    pub individuals: u64,
}

/// Two different classes for one individual.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Disagreement {
    pub index: u64,
    /// The class from the first annotator.
    pub first: ClassName,
    /// The class from the second annotator.
    pub second: ClassName,
}

impl Agreement {
    /// Compares the classes that two annotators gave, by individual.
    pub fn between(first: &BTreeMap<u64, ClassName>, second: &BTreeMap<u64, ClassName>) -> Self {
        let both = first
            .iter()
            .filter_map(|(index, one)| Some((*index, one, second.get(index)?)));
        let both: Vec<(u64, &ClassName, &ClassName)> = both.collect();
        let matrix: ConfusionMatrix<_> = both.iter().map(|&(_, one, other)| (one, other)).collect();
        let differ = both.into_iter().filter(|(_, one, other)| one != other);
        Self {
            both: matrix.total(),
            agreed: matrix.same(),
            kappa: matrix.kappa(),
            confusions: confusions(&matrix),
            disagreements: differ
                .map(|(index, one, other)| Disagreement {
                    index,
                    first: one.clone(),
                    second: other.clone(),
                })
                .collect(),
        }
    }
}

fn confusions(matrix: &ConfusionMatrix<&ClassName>) -> Vec<Confusion> {
    let confusions = matrix.confusions().map(|(first, second, individuals)| Confusion {
        first: first.clone(),
        second: second.clone(),
        individuals,
    });
    let mut confusions: Vec<_> = confusions.collect();
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
