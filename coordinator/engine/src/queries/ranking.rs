//! Orders of behaviours to ask about.

use super::{
    query::{Query, Reason},
    uncertainty,
};
use murmuration_proto::RandomStream;
use murmuration_search::{medoids::Clustering, novelty::Behaviours};

/// `count` behaviours in random order.
#[must_use]
pub fn in_random_order(count: usize, stream: &mut RandomStream) -> Vec<Query> {
    let mut order: Vec<usize> = (0..count).collect();
    stream.shuffle(&mut order);
    let query = |index| Query {
        index,
        reason: Reason::Random,
    };
    order.into_iter().map(query).collect()
}

/// The medoids of the clustering of `behaviours`, then all other behaviours, the most uncertain first, the clusters taking
/// turns so that no border is asked about ten times in a row.
///
/// A behaviour's uncertainty is its distance from the medoid of its cluster, as a share of that from the nearest other
/// medoid: 1 on the border.
#[must_use]
pub fn by_uncertainty(behaviours: &Behaviours, clustering: &Clustering) -> Vec<Query> {
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
    let uncertain = uncertainty::members(behaviours, clustering);
    medoids.chain(in_turns(uncertain)).collect()
}

/// First each list's first, then each list's second, and so on.
fn in_turns(lists: Vec<Vec<Query>>) -> Vec<Query> {
    let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
    let turn = |place| lists.iter().filter_map(move |list| list.get(place).copied());
    (0..longest).flat_map(turn).collect()
}

#[cfg(test)]
mod tests;
