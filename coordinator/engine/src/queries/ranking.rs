//! Orders of behaviours to ask about.

use super::{
    doubt,
    query::{Query, Reason},
};
use murmuration_proto::Stream;
use murmuration_search::{medoids::Clustering, novelty::Behaviours};

/// `count` behaviours in an order that the stream decides.
#[must_use]
pub fn by_lot(count: usize, stream: &mut Stream) -> Vec<Query> {
    let mut order: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        order.swap(last, stream.below(last as u64 + 1) as usize);
    }
    let query = |index| Query {
        index,
        reason: Reason::Lot,
    };
    order.into_iter().map(query).collect()
}

/// The medoids of the clustering of `behaviours`, then all other behaviours, the most doubtful first, the clusters taking
/// turns so that no border is asked about ten times in a row.
///
/// Doubtful is who is nearly as far from the own medoid as from the next, as a share of the latter: 1 on the border.
#[must_use]
pub fn by_doubt(behaviours: &Behaviours, clustering: &Clustering) -> Vec<Query> {
    let mut sizes = vec![0; clustering.medoids.len()];
    for &cluster in &clustering.clusters {
        sizes[cluster as usize] += 1;
    }
    let medoids = clustering.medoids.iter().zip(sizes).enumerate();
    let medoids = medoids.map(|(place, (&index, size))| Query {
        index,
        reason: Reason::Medoid {
            cluster: place + 1,
            size,
        },
    });
    let doubtful = doubt::members(behaviours, clustering);
    medoids.chain(in_turns(doubtful)).collect()
}

/// First each list's first, then each list's second, and so on.
fn in_turns(lists: Vec<Vec<Query>>) -> Vec<Query> {
    let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
    let turn = |place| lists.iter().filter_map(move |list| list.get(place).copied());
    (0..longest).flat_map(turn).collect()
}

#[cfg(test)]
mod tests;
