//! Rankings of behaviours to ask about, each with the reason for its place.

use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids::{self, Clustering},
    novelty::Behaviours,
};
use murmuration_swarm::{CampaignSpec, Purpose, RandomStream, counted};
use rayon::prelude::*;
use std::fmt;

/// Number of behaviours that are put in order of coverage. People answer fewer questions.
const MOST_COVERED: usize = 1000;

/// Why a behaviour is asked about, for display to the annotator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    Random,
    /// The behaviour is the medoid of a cluster.
    Medoid {
        cluster: usize,
        /// Number of behaviours in the cluster.
        size: usize,
    },
    /// The behaviour is nearly as far from the medoid of its own cluster as from the medoid of another cluster.
    Uncertain {
        /// The number of the behaviour's cluster, from 1.
        cluster: usize,
        /// The number of the other cluster, from 1; `None` if there is only one cluster.
        other: Option<usize>,
    },
    /// The behaviour is far from the medoids and from all behaviours before it in the ranking.
    Uncovered,
    /// The window requested it, for instance because its answer was undone.
    Again,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Query {
    pub index: usize,
    pub reason: Reason,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random => f.write_str("drawn at random"),
            Self::Uncovered => f.write_str("unlike all before it"),
            Self::Medoid { cluster, size: 1 } => write!(f, "the only behaviour of cluster {cluster}"),
            Self::Medoid { cluster, size } => {
                write!(
                    f,
                    "medoid of cluster {cluster}: the nearest to {}",
                    counted(*size as u64, "behaviour")
                )
            }
            Self::Uncertain {
                cluster,
                other: Some(other),
            } => write!(f, "between cluster {cluster} and cluster {other}"),
            Self::Uncertain { cluster, other: None } => write!(f, "in cluster {cluster}"),
            Self::Again => f.write_str("to be answered again"),
        }
    }
}

/// `count` behaviours in random order.
pub fn in_random_order(count: usize, stream: &mut RandomStream) -> Vec<Query> {
    let mut order: Vec<usize> = (0..count).collect();
    stream.shuffle(&mut order);
    let query = |index| Query {
        index,
        reason: Reason::Random,
    };
    order.into_iter().map(query).collect()
}

/// The medoids of the clustering of `behaviours`, then all other behaviours, the most uncertain first. The clusters take turns,
/// so that annotators do not see the same border ten times in a row.
///
/// A behaviour's uncertainty is its distance from the medoid of its cluster, divided by its distance from the nearest other
/// medoid. The uncertainty is 1 on the border of two clusters.
pub fn by_uncertainty(behaviours: &Behaviours, clustering: &Clustering) -> Vec<Query> {
    let uncertain = uncertain_members(behaviours, clustering);
    medoids_first(clustering).chain(in_turns(uncertain)).collect()
}

/// The medoids of the clustering of `behaviours`, then up to [`MOST_COVERED`] other behaviours, each the farthest from all before
/// it, then the remaining behaviours.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub(crate) fn by_coverage(
    behaviours: &Behaviours,
    clustering: &Clustering,
    spec: &CampaignSpec,
    interrupt: &Interrupt,
) -> Result<Vec<Query>, Interrupted> {
    let mut stream = RandomStream::derive(spec.seed(), Purpose::Query, 0);
    let others = medoids::order(
        behaviours,
        clustering.medoids.clone(),
        MOST_COVERED,
        spec.search().neighbours() as usize,
        &mut stream,
        interrupt,
    )?;
    let others = others.into_iter().map(|index| Query {
        index,
        reason: Reason::Uncovered,
    });
    Ok(medoids_first(clustering).chain(others).collect())
}

/// Indices of behaviours other than the medoids, each the farthest from all before it: the order of
/// [`Strategy::Coverage`](super::Strategy).
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn beyond_medoids(
    behaviours: &Behaviours,
    clustering: &Clustering,
    spec: &CampaignSpec,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let order = by_coverage(behaviours, clustering, spec, interrupt)?;
    Ok(uncovered(&order).collect())
}

/// The behaviours in an order by coverage that are not medoids.
pub(super) fn uncovered(order: &[Query]) -> impl Iterator<Item = usize> {
    let uncovered = order.iter().filter(|query| query.reason == Reason::Uncovered);
    uncovered.map(|query| query.index)
}

fn medoids_first(clustering: &Clustering) -> impl Iterator<Item = Query> {
    let mut sizes = vec![0; clustering.medoids.len()];
    for &cluster in &clustering.clusters {
        sizes[cluster as usize] += 1;
    }
    let medoids = clustering.medoids.iter().zip(sizes).enumerate();
    medoids.map(|(place, (&index, size))| Query {
        index,
        reason: Reason::Medoid {
            cluster: place + 1,
            size,
        },
    })
}

/// The first of each list, then the second of each list, and so on.
fn in_turns(lists: Vec<Vec<Query>>) -> Vec<Query> {
    let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
    let turn = |place| lists.iter().filter_map(move |list| list.get(place).copied());
    (0..longest).flat_map(turn).collect()
}

/// For each cluster, its members without the medoid, the most uncertain first; ties by index. If there is only one cluster, no
/// member is uncertain, and members are in order of index.
fn uncertain_members(behaviours: &Behaviours, clustering: &Clustering) -> Vec<Vec<Query>> {
    let uncertainties: Vec<(f64, Option<usize>)> = (0..behaviours.len())
        .into_par_iter()
        .map(|index| uncertainty(behaviours, clustering, index))
        .collect();
    let mut members = vec![Vec::new(); clustering.medoids.len()];
    for (index, &cluster) in clustering.clusters.iter().enumerate() {
        let cluster = cluster as usize;
        if clustering.medoids[cluster] != index {
            members[cluster].push(index);
        }
    }
    let sorted = |(place, mut indices): (usize, Vec<usize>)| {
        indices.sort_by(|&a, &b| uncertainties[b].0.total_cmp(&uncertainties[a].0));
        let query = |index: usize| Query {
            index,
            reason: Reason::Uncertain {
                cluster: place + 1,
                other: uncertainties[index].1.map(|other| other + 1),
            },
        };
        indices.into_iter().map(query).collect()
    };
    members.into_iter().enumerate().map(sorted).collect()
}

/// The uncertainty of a behaviour (see [`by_uncertainty`]), 0 to 1, and the other cluster that the behaviour might belong to.
fn uncertainty(behaviours: &Behaviours, clustering: &Clustering, index: usize) -> (f64, Option<usize>) {
    let own = clustering.clusters[index] as usize;
    let others = clustering.medoids.iter().enumerate();
    let nearest = others
        .filter(|(place, _)| *place != own)
        .map(|(place, &medoid)| (behaviours.squared_distance(index, medoid), place))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        None => (0.0, None),
        // The medoids coincide: maximum uncertainty.
        Some((0.0, other)) => (1.0, Some(other)),
        Some((squared, other)) => {
            let own = behaviours.squared_distance(index, clustering.medoids[own]);
            ((own / squared).sqrt(), Some(other))
        }
    }
}

#[cfg(test)]
mod tests;
