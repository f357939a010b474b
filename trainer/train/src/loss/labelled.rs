//! Labelled in-batch triplets: for any anchor, every other picture of its class is a positive and every picture of another class
//! a negative. The loss is the mean over violated triplets only, weighted by the classes of each triplet.

use super::{distance, is_violated, push};
use crate::real::Real;

/// The size and weight of a class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ClassShare {
    /// Number of labelled pictures of the class.
    pub(crate) size: usize,
    /// Weight of the class's anchors relative to the anchors of other classes, 0 to 1.
    pub(crate) anchors: f64,
}

/// Weights of triplets by the classes of anchor and negative.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Weights {
    classes: usize,
    /// `classes` x `classes` weights: a row for each class of anchors, a column for each class of negatives.
    values: Vec<f64>,
}

impl Weights {
    /// The weights for these classes. A negative counts in proportion to the size of its class. A step has equally many pictures
    /// of every class and so shows rare classes too often, while most confusions are with common classes. An anchor counts in
    /// proportion to the square root of its class's size, a compromise between equal weights per class and equal weights per
    /// picture.
    pub(crate) fn of_classes(shares: &[ClassShare]) -> Self {
        let classes = shares.len();
        let all: usize = shares.iter().map(|share| share.size).sum();
        let mut values = vec![0.0; classes * classes];
        for (place, value) in values.iter_mut().enumerate() {
            let (anchor, negative) = (place / classes, place % classes);
            if anchor != negative {
                let [own, other] = [anchor, negative].map(|class| shares[class].size as f64);
                *value = shares[anchor].anchors * own.sqrt() * other / (all as f64 - own);
            }
        }
        Self { classes, values }
    }

    fn of(&self, anchor: usize, negative: usize) -> f64 {
        self.values[anchor * self.classes + negative]
    }
}

