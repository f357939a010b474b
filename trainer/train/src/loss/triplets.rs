//! The paper's loss: the mean over a batch of max(0, d(anchor, positive) - d(anchor, negative) + margin).

use super::{distance, is_violated, push};
use crate::real::Real;

/// The sum of the losses of a chunk of triplets.
///
/// `embeddings` has the embeddings of all anchors, then of all positives, then of all negatives, of `dimensions` numbers each.
/// `gradient` becomes the gradient, with respect to the embeddings, of the sum divided by `batch`.
pub(crate) fn loss<T: Real>(
    embeddings: &[T],
    dimensions: usize,
    margin: f64,
    batch: usize,
    gradient: &mut [T],
) -> f64 {
    let third = embeddings.len() / 3;
    let [anchors, positives, negatives] = [0, 1, 2].map(|part| &embeddings[part * third..][..third]);
    let mut slopes = vec![0.0; embeddings.len()];
    let (d_anchors, rest) = slopes.split_at_mut(third);
    let (d_positives, d_negatives) = rest.split_at_mut(third);
    let weight = 1.0 / batch as f64;
    let mut total = 0.0;
    for at in (0..third).step_by(dimensions) {
        let at = at..at + dimensions;
        let [a, p, n] = [anchors, positives, negatives].map(|part| &part[at.clone()]);
        let (near, far) = (distance(a, p), distance(a, n));
        let violation = near - far + margin;
        if is_violated(violation) {
            total += violation;
            let d_anchor = &mut d_anchors[at.clone()];
            push(a, p, near, weight, d_anchor, &mut d_positives[at.clone()]);
            push(a, n, far, -weight, d_anchor, &mut d_negatives[at]);
        }
    }
    for (gradient, slope) in gradient.iter_mut().zip(slopes) {
        *gradient = T::of(slope);
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{Purpose, RandomStream};
    use rand::RngExt as _;

    #[test]
    fn only_violated_triplets_count() {
        // Two anchors at 0, their positives at 1 and 1, their negatives at 9 and 1.5.
        let embeddings = [0.0, 0.0, 1.0, 1.0, 9.0, 1.5];
        let mut gradient = [7.0; 6];
        let sum = loss(&embeddings, 1, 1.0, 2, &mut gradient);
        assert!((sum - 0.5).abs() < 1e-5, "{sum}");
        assert_eq!([gradient[0], gradient[2], gradient[4]], [0.0; 3]);
        assert_eq!(loss(&embeddings, 1, 0.1, 2, &mut gradient), 0.0);
        assert_eq!(gradient, [0.0; 6]);
    }

    #[test]
    fn the_gradient_is_that_of_the_mean() {
        const STEP: f64 = 1e-6;
        let mut stream = RandomStream::derive(1, Purpose::Train, 0);
        let mut embeddings: Vec<f64> = (0..3 * 5 * 2).map(|_| stream.random_range(-1.0..1.0)).collect();
        let mut gradient = vec![0.0; embeddings.len()];
        let of = |embeddings: &[f64], gradient: &mut [f64]| loss(embeddings, 2, 0.3, 5, gradient) / 5.0;
        of(&embeddings, &mut gradient);
        for i in 0..embeddings.len() {
            let value = embeddings[i];
            let [above, below] = [STEP, -STEP].map(|step| {
                embeddings[i] = value + step;
                of(&embeddings, &mut [0.0; 30])
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
