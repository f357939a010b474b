//! In-batch triplets: for each anchor, the positives of all other anchors are negatives. The loss is the mean over violated
//! triplets only, so that the many solved triplets do not outweigh the few violated triplets.

use super::{distance, is_violated, push};
use crate::real::Real;

/// The mean of d(anchor, positive) - d(anchor, negative) + margin over the triplets where this sum is positive; 0 if there is no
/// such triplet.
///
/// `embeddings` has the embeddings of all anchors, then of all positives in the same order, of `dimensions` numbers each.
/// `gradient` becomes the gradient with respect to the embeddings.
pub(crate) fn loss<T: Real>(embeddings: &[T], dimensions: usize, margin: f64, gradient: &mut [T]) -> f64 {
    let half = embeddings.len() / 2;
    let (anchors, positives) = embeddings.split_at(half);
    let count = half / dimensions;
    let part = |i: usize| i * dimensions..(i + 1) * dimensions;
    let mut distances = vec![0.0; count * count];
    for (anchor, row) in anchors
        .chunks_exact(dimensions)
        .zip(distances.chunks_exact_mut(count))
    {
        for (positive, to) in positives.chunks_exact(dimensions).zip(row) {
            *to = distance(anchor, positive);
        }
    }
    let violation = |i: usize, j: usize| distances[i * count + i] - distances[i * count + j] + margin;
    let negatives = |i: usize| (0..count).filter(move |&j| j != i && is_violated(violation(i, j)));
    let mut total = 0.0;
    let mut violated = 0;
    for i in 0..count {
        for j in negatives(i) {
            total += violation(i, j);
            violated += 1;
        }
    }
    let weight = 1.0 / violated.max(1) as f64;
    let mut slopes = vec![0.0; embeddings.len()];
    let (d_anchors, d_positives) = slopes.split_at_mut(half);
    for i in 0..count {
        let (anchor, d_anchor) = (&anchors[part(i)], &mut d_anchors[part(i)]);
        let mut own = 0.0;
        for j in negatives(i) {
            let far = distances[i * count + j];
            let d_positive = &mut d_positives[part(j)];
            push(anchor, &positives[part(j)], far, -weight, d_anchor, d_positive);
            own += weight;
        }
        let near = distances[i * count + i];
        push(
            anchor,
            &positives[part(i)],
            near,
            own,
            d_anchor,
            &mut d_positives[part(i)],
        );
    }
    for (gradient, slope) in gradient.iter_mut().zip(slopes) {
        *gradient = T::of(slope);
    }
    total * weight
}