/// The weighted mean of d(anchor, positive) - d(anchor, negative) + margin over the triplets where this sum is positive; 0 if
/// there is no such triplet.
///
/// `embeddings` has equally many embeddings of each class, class after class in the order of `weights`, of `dimensions` numbers
/// each. `gradient` becomes the gradient with respect to the embeddings.
pub(crate) fn loss<T: Real>(
    embeddings: &[T],
    dimensions: usize,
    weights: &Weights,
    margin: f64,
    gradient: &mut [T],
) -> f64 {
    let pictures: Vec<&[T]> = embeddings.chunks_exact(dimensions).collect();
    let count = pictures.len();
    let per_class = count / weights.classes;
    let mut total = 0.0;
    let mut violated = 0.0;
    // For each distance from an anchor to another picture: the weight of the triplets that shrink the distance, minus the weight
    // of the triplets that increase it.
    let mut pulls = vec![0.0; count * count];
    let mut distances = vec![0.0; count * count];
    for (anchor, pulls) in pulls.chunks_exact_mut(count).enumerate() {
        let row = &mut distances[anchor * count..][..count];
        for (to, other) in row.iter_mut().zip(&pictures) {
            *to = distance(pictures[anchor], other);
        }
        let class = anchor / per_class;
        let first = class * per_class;
        let own = first..first + per_class;
        for positive in own.clone().filter(|&positive| positive != anchor) {
            for negative in (0..first).chain(own.end..count) {
                let violation = row[positive] - row[negative] + margin;
                if is_violated(violation) {
                    let weight = weights.of(class, negative / per_class);
                    total += weight * violation;
                    violated += weight;
                    pulls[positive] += weight;
                    pulls[negative] -= weight;
                }
            }
        }
    }
    let share = if violated > 0.0 { 1.0 / violated } else { 0.0 };
    let mut slopes = vec![0.0; embeddings.len()];
    for (place, pull) in pulls.into_iter().enumerate().filter(|(_, pull)| *pull != 0.0) {
        let (anchor, other) = (place / count, place % count);
        let by_anchor = anchor * dimensions..(anchor + 1) * dimensions;
        let by_other = other * dimensions..(other + 1) * dimensions;
        if let Ok([d_anchor, d_other]) = slopes.get_disjoint_mut([by_anchor, by_other]) {
            let far = distances[place];
            push(
                pictures[anchor],
                pictures[other],
                far,
                pull * share,
                d_anchor,
                d_other,
            );
        }
    }
    for (gradient, slope) in gradient.iter_mut().zip(slopes) {
        *gradient = T::of(slope);
    }
    total * share
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{Purpose, RandomStream};
    use rand::RngExt as _;

    /// Weights of classes of these sizes, with equal weights for anchors.
    fn by_size(sizes: &[usize]) -> Weights {
        let share = |&size: &usize| ClassShare { size, anchors: 1.0 };
        Weights::of_classes(&sizes.iter().map(share).collect::<Vec<_>>())
    }

    #[test]
    fn only_violated_triplets_count() {
        // Anchor 0 has its own class at distance 1 and the other class at 3 and 9. Anchor 3 has its own class at 6 and the other
        // class at 3 and 2.
        let embeddings = [0.0, 1.0, 3.0, 9.0];
        let loss = loss(&embeddings, 1, &by_size(&[2, 2]), 2.5, &mut [0.0; 4]);
        let violations = [1.0 - 3.0 + 2.5, 1.0 - 2.0 + 2.5, 6.0 - 3.0 + 2.5, 6.0 - 2.0 + 2.5];
        // Anchor 9 has its own class at 6 and the other class at 9 and 8, so it has one violation of 0.5.
        let mean = (violations.iter().sum::<f64>() + 0.5) / 5.0;
        assert!((loss - mean).abs() < 1e-5, "{loss} is not {mean}");
    }

    #[test]
    fn classes_that_are_apart_have_no_loss_and_no_gradient() {
        let mut gradient = [7.0; 4];
        let weights = by_size(&[3, 9]);
        assert_eq!(loss(&[0.0, 0.1, 5.0, 5.1], 1, &weights, 1.0, &mut gradient), 0.0);
        assert_eq!(gradient, [0.0; 4]);
    }

    #[test]
    fn negatives_count_by_the_size_of_their_class_and_anchors_by_its_root() {
        let weights = by_size(&[4, 9, 27]);
        assert_eq!(weights.of(0, 2), 3.0 * weights.of(0, 1));
        assert_eq!(weights.of(0, 1) + weights.of(0, 2), 2.0);
        assert_eq!(weights.of(1, 0) + weights.of(1, 2), 3.0);
        let embeddings = [0.0, 0.0, 0.5, 0.5, -0.25, -0.25];
        let mean = loss(&embeddings, 1, &weights, 0.3, &mut [0.0; 6]);
        // The first and third classes are 0.05 too near to each other; the second class is far enough from both.
        assert!((mean - 0.05).abs() < 1e-5, "{mean}");
        let wide = loss(&embeddings, 1, &weights, 0.6, &mut [0.0; 6]);
        let [first, second, third] = [[0.1, 0.35], [0.1, 0.0], [0.35, 0.0]];
        let sums = [
            weights.of(0, 1) * first[0] + weights.of(0, 2) * first[1],
            weights.of(1, 0) * second[0],
            weights.of(2, 0) * third[0],
        ];
        let masses = [
            weights.of(0, 1) + weights.of(0, 2),
            weights.of(1, 0),
            weights.of(2, 0),
        ];
        let expected = sums.iter().sum::<f64>() / masses.iter().sum::<f64>();
        assert!((wide - expected).abs() < 1e-5, "{wide}, not {expected}");
    }

    #[test]
    fn anchors_of_a_class_may_count_less_and_are_negatives_as_before() {
        let alike = by_size(&[4, 9]);
        let share = |size, anchors| ClassShare { size, anchors };
        let less = Weights::of_classes(&[share(4, 0.25), share(9, 1.0)]);
        assert_eq!(less.of(0, 1), alike.of(0, 1) / 4.0);
        assert_eq!(less.of(1, 0), alike.of(1, 0));
        // Anchor 3 has its own class at 3 and the other class at 1: only this anchor violates the margin. The anchors of its
        // class have no weight.
        let none = Weights::of_classes(&[share(4, 0.0), share(9, 1.0)]);
        let embeddings = [0.0, 3.0, 4.0, 4.0];
        let mut gradient = [7.0; 4];
        let counted = loss(&embeddings, 1, &less, 0.5, &mut gradient);
        assert!((counted - 2.5).abs() < 1e-5, "{counted}");
        assert_ne!(gradient, [0.0; 4]);
        assert_eq!(loss(&embeddings, 1, &none, 0.5, &mut gradient), 0.0);
        assert_eq!(gradient, [0.0; 4]);
    }

    #[test]
    fn the_gradient_is_that_of_the_loss() {
        const STEP: f64 = 1e-6;
        let mut stream = RandomStream::derive(1, Purpose::Train, 0);
        let mut embeddings: Vec<f64> = (0..3 * 4 * 2).map(|_| stream.random_range(-1.0..1.0)).collect();
        let mut gradient = vec![0.0; embeddings.len()];
        let weights = by_size(&[5, 40, 12]);
        let of = |embeddings: &[f64], gradient: &mut [f64]| loss(embeddings, 2, &weights, 0.3, gradient);
        of(&embeddings, &mut gradient);
        for i in 0..embeddings.len() {
            let value = embeddings[i];
            let [above, below] = [STEP, -STEP].map(|step| {
                embeddings[i] = value + step;
                of(&embeddings, &mut [0.0; 24])
            });
            embeddings[i] = value;
            let slope = (above - below) / (2.0 * STEP);
            assert!(
                (gradient[i] - slope).abs() < 1e-7,
                "{i}: {}, not {slope}",
                gradient[i]
            );
        }
    }
}
