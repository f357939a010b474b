//! The paper's loss: max(0, d(anchor, positive) - d(anchor, negative) + margin), the mean over a batch.

use super::{distance, is_violated, push};
use crate::real::Real;

/// The sum of the losses of a chunk of triplets.
///
/// `embeddings` has those of all anchors, then of all positives, then of all negatives, `dimensions` numbers each. `gradient`
/// becomes the gradient by them of the sum divided by `batch`.
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
