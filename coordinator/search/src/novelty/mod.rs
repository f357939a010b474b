//! Novelty: how far a behaviour is from those nearest to it (paper, Eq. 1).
//!
//! The paper's sum runs over i = 0..k, the point itself (at distance 0) included, and is divided by k: it is
//! the mean distance to the k nearest *others*.
//!
//! The numbers are the same to the bit whichever way the neighbours are looked up and however many threads
//! do it: every distance comes from one function ([`Behaviours::squared_distance`]), only the values of the k
//! smallest matter, not which of several points at equal distance they belong to, and they are summed in
//! ascending order.

mod behaviours;
mod nearest;
mod tree;

pub use behaviours::{Behaviours, MAX_COORDINATE, Misfit};

use crate::interrupt::{Interrupt, Interrupted};
use nearest::Nearest;
use rayon::prelude::*;
use std::ops::Range;

/// How neighbours are found; the result is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lookup {
    /// Every query is compared with every point: q n distances.
    BruteForce,
    /// A k-d tree is built over all points, then asked. Falls back on brute force above
    /// [`Lookup::MOST_TREE_DIMS`] dimensions, where trees prune nothing.
    Tree,
}

impl Lookup {
    /// Most dimensions that a tree is built in.
    pub const MOST_TREE_DIMS: usize = 8;

    /// The faster way for `queries` among `points`, each asking for `k` neighbours.
    ///
    /// A tree costs about what 200 queries by brute force do, whatever the number of points, so the 100 new
    /// behaviours of a generation are better off without. It loses again where much of the archive is asked for.
    ///
    /// Measured in five dimensions on two shared cores (`cargo bench --bench novelty`), in milliseconds:
    ///
    /// | queries | points | k | brute force | tree, built anew |
    /// |--:|--:|--:|--:|--:|
    /// | 100 | 1,000 | 15 | 0.14 | 0.24 |
    /// | 100 | 10,000 | 15 | 1.0 | 1.7 |
    /// | 100 | 100,000 | 15 | 9.1 | 8.1 |
    /// | 200 | 10,000 | 15 | 2.0 | 2.0 |
    /// | 400 | 10,000 | 15 | 4.1 | 2.7 |
    /// | 500 | 500 | 15 | 1.3 | 1.2 |
    /// | 1,000 | 1,000 | 15 | 3.8 | 2.6 |
    /// | 10,000 | 10,000 | 15 | 115 | 25 |
    /// | 2,000 | 10,000 | 50 | 25 | 13 |
    /// | 2,000 | 10,000 | 200 | 38 | 40 |
    /// | 2,000 | 10,000 | 1,000 | 76 | 149 |
    #[must_use]
    pub const fn for_size(points: usize, queries: usize, k: usize) -> Self {
        if points >= 1_000 && queries >= 250 && k.saturating_mul(50) <= points {
            Self::Tree
        } else {
            Self::BruteForce
        }
    }
}

/// Novelty of the points `queries`: for each, its mean Euclidean distance to the `k` nearest other points of
/// `behaviours` (paper, Eq. 1), in the order of the range.
///
/// A point does not count itself, but counts others that coincide with it. Where there are fewer than `k`
/// others the mean is over those there are; it is 0 if there is none, or if `k` is 0. The part of `queries`
/// beyond the last point is passed over.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn novelty(
    behaviours: &Behaviours,
    queries: Range<usize>,
    k: usize,
    interrupt: &Interrupt,
) -> Result<Vec<f64>, Interrupted> {
    let lookup = Lookup::for_size(behaviours.len(), queries.len(), k);
    novelty_by(lookup, behaviours, queries, k, interrupt)
}

/// As [`novelty`], of these points in their order.
///
/// # Errors
/// As [`novelty`].
///
/// # Panics
/// If a point is not below [`Behaviours::len`].
pub fn novelty_of(
    behaviours: &Behaviours,
    points: &[usize],
    k: usize,
    interrupt: &Interrupt,
) -> Result<Vec<f64>, Interrupted> {
    brute_force(behaviours, points.par_iter().copied(), k, interrupt)
}

/// As [`novelty`], the way of finding neighbours given: for measurements.
///
/// # Errors
/// As [`novelty`].
pub fn novelty_by(
    lookup: Lookup,
    behaviours: &Behaviours,
    queries: Range<usize>,
    k: usize,
    interrupt: &Interrupt,
) -> Result<Vec<f64>, Interrupted> {
    let queries = queries.start.min(behaviours.len())..queries.end.min(behaviours.len());
    match lookup {
        Lookup::BruteForce => brute_force(behaviours, queries.into_par_iter(), k, interrupt),
        Lookup::Tree => tree::novelty(behaviours, queries.clone(), k, interrupt)
            .unwrap_or_else(|| brute_force(behaviours, queries.into_par_iter(), k, interrupt)),
    }
}

fn brute_force(
    behaviours: &Behaviours,
    queries: impl IndexedParallelIterator<Item = usize>,
    k: usize,
    interrupt: &Interrupt,
) -> Result<Vec<f64>, Interrupted> {
    queries
        .map_init(
            || Nearest::new(k),
            |nearest, query| {
                interrupt.check()?;
                behaviours.each_squared_distance(query, |other, squared| {
                    if other != query {
                        nearest.offer(squared);
                    }
                });
                Ok(nearest.take_mean())
            },
        )
        .collect()
}

#[cfg(test)]
mod tests;
