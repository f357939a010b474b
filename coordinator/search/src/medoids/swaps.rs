//! FasterPAM: improves medoids by one swap at a time.

use super::{
    Progress,
    assignment::{Assignment, Swap},
    seeding,
};
use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use murmuration_swarm::RandomStream;
use rayon::prelude::*;
use std::ops::Range;

/// Number of candidates that are weighed against the same medoids. Another number changes the outcome.
const BLOCK: usize = 128;

/// Minimum share of the loss that a swap must save, well above rounding errors.
pub(super) const LEAST_GAIN: f64 = 1e-11;

/// Finds medoids such that no single swap lowers the loss by more than a rounding error; calls `told` after every swap.
pub(super) fn fasterpam(
    points: &Behaviours,
    k: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
    told: &dyn Fn(Progress),
) -> Result<Vec<usize>, Interrupted> {
    let seeds = seeding::seed(points, k, stream, interrupt)?;
    let mut moves = 0;
    let swapped = |assignment: &Assignment<'_>| {
        moves += 1;
        told(Progress {
            samples: 0,
            moves,
            mean_distance: assignment.loss() / points.len() as f64,
        });
    };
    let assignment = descend(Assignment::new(points, seeds, interrupt)?, interrupt, swapped)?;
    Ok(assignment.into_medoids())
}

/// Swaps until no candidate of a whole round of blocks lowers the loss.
fn descend<'p>(
    mut assignment: Assignment<'p>,
    interrupt: &Interrupt,
    mut swapped: impl FnMut(&Assignment<'p>),
) -> Result<Assignment<'p>, Interrupted> {
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
                swapped(&assignment);
            }
            None => blocks_in_vain += 1,
        }
        if blocks_in_vain == blocks.len() {
            break;
        }
    }
    Ok(assignment)
}

/// The assignment after the best swap with a candidate of `block`, if the swap lowers the loss.
///
/// The loss depends only on the set of medoids, and every swap lowers the loss. No set of medoids therefore repeats, and the
/// descent ends.
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
