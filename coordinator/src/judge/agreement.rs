//! How well two annotators agree, class by class.

use std::collections::{BTreeMap, BTreeSet};

/// How often one annotator said one thing and the other another.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Agreement {
    counts: BTreeMap<(String, String), u64>,
}

impl Agreement {
    /// Counts pairs of answers, one annotator's first.
    #[must_use]
    pub fn of<'a>(answers: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut agreement = Self::default();
        for (one, other) in answers {
            *agreement
                .counts
                .entry((one.to_owned(), other.to_owned()))
                .or_default() += 1;
        }
        agreement
    }

    /// Every answer that either gave, in alphabetical order.
    #[must_use]
    pub fn answers(&self) -> BTreeSet<&str> {
        self.counts
            .keys()
            .flat_map(|(one, other)| [one.as_str(), other.as_str()])
            .collect()
    }

    /// How often the first annotator said `one` where the second said `other`.
    #[must_use]
    pub fn count(&self, one: &str, other: &str) -> u64 {
        self.counts
            .get(&(one.to_owned(), other.to_owned()))
            .copied()
            .unwrap_or(0)
    }

    /// How often the first annotator said `one`.
    #[must_use]
    pub fn said(&self, one: &str) -> u64 {
        self.sum(|(said, _)| said == one)
    }

    /// Number of pairs.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.sum(|_| true)
    }

    /// Number of pairs that are the same.
    #[must_use]
    pub fn same(&self) -> u64 {
        self.sum(|(one, other)| one == other)
    }

    /// Cohen's kappa: agreement beyond what chance gives, 1 for perfect; `None` where chance alone gives all of it, or there
    /// is no pair.
    #[must_use]
    pub fn kappa(&self) -> Option<f64> {
        let total = self.total() as f64;
        if total == 0.0 {
            return None;
        }
        let observed = self.same() as f64 / total;
        let by_chance = |answer: &str| {
            let one = self.sum(|(said, _)| said == answer) as f64;
            let other = self.sum(|(_, said)| said == answer) as f64;
            one * other / (total * total)
        };
        let expected: f64 = self.answers().into_iter().map(by_chance).sum();
        (expected < 1.0).then(|| (observed - expected) / (1.0 - expected))
    }

    fn sum(&self, wanted: impl Fn(&(String, String)) -> bool) -> u64 {
        let counts = self.counts.iter().filter(|(pair, _)| wanted(pair));
        counts.map(|(_, count)| count).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kappa_by_hand() {
        // Observed 0.7; by chance 0.5 * 0.6 + 0.5 * 0.4 = 0.5.
        let pairs = [("a", "a", 20), ("a", "b", 5), ("b", "a", 10), ("b", "b", 15)];
        let pairs = pairs
            .iter()
            .flat_map(|&(one, other, times)| vec![(one, other); times]);
        let agreement = Agreement::of(pairs);
        assert_eq!(
            (agreement.same(), agreement.total(), agreement.said("a")),
            (35, 50, 25)
        );
        assert!((agreement.kappa().unwrap() - 0.4).abs() < 1e-12);
    }

    #[test]
    fn kappa_of_one_answer_or_none_is_undefined() {
        assert_eq!(Agreement::of([("a", "a"); 3]).kappa(), None);
        assert_eq!(Agreement::of([]).kappa(), None);
    }
}
