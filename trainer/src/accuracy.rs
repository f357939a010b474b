//! How well distances tell classes apart: the paper's triplet accuracy.

/// Shares of triplets (anchor, another of its class, one of another class) whose anchor is strictly nearer to its
/// like (paper, "Embedding accuracy").
#[derive(Debug, Clone, PartialEq)]
pub struct TripletAccuracy {
    /// Correct and all admissible triplets by the class of the anchor.
    pub by_class: Vec<(u64, u64)>,
}

impl TripletAccuracy {
    /// Counts every admissible triplet. `vectors` holds `dimensions` numbers a behaviour; `classes` numbers their
    /// classes from 0.
    #[must_use]
    pub fn of(vectors: &[f64], dimensions: usize, classes: &[usize]) -> Self {
        let count = classes.iter().max().map_or(0, |&last| last + 1);
        let mut by_class = vec![(0, 0); count];
        let vector = |i: usize| &vectors[i * dimensions..][..dimensions];
        for (anchor, &class) in classes.iter().enumerate() {
            let mut others: Vec<(f64, bool)> = (0..classes.len())
                .filter(|&other| other != anchor)
                .map(|other| {
                    (
                        squared_distance(vector(anchor), vector(other)),
                        classes[other] == class,
                    )
                })
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (correct, all) = correct_pairs(&others);
            by_class[class].0 += correct;
            by_class[class].1 += all;
        }
        Self { by_class }
    }

    /// The share over anchors of the classes that `counts` accepts, 0 to 1; `None` without a triplet.
    #[must_use]
    pub fn over(&self, counts: impl Fn(usize) -> bool) -> Option<f64> {
        let classes = self
            .by_class
            .iter()
            .enumerate()
            .filter(|(class, _)| counts(*class));
        let sums = classes.fold((0, 0), |sums, (_, counts)| (sums.0 + counts.0, sums.1 + counts.1));
        (sums.1 > 0).then(|| sums.0 as f64 / sums.1 as f64)
    }
}

/// Of pairs of one like and one unlike: how many have the like strictly nearer, and how many there are.
fn correct_pairs(by_distance: &[(f64, bool)]) -> (u64, u64) {
    let likes = by_distance.iter().filter(|other| other.1).count() as u64;
    let unlikes = by_distance.len() as u64 - likes;
    let mut nearer_likes = 0;
    let mut correct = 0;
    for tied in by_distance.chunk_by(|a, b| a.0 == b.0) {
        let tied_likes = tied.iter().filter(|other| other.1).count() as u64;
        correct += nearer_likes * (tied.len() as u64 - tied_likes);
        nearer_likes += tied_likes;
    }
    (correct, likes * unlikes)
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_triplet_counts_once(points in prop::collection::vec((0..5u8, 0..3usize), 1..20)) {
            let vectors: Vec<f64> = points.iter().map(|point| f64::from(point.0)).collect();
            let classes: Vec<usize> = points.iter().map(|point| point.1).collect();
            let mut expected = vec![(0, 0); classes.iter().max().unwrap() + 1];
            for a in 0..points.len() {
                for p in (0..points.len()).filter(|&p| p != a && classes[p] == classes[a]) {
                    for n in (0..points.len()).filter(|&n| classes[n] != classes[a]) {
                        let near = (vectors[a] - vectors[p]).abs() < (vectors[a] - vectors[n]).abs();
                        expected[classes[a]].0 += u64::from(near);
                        expected[classes[a]].1 += 1;
                    }
                }
            }
            prop_assert_eq!(TripletAccuracy::of(&vectors, 1, &classes).by_class, expected);
        }
    }

    #[test]
    fn without_a_second_class_there_is_nothing_to_say() {
        assert_eq!(TripletAccuracy::of(&[1.0, 2.0], 1, &[0, 0]).over(|_| true), None);
    }
}
