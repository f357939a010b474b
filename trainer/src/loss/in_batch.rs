//! In-batch triplets: every other positive of the batch is a negative, and the mean is over violated triplets only,
//! so that the many that are solved do not drown the few that are not.

use super::{EPSILON, distance, push};
use crate::real::Real;

/// What a batch came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BatchLoss {
    /// Mean of d(anchor, positive) - d(anchor, negative) + margin over the triplets where it is over 0; 0 if none.
    pub(crate) mean: f64,
    /// How many those are.
    pub(crate) violated: usize,
}

/// The loss of a batch whose `embeddings` are those of all anchors, then of all positives, `dimensions` numbers
/// each; `gradient` becomes the gradient by them.
pub(crate) fn loss<T: Real>(
    embeddings: &[T],
    dimensions: usize,
    margin: f64,
    gradient: &mut [T],
) -> BatchLoss {
    let half = embeddings.len() / 2;
    let (anchors, positives) = embeddings.split_at(half);
    let count = half / dimensions;
    let part = |i: usize| i * dimensions..(i + 1) * dimensions;
    let mut distances = vec![0.0; count * count];
    for (anchor, row) in anchors.chunks_exact(dimensions).zip(distances.chunks_exact_mut(count)) {
        for (positive, to) in positives.chunks_exact(dimensions).zip(row) {
            *to = distance(anchor, positive);
        }
    }
    let violation = |i: usize, j: usize| distances[i * count + i] - distances[i * count + j] + margin;
    let negatives = |i: usize| (0..count).filter(move |&j| j != i && violation(i, j) > 0.0);
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
        push(anchor, &positives[part(i)], near, own, d_anchor, &mut d_positives[part(i)]);
    }
    for (gradient, slope) in gradient.iter_mut().zip(slopes) {
        *gradient = T::of(slope);
    }
    let mean = total * weight;
    BatchLoss { mean, violated }
}

/// Experimental: contrast over kinds of similarity. kind: 1 exp(-d), 2 exp(-d2/2), 3 cauchy; +10: symmetric with all 2N-2 negatives
pub(crate) fn ntxent<T: Real>(embeddings: &[T], dimensions: usize, kind: f64, gradient: &mut [T]) -> BatchLoss {
    let symmetric = kind > 10.0;
    let kind = kind as u32 % 10;
    let n2 = embeddings.len() / dimensions;
    let count = n2 / 2;
    let part = |i: usize| i * dimensions..(i + 1) * dimensions;
    let mut slopes = vec![0.0; embeddings.len()];
    let mut total = 0.0;
    let anchors = if symmetric { n2 } else { count };
    for i in 0..anchors {
        let own = (i + count) % n2;
        let others: Vec<usize> = if symmetric { (0..n2).filter(|&j| j != i).collect() } else { (count..n2).collect() };
        let d: Vec<f64> = others.iter().map(|&j| distance(&embeddings[part(i)], &embeddings[part(j)])).collect();
        let e: Vec<f64> = d.iter().map(|&x| match kind { 1 => (-x).exp(), 2 => (-x * x / 2.0).exp(), _ => 1.0 / (1.0 + x * x) }).collect();
        let z: f64 = e.iter().sum::<f64>() + 1e-300;
        for (k, &j) in others.iter().enumerate() {
            let own_here = f64::from(u8::from(j == own));
            if j == own { total -= (e[k] / z).max(1e-300).ln(); }
            let w = match kind {
                1 => own_here - e[k] / z,
                2 => (own_here - e[k] / z) * d[k],
                _ => 2.0 * d[k] * (own_here * e[k] - e[k] * e[k] / z),
            } / anchors as f64;
            for (q, (x, y)) in embeddings[part(i)].iter().zip(&embeddings[part(j)]).enumerate() {
                let slope = w * (x.wide() - y.wide() + EPSILON) / d[k];
                slopes[i * dimensions + q] += slope;
                slopes[j * dimensions + q] -= slope;
            }
        }
    }
    for (g, s) in gradient.iter_mut().zip(slopes) { *g = T::of(s); }
    BatchLoss { mean: total / anchors as f64, violated: count * (count - 1) }
}
