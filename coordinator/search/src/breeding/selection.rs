//! Who becomes a parent: tournament selection.

use super::Parent;
use murmuration_proto::{RandomStream, Search};

/// The winner of one tournament among `parents` (at least one).
///
/// Candidates are drawn uniformly with replacement and ranked by novelty, the highest first, equal ones by
/// their place among the parents. The first wins with probability p, else the second with p, and so on; the
/// last takes what is left.
pub(super) fn tournament<'p>(
    parents: &'p [Parent],
    search: &Search,
    stream: &mut RandomStream,
) -> &'p Parent {
    let mut candidates: Vec<usize> = (0..search.tournament())
        .map(|_| stream.below(parents.len() as u64) as usize)
        .collect();
    candidates.sort_unstable_by(|&a, &b| {
        let by_novelty = parents[b].novelty.total_cmp(&parents[a].novelty);
        by_novelty.then(a.cmp(&b))
    });
    let last = candidates.len() - 1;
    let rank = (0..last)
        .find(|_| stream.chance(search.tournament_pressure()))
        .unwrap_or(last);
    &parents[candidates[rank]]
}
