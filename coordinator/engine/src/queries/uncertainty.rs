//! Members of clusters that nearly belong to another.

use super::query::{Query, Reason};
use murmuration_search::{medoids::Clustering, novelty::Behaviours};
use rayon::prelude::*;

/// For each cluster its members but the medoid, the most uncertain first; equal ones by index. Those of a single
/// cluster are certain, and come by index.
pub(super) fn members(behaviours: &Behaviours, clustering: &Clustering) -> Vec<Vec<Query>> {
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

/// How uncertain a behaviour's cluster is, 0 to 1, and the cluster that it might belong to: its distance from its own medoid
/// over that from the nearest other one.
fn uncertainty(behaviours: &Behaviours, clustering: &Clustering, index: usize) -> (f64, Option<usize>) {
    let own = clustering.clusters[index] as usize;
    let others = clustering.medoids.iter().enumerate();
    let nearest = others
        .filter(|(place, _)| *place != own)
        .map(|(place, &medoid)| (behaviours.squared_distance(index, medoid), place))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        None => (0.0, None),
        // The medoids coincide: as uncertain as can be.
        Some((0.0, other)) => (1.0, Some(other)),
        Some((squared, other)) => {
            let own = behaviours.squared_distance(index, clustering.medoids[own]);
            ((own / squared).sqrt(), Some(other))
        }
    }
}
