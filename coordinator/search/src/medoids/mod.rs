//! k-medoids by eager swaps: the behaviours that stand for all (paper, "Evolution and Clustering").
//!
//! The algorithm is FasterPAM (Schubert and Rousseeuw, "Fast and eager k-medoids clustering", 2021): a point
//! that is not a medoid is weighed against *all* medoids in one pass over the points, and a swap that lowers
//! the loss is made at once. Two things differ. Distances are computed as they are needed, so memory grows with
//! n and not with n^2. And candidates are weighed in blocks, in parallel: all candidates of a block against the
//! same medoids, then the best swap of the block is made. The block has a fixed size, so the outcome does not
//! depend on the number of threads.
//!
//! The result is a local optimum: no exchange of one medoid lowers the loss by more than a rounding error.
//!
//! Time grows with the square of the number of points. Measured with 12 medoids in five dimensions on two
//! shared cores (`cargo bench --bench medoids`): 0.02 s for 1,000 points, 1 to 2 s for 10,000.

mod assignment;
mod seeding;

use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use assignment::{Assignment, Swap};
use murmuration_proto::Stream;
use rayon::prelude::*;
use std::{cmp::Reverse, ops::Range};

/// Candidates that are weighed against the same medoids. Part of what the outcome rests on.
const BLOCK: usize = 128;

/// The least share of the loss that a swap must save: more than rounding can feign.
const LEAST_GAIN: f64 = 1e-11;

/// Behaviours in clusters, each about a medoid.
#[derive(Debug, Clone, PartialEq)]
pub struct Clustering {
    /// Indices of the medoids, no two the same; that of the largest cluster first, equal ones by index.
    pub medoids: Vec<usize>,
    /// For each behaviour the place in `medoids` of the nearest one; of equally near ones, that with the lowest
    /// index. A medoid is in its own cluster, even where others coincide with it.
    pub clusters: Vec<u32>,
    /// Sum of the distances of all behaviours to their medoids.
    pub loss: f64,
}

/// Clusters `points` about `k` of them, so that the sum of Euclidean distances to the nearest medoid is (locally)
/// least; the stream chooses the medoids to begin with.
///
/// There are as many medoids as points where `k` is larger, and one where `k` is 0; none where there are no
/// points.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn cluster(
    points: &Behaviours,
    k: usize,
    stream: &mut Stream,
    interrupt: &Interrupt,
) -> Result<Clustering, Interrupted> {
    let k = k.max(1).min(points.len());
    let seeds = seeding::seed(points, k, stream, interrupt)?;
    let assignment = descend(Assignment::new(points, seeds, interrupt)?, interrupt)?;
    arrange(points, assignment.into_medoids(), interrupt)
}

/// Swaps until a whole round of candidates, from whichever block on, holds none that lowers the loss.
fn descend<'p>(mut assignment: Assignment<'p>, interrupt: &Interrupt) -> Result<Assignment<'p>, Interrupted> {
    let count = assignment.points().len();
    let blocks: Vec<Range<usize>> = (0..count)
        .step_by(BLOCK)
        .map(|start| start..(start + BLOCK).min(count))
        .collect();
    let mut blocks_in_vain = 0;
    for block in blocks.iter().cycle() {
        interrupt.check()?;
        match improve(&assignment, block.clone()) {
            Some(better) => {
                assignment = better;
                blocks_in_vain = 0;
            }
            None => blocks_in_vain += 1,
        }
        if blocks_in_vain == blocks.len() {
            break;
        }
    }
    Ok(assignment)
}

/// The assignment after the best swap with a candidate of `block`, if that lowers the loss.
///
/// The loss of a set of medoids always comes out the same, and goes down with every swap made: no set comes
/// back, so the descent ends.
fn improve<'p>(assignment: &Assignment<'p>, block: Range<usize>) -> Option<Assignment<'p>> {
    let swaps: Vec<Option<Swap>> = block
        .into_par_iter()
        .map(|candidate| assignment.best_swap(candidate))
        .collect();
    let best = swaps
        .into_iter()
        .flatten()
        .min_by(|a, b| a.change.total_cmp(&b.change))?;
    if best.change >= -LEAST_GAIN * assignment.loss() {
        return None;
    }
    let better = assignment.after(&best);
    (better.loss() < assignment.loss()).then_some(better)
}

/// The clusters of `medoids`, the largest first.
fn arrange(
    points: &Behaviours,
    mut medoids: Vec<usize>,
    interrupt: &Interrupt,
) -> Result<Clustering, Interrupted> {
    medoids.sort_unstable();
    let nearest: Vec<(usize, f64)> = (0..points.len())
        .into_par_iter()
        .map(|point| {
            interrupt.check()?;
            Ok(nearest_medoid(points, &medoids, point))
        })
        .collect::<Result<_, Interrupted>>()?;
    let loss = nearest.iter().fold(0.0, |sum, (_, squared)| sum + squared.sqrt());

    let mut sizes = vec![0usize; medoids.len()];
    for &(place, _) in &nearest {
        sizes[place] += 1;
    }
    let mut order: Vec<usize> = (0..medoids.len()).collect();
    order.sort_by_key(|&place| (Reverse(sizes[place]), medoids[place]));
    let mut new_place = vec![0u32; medoids.len()];
    for (new, &old) in (0..).zip(&order) {
        new_place[old] = new;
    }
    Ok(Clustering {
        medoids: order.iter().map(|&place| medoids[place]).collect(),
        clusters: nearest.iter().map(|&(place, _)| new_place[place]).collect(),
        loss,
    })
}

/// Place (among ascending `medoids`) and squared distance of the medoid of `point`.
fn nearest_medoid(points: &Behaviours, medoids: &[usize], point: usize) -> (usize, f64) {
    if let Ok(own) = medoids.binary_search(&point) {
        return (own, 0.0);
    }
    let mut nearest = (0, f64::INFINITY);
    for (place, &medoid) in medoids.iter().enumerate() {
        let squared = points.squared_distance(point, medoid);
        if squared < nearest.1 {
            nearest = (place, squared);
        }
    }
    nearest
}

#[cfg(test)]
mod tests;
