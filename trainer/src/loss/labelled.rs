//! Labelled in-batch triplets: of any anchor, every other picture of its class is a positive and every picture of
//! another class a negative. The mean is over violated triplets only.

use super::{distance, is_violated, push};
use crate::real::Real;

/// The mean of d(anchor, positive) - d(anchor, negative) + margin over the triplets where it is over 0 (0 if none is).
///
/// `embeddings` are those of one class after the other, `per_class` of each, `dimensions` numbers each; `gradient`
/// becomes the gradient by them.
pub(crate) fn loss<T: Real>(
    embeddings: &[T],
    dimensions: usize,
    per_class: usize,
    margin: f64,
    gradient: &mut [T],
) -> f64 {
    let pictures: Vec<&[T]> = embeddings.chunks_exact(dimensions).collect();
    let count = pictures.len();
    let mut total = 0.0;
    let mut violated = 0_u64;
    // By how many triplets each distance, from anchor to other, should shrink; less than none if it should grow.
    let mut pulls = vec![0_i64; count * count];
    let mut distances = vec![0.0; count * count];
    for (anchor, pulls) in pulls.chunks_exact_mut(count).enumerate() {
        let row = &mut distances[anchor * count..][..count];
        for (to, other) in row.iter_mut().zip(&pictures) {
            *to = distance(pictures[anchor], other);
        }
        let first = anchor / per_class * per_class;
        let own = first..first + per_class;
        for positive in own.clone().filter(|&positive| positive != anchor) {
            for negative in (0..first).chain(own.end..count) {
                let violation = row[positive] - row[negative] + margin;
                if is_violated(violation) {
                    total += violation;
                    violated += 1;
                    pulls[positive] += 1;
                    pulls[negative] -= 1;
                }
            }
        }
    }
    let weight = 1.0 / violated.max(1) as f64;
    let mut slopes = vec![0.0; embeddings.len()];
    for (place, pull) in pulls.into_iter().enumerate().filter(|(_, pull)| *pull != 0) {
        let (anchor, other) = (place / count, place % count);
        let by_anchor = anchor * dimensions..(anchor + 1) * dimensions;
        let by_other = other * dimensions..(other + 1) * dimensions;
        let weight = pull as f64 * weight;
        if let Ok([d_anchor, d_other]) = slopes.get_disjoint_mut([by_anchor, by_other]) {
            let far = distances[place];
            push(pictures[anchor], pictures[other], far, weight, d_anchor, d_other);
        }
    }
    for (gradient, slope) in gradient.iter_mut().zip(slopes) {
        *gradient = T::of(slope);
    }
    total * weight
}
