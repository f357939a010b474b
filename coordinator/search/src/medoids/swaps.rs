//! FasterPAM: the descent from medoids to others by one exchange at a time.

use super::{
    Progress,
    assignment::{Assignment, Swap},
    seeding,
};
use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use murmuration_proto::RandomStream;
use rayon::prelude::*;
use std::ops::Range;

/// Candidates that are weighed against the same medoids. Part of what the outcome rests on.
const BLOCK: usize = 128;

/// The least share of the loss that a swap must save: more than rounding can feign.
pub(super) const LEAST_GAIN: f64 = 1e-11;

/// Medoids of which no exchange of one lowers the loss by more than a rounding error; `told` hears of every swap.
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

/// Swaps until a whole round of candidates, from whichever block on, holds none that lowers the loss.
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
