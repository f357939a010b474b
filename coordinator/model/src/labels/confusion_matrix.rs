//! Confusion matrix of two annotators, and Cohen's kappa.

use std::collections::{BTreeMap, BTreeSet};

/// Counts of each pair of answers by two annotators: two people, or people and the judge.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfusionMatrix<A> {
    counts: BTreeMap<(A, A), u64>,
}

impl<A: Ord> FromIterator<(A, A)> for ConfusionMatrix<A> {
    /// Counts pairs of answers, each with the first annotator's answer first.
    fn from_iter<I: IntoIterator<Item = (A, A)>>(answers: I) -> Self {
        let mut counts = BTreeMap::new();
        for pair in answers {
            *counts.entry(pair).or_default() += 1;
        }
        Self { counts }
    }
}

impl<A: Ord + Copy> ConfusionMatrix<A> {
    /// Every answer of either annotator, in order.
    pub fn answers(&self) -> BTreeSet<A> {
        let pairs = self.counts.keys();
        pairs.flat_map(|&(one, other)| [one, other]).collect()
    }

    /// Number of pairs in which the first annotator answered `one` and the second annotator `other`.
    pub fn count(&self, one: A, other: A) -> u64 {
        self.counts.get(&(one, other)).copied().unwrap_or(0)
    }

    /// Number of pairs in which the first annotator answered `one`.
    pub fn answered(&self, one: A) -> u64 {
        self.sum(|message, _| message == one)
    }

    pub fn total(&self) -> u64 {
        self.sum(|_, _| true)
    }

    /// Number of pairs of equal answers.
    pub fn same(&self) -> u64 {
        self.sum(|one, other| one == other)
    }

    /// Pairs of different answers with their counts, in order.
    pub fn confusions(&self) -> impl Iterator<Item = (A, A, u64)> {
        let pairs = self.counts.iter().filter(|((one, other), _)| one != other);
        pairs.map(|(&(one, other), &count)| (one, other, count))
    }

    /// Cohen's kappa (1960), at most 1: the agreement beyond chance, as a share of the greatest possible agreement beyond chance.
    /// `None` if there are no pairs, or if both annotators always gave the same one answer.
    pub fn kappa(&self) -> Option<f64> {
        let mut margins: BTreeMap<A, [u64; 2]> = BTreeMap::new();
        for (&(one, other), count) in &self.counts {
            margins.entry(one).or_default()[0] += count;
            margins.entry(other).or_default()[1] += count;
        }
        let by_chance: u64 = margins.into_values().map(|[one, other]| one * other).sum();
        let total = self.total();
        // Observed agreement and agreement by chance are multiplied by the square of the number of pairs, so that only the
        // division rounds.
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

    /// The matrix of two annotators: `counts` has a row for each answer of the first, and a column for each answer of the second.
    fn table<const N: usize>(counts: [[usize; N]; N]) -> ConfusionMatrix<usize> {
        let cells = (0..N).flat_map(|one| (0..N).map(move |other| (one, other)));
        cells
            .flat_map(|(one, other)| std::iter::repeat_n((one, other), counts[one][other]))
            .collect()
    }

    #[test]
    fn kappa_by_hand() {
        // The observed agreement is 35/50, by chance (25 * 30 + 25 * 20) / 2500 = 0.5.
        let two = table([[20, 5], [10, 15]]);
        assert_eq!((two.same(), two.total(), two.answered(0)), (35, 50, 25));
        assert_eq!(two.kappa(), Some(0.4));
        // The observed agreement is 13/20, by chance (8 * 7 + 6 * 6 + 6 * 7) / 400 = 134/400: (260 - 134) / (400 - 134).
        assert_eq!(
            table([[5, 1, 2], [1, 4, 1], [1, 1, 4]]).kappa(),
            Some(126.0 / 266.0)
        );
        // In the first matrix the annotators agree as often as by chance, in the second never.
        assert_eq!(table([[1, 1], [1, 1]]).kappa(), Some(0.0));
        assert_eq!(table([[0, 3], [3, 0]]).kappa(), Some(-1.0));
    }

    #[test]
    fn kappa_of_one_answer_or_none_is_undefined() {
        assert_eq!(table([[9, 0], [0, 0]]).kappa(), None);
        assert_eq!(table([[0]]).kappa(), None);
    }
}
