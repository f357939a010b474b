//! The paper's L2 triplet accuracy (section 5.2), counted exactly.

use std::collections::BTreeMap;

/// The class of behaviours that fit no other class.
pub const RANDOM: &str = "random";

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Triplets whose anchor is nearer to the positive than to the negative.
    pub correct: u64,
    pub triplets: u64,
}

/// The triplets of a labelled set, by class of their anchor.
///
/// A triplet (a, p, n) is admissible if a and p are of one class, n is of another, and a is not p. It is correct if the
/// Euclidean distance from a to p is less than that from a to n; ties are not correct.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Accuracy {
    classes: BTreeMap<String, Tally>,
}

impl Tally {
    /// The share of triplets that are correct, in percent; `None` if there is no triplet.
    pub fn percent(&self) -> Option<f64> {
        (self.triplets > 0).then(|| 100.0 * self.correct as f64 / self.triplets as f64)
    }

    fn plus(self, other: Self) -> Self {
        Self {
            correct: self.correct + other.correct,
            triplets: self.triplets + other.triplets,
        }
    }
}

impl Accuracy {
    /// Counts all admissible triplets of `behaviours`; each behaviour has a class and a vector. All vectors must be finite and of
    /// one length.
    pub fn measure(behaviours: &[(&str, Vec<f64>)]) -> Self {
        let mut classes: BTreeMap<String, Tally> = BTreeMap::new();
        for anchor in 0..behaviours.len() {
            let tally = classes.entry(behaviours[anchor].0.to_owned()).or_default();
            *tally = tally.plus(with_anchor(behaviours, anchor));
        }
        Self { classes }
    }

    /// Each class that occurs, by name, with the triplets whose anchor has this class.
    pub fn classes(&self) -> impl Iterator<Item = (&str, Tally)> {
        self.classes.iter().map(|(class, tally)| (class.as_str(), *tally))
    }

    /// Triplets with anchors of every class, as the text of the paper counts triplets.
    pub fn every_anchor(&self) -> Tally {
        self.sum(|_| true)
    }

    /// Triplets whose anchor is not [`RANDOM`], as the code of the paper's authors counts triplets. Behaviours of the class
    /// `random` still serve as negatives.
    pub fn anchor_not_random(&self) -> Tally {
        self.sum(|class| class != RANDOM)
    }

    fn sum(&self, wanted: impl Fn(&str) -> bool) -> Tally {
        let wanted = self.classes().filter(|(class, _)| wanted(class));
        wanted.fold(Tally::default(), |sum, (_, tally)| sum.plus(tally))
    }
}

/// Counts the triplets with one anchor. A triplet is correct if its negative is farther away than its positive.
fn with_anchor(behaviours: &[(&str, Vec<f64>)], anchor: usize) -> Tally {
    let (class, from) = &behaviours[anchor];
    let (mut positives, mut negatives) = (Vec::new(), Vec::new());
    for (i, (other, to)) in behaviours.iter().enumerate() {
        if other != class {
            negatives.push(squared_distance(from, to));
        } else if i != anchor {
            positives.push(squared_distance(from, to));
        }
    }
    negatives.sort_by(f64::total_cmp);
    let farther =
        |positive: &f64| negatives.len() - negatives.partition_point(|negative| negative <= positive);
    Tally {
        correct: positives.iter().map(|positive| farther(positive) as u64).sum(),
        triplets: positives.len() as u64 * negatives.len() as u64,
    }
}

/// Squared distances are compared, because a square root could make ties.
fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Mean and spread of at least one figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// The mean, in the unit of the figures.
    pub mean: f64,
    /// The sample standard deviation (over n - 1), in the unit of the figures; `None` for a single figure.
    pub deviation: Option<f64>,
}

