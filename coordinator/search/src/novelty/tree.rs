//! Novelty by a k-d tree, with the bits of brute force.
//!
//! The tree only names candidates. Its own distances and bounds may round otherwise than ours, so it is asked
//! twice: for the distance of the k-th neighbour, and for everything within a hair more than that. The distances
//! of those candidates are then computed and summed as brute force does.
//!
//! An archive may hold many coinciding points, which no cut can separate. kiddo's mutable tree fails where more
//! than a bucket of them meet; the immutable one, used here, lets the leaf grow instead.

use super::{Behaviours, nearest::Nearest};
use crate::interrupt::{Interrupt, Interrupted};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::{num::NonZero, ops::Range};

/// Relative allowance for the tree's rounding: depth times some units in the last place is far less.
const RELATIVE_SLACK: f64 = 1e-9;

/// The same where squares underflow.
const ABSOLUTE_SLACK: f64 = 1e-300;

/// What was measured, unless it was interrupted.
type Measured = Result<Vec<f64>, Interrupted>;

/// Novelty of `queries`, all of them points; `None` where there is no tree for so many dimensions.
pub(super) fn novelty(
    behaviours: &Behaviours,
    queries: Range<usize>,
    k: usize,
    interrupt: &Interrupt,
) -> Option<Measured> {
    match behaviours.dims() {
        1 => in_dims::<1>(behaviours, queries, k, interrupt),
        2 => in_dims::<2>(behaviours, queries, k, interrupt),
        3 => in_dims::<3>(behaviours, queries, k, interrupt),
        4 => in_dims::<4>(behaviours, queries, k, interrupt),
        5 => in_dims::<5>(behaviours, queries, k, interrupt),
        6 => in_dims::<6>(behaviours, queries, k, interrupt),
        7 => in_dims::<7>(behaviours, queries, k, interrupt),
        8 => in_dims::<8>(behaviours, queries, k, interrupt),
        _ => None,
    }
}

fn in_dims<const D: usize>(
    behaviours: &Behaviours,
    queries: Range<usize>,
    k: usize,
    interrupt: &Interrupt,
) -> Option<Measured> {
    let points = behaviours.arrays::<D>();
    // One more than k: the query finds itself.
    let asked = NonZero::new(k.saturating_add(1).min(points.len()))?;
    let tree: ImmutableKdTree<f64, D> = ImmutableKdTree::new_from_slice(points).ok()?;
    let novelty_of = |nearest: &mut Nearest, query: usize| {
        interrupt.check()?;
        let neighbours = tree
            .query(&points[query])
            .nearest_n::<SquaredEuclidean<f64>>(asked)
            .execute();
        let farthest = neighbours.last().map_or(0.0, |neighbour| neighbour.distance);
        tree.query(&points[query])
            .within::<SquaredEuclidean<f64>>(farthest * (1.0 + RELATIVE_SLACK) + ABSOLUTE_SLACK)
            .unsorted()
            .visit(|neighbour| {
                let other = neighbour.item as usize;
                if other != query {
                    nearest.offer(behaviours.squared_distance(query, other));
                }
            });
        Ok(nearest.take_mean())
    };
    Some(
        queries
            .into_par_iter()
            .map_init(|| Nearest::new(k), novelty_of)
            .collect(),
    )
}
