//! Novelty: the mean distance of a behaviour from its nearest neighbours (paper, Eq. 1).
//!
//! The paper's sum runs over i = 0..k, the point itself (at distance 0) included, and is divided by k: the result is the mean
//! distance to the k nearest *other* points.
//!
//! Novelty has the same bits for every way of finding the neighbours and every number of threads. Every distance comes from one
//! function ([`Behaviours::squared_distance`]). Only the k smallest distances matter, not the points they belong to, and these
//! distances are summed in ascending order.

mod behaviours;
mod blocks;
mod choice;
mod index;
mod nearest;
mod order;
mod smallest;
mod tree;
mod walk;

pub use behaviours::{Behaviours, MAX_COORDINATE, Misfit};
pub use index::{Index, Neighbour};

use crate::interrupt::{Interrupt, Interrupted};
use rayon::prelude::*;
use smallest::Smallest;
use walk::Collect as _;

/// Computes the novelty of `points`, in their order, as [`Index::novelty`] does, but by brute force. This suits a few points of
/// an archive without an index.
///
/// # Errors
/// Fails as [`Index::novelty`] does.
///
/// # Panics
/// Panics if a point is not below [`Behaviours::len`].
pub fn novelty_of(
    behaviours: &Behaviours,
    points: &[usize],
    k: usize,
    interrupt: &Interrupt,
) -> Result<Vec<f64>, Interrupted> {
    let novelty = |nearest: &mut Smallest, &query: &usize| {
        interrupt.check()?;
        behaviours.each_squared_distance(query, |other, squared| {
            if other != query {
                nearest.offer(squared, other as u32);
            }
        });
        Ok(nearest.take_mean(0))
    };
    points
        .par_iter()
        .map_init(|| Smallest::new(k.min(behaviours.len())), novelty)
        .collect()
}

#[cfg(test)]
mod tests;