impl Summary {
    /// Summarises finite figures; returns `None` if `figures` is empty.
    pub fn of(figures: &[f64]) -> Option<Self> {
        let count = figures.len() as f64;
        let mean = (!figures.is_empty()).then(|| figures.iter().sum::<f64>() / count)?;
        let squares: f64 = figures
            .iter()
            .map(|figure| (figure - mean) * (figure - mean))
            .sum();
        Some(Self {
            mean,
            deviation: (figures.len() > 1).then(|| (squares / (count - 1.0)).sqrt()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tally(correct: u64, triplets: u64) -> Tally {
        Tally { correct, triplets }
    }

    #[test]
    fn a_small_set_by_hand() {
        let on_a_line = [
            ("ring", 0.0),
            ("ring", 1.0),
            ("clump", 2.0),
            ("clump", 10.0),
            (RANDOM, 4.0),
        ];
        let accuracy = Accuracy::measure(&on_a_line.map(|(class, x)| (class, vec![x])));
        let expected = [
            // From the clump at 2, all three negatives are nearer than the other clump. From the clump at 10, only the two rings
            // are farther than the other clump.
            ("clump", tally(2, 6)),
            (RANDOM, tally(0, 0)),
            // From the ring at 0, all three negatives are farther than the other ring. From the ring at 1, the clump at 2 is as
            // far as the other ring.
            ("ring", tally(5, 6)),
        ];
        assert_eq!(accuracy.classes().collect::<Vec<_>>(), expected);
        assert_eq!(accuracy.every_anchor(), tally(7, 12));
    }

    #[test]
    fn random_behaviours_are_negatives_and_never_anchors() {
        let on_a_line = [("ring", 0.0), ("ring", 3.0), (RANDOM, 1.0), (RANDOM, 5.0)];
        let accuracy = Accuracy::measure(&on_a_line.map(|(class, x)| (class, vec![x])));
        assert_eq!(accuracy.anchor_not_random(), tally(1, 4));
        assert_eq!(accuracy.every_anchor(), tally(2, 8));
    }

    #[test]
    fn a_collapsed_embedding_has_nothing_right() {
        let behaviours = ["ring", "ring", "clump"].map(|class| (class, vec![1.0, 2.0]));
        assert_eq!(Accuracy::measure(&behaviours).every_anchor(), tally(0, 2));
    }

    #[test]
    fn without_triplets_there_is_no_percentage() {
        assert_eq!(Accuracy::measure(&[]).every_anchor().percent(), None);
        assert_eq!(tally(1, 8).percent(), Some(12.5));
    }

    /// Counts every triplet, one by one.
    fn one_by_one(behaviours: &[(&str, Vec<f64>)]) -> Tally {
        let mut counted = Tally::default();
        for (i, a) in behaviours.iter().enumerate() {
            for (j, p) in behaviours
                .iter()
                .enumerate()
                .filter(|(j, p)| *j != i && p.0 == a.0)
            {
                assert_ne!(i, j);
                for n in behaviours.iter().filter(|n| n.0 != a.0) {
                    counted.triplets += 1;
                    counted.correct += u64::from(squared_distance(&a.1, &p.1) < squared_distance(&a.1, &n.1));
                }
            }
        }
        counted
    }

    proptest! {
        #[test]
        fn counting_agrees_with_looking_at_every_triplet(
            // The coordinates have only four values, so that some distances are equal.
            behaviours in prop::collection::vec(
                (prop::sample::select(vec!["a", "b", "c", RANDOM]), prop::collection::vec((0..4).prop_map(f64::from), 2)),
                0..24,
            ),
        ) {
            prop_assert_eq!(Accuracy::measure(&behaviours).every_anchor(), one_by_one(&behaviours));
        }
    }

    #[test]
    fn a_summary_by_hand() {
        let summary = |mean, deviation| Some(Summary { mean, deviation });
        assert_eq!(
            Summary::of(&[2.0, 4.0, 4.0, 6.0, 9.0]),
            summary(5.0, Some(7.0_f64.sqrt()))
        );
        assert_eq!(Summary::of(&[3.0]), summary(3.0, None));
        assert_eq!(Summary::of(&[]), None);
    }
}
