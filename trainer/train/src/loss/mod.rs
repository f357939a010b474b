//! The losses and their gradients.

pub(crate) mod in_batch;
pub(crate) mod labelled;
pub(crate) mod triplets;

use crate::real::Real;

/// Number that is added to every difference, so that the distance of two equal embeddings still has a gradient. PyTorch's
/// `pairwise_distance` adds the same number.
const EPSILON: f64 = 1e-6;

/// The Euclidean distance of two embeddings.
fn distance<T: Real>(a: &[T], b: &[T]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| {
        let difference = a.wide() - b.wide() + EPSILON;
        difference * difference
    });
    squares.sum::<f64>().sqrt()
}

/// Whether a triplet counts as violated. A triplet with NaN distances counts, because a broken network would otherwise look
/// perfect.
const fn is_violated(violation: f64) -> bool {
    violation > 0.0 || violation.is_nan()
}

/// Adds the gradient of `weight` times the distance of `a` and `b` to `d_a` and `d_b`. `distance` is the distance of `a` and `b`.
fn push<T: Real>(a: &[T], b: &[T], distance: f64, weight: f64, d_a: &mut [f64], d_b: &mut [f64]) {
    let values = a.iter().zip(b).zip(d_a.iter_mut().zip(d_b));
    for ((a, b), (d_a, d_b)) in values {
        let slope = weight * (a.wide() - b.wide() + EPSILON) / distance;
        *d_a += slope;
        *d_b -= slope;
    }
}
