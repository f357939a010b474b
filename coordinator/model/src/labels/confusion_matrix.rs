//! Confusion matrix of two annotators, and Cohen's kappa.

use std::collections::{BTreeMap, BTreeSet};

/// How often one annotator said one thing where the other said another, of any two whose answers can be paired: two
/// people, or people and the judge.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfusionMatrix<A> {
    counts: BTreeMap<(A, A), u64>,
}

impl<A: Ord> FromIterator<(A, A)> for ConfusionMatrix<A> {
    /// Counts pairs of answers, the first annotator's first.
    fn from_iter<I: IntoIterator<Item = (A, A)>>(answers: I) -> Self {
        let mut counts = BTreeMap::new();
        for pair in answers {
            *counts.entry(pair).or_default() += 1;
        }
        Self { counts }
    }
}

impl<A: Ord + Copy> ConfusionMatrix<A> {
    /// Every answer that either gave, in order.
    pub fn answers(&self) -> BTreeSet<A> {
        let pairs = self.counts.keys();
        pairs.flat_map(|&(one, other)| [one, other]).collect()
    }

    /// How often the first said `one` where the second said `other`.
    pub fn count(&self, one: A, other: A) -> u64 {
        self.counts.get(&(one, other)).copied().unwrap_or(0)
    }

    /// How often the first said `one`.
    pub fn said(&self, one: A) -> u64 {
        self.sum(|said, _| said == one)
    }

    pub fn total(&self) -> u64 {
        self.sum(|_, _| true)
    }

    /// Number of pairs that are the same.
    pub fn same(&self) -> u64 {
        self.sum(|one, other| one == other)
    }

    /// Pairs of different answers with how often each came, in order.
    pub fn confusions(&self) -> impl Iterator<Item = (A, A, u64)> {
        let pairs = self.counts.iter().filter(|((one, other), _)| one != other);
        pairs.map(|(&(one, other), &count)| (one, other, count))
    }

    /// Cohen's kappa (1960), at most 1: the agreement beyond what chance would give, as a share of what there could be.
    /// `None` where chance leaves nothing to be shared: both said one and the same throughout, or there is no pair.
    pub fn kappa(&self) -> Option<f64> {
        let mut margins: BTreeMap<A, [u64; 2]> = BTreeMap::new();
        for (&(one, other), count) in &self.counts {
            margins.entry(one).or_default()[0] += count;
            margins.entry(other).or_default()[1] += count;
        }
        let by_chance: u64 = margins.into_values().map(|[one, other]| one * other).sum();
        let total = self.total();
        // Both shares times the square of the number of pairs, so that only the division rounds.
        let room = total * total - by_chance;
        (room > 0).then(|| ((self.same() * total) as f64 - by_chance as f64) / room as f64)
    }

    fn sum(&self, wanted: impl Fn(A, A) -> bool) -> u64 {
        let counts = self
            .counts
            .iter()
            .filter(|((one, other), _)| wanted(*one, *other));
        counts.map(|(_, count)| count).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two annotators who gave the answers of each row and column so many times.
    fn table<const N: usize>(counts: [[usize; N]; N]) -> ConfusionMatrix<usize> {
        let cells = (0..N).flat_map(|one| (0..N).map(move |other| (one, other)));
        cells
            .flat_map(|(one, other)| std::iter::repeat_n((one, other), counts[one][other]))
            .collect()
    }

    #[test]
    fn kappa_by_hand() {
        // Observed 35/50, by chance (25 * 30 + 25 * 20) / 2500 = 0.5.
        let two = table([[20, 5], [10, 15]]);
        assert_eq!((two.same(), two.total(), two.said(0)), (35, 50, 25));
        assert_eq!(two.kappa(), Some(0.4));
        // Observed 13/20, by chance (8 * 7 + 6 * 6 + 6 * 7) / 400 = 134/400: (260 - 134) / (400 - 134).
        assert_eq!(
            table([[5, 1, 2], [1, 4, 1], [1, 1, 4]]).kappa(),
            Some(126.0 / 266.0)
        );
        // As often right as by chance, and always wrong.
        assert_eq!(table([[1, 1], [1, 1]]).kappa(), Some(0.0));
        assert_eq!(table([[0, 3], [3, 0]]).kappa(), Some(-1.0));
    }

    #[test]
    fn kappa_of_one_answer_or_none_is_undefined() {
        assert_eq!(table([[9, 0], [0, 0]]).kappa(), None);
        assert_eq!(table([[0]]).kappa(), None);
    }
}
