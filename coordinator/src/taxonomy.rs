//! The taxonomy of a completed campaign, put together from what the store holds.

use crate::{
    campaign::CampaignId,
    store::{ArchivedIndividual, Store, StoreError},
};
use murmuration_proto::CampaignSpec;

/// One behaviour: the individual at the centre of a cluster.
#[derive(Debug, Clone, PartialEq)]
pub struct Medoid {
    /// The individual, with its image.
    pub individual: ArchivedIndividual,
    /// Individuals in its cluster, itself included.
    pub cluster_size: u64,
    /// Mean distance of the cluster's members to it, in units of the behaviour space.
    pub mean_distance: f64,
}

/// The behaviours found, largest cluster first.
#[derive(Debug, Clone, PartialEq)]
pub struct Taxonomy {
    /// One a cluster.
    pub medoids: Vec<Medoid>,
    /// For each individual by index, the place of its medoid.
    pub clusters: Vec<u32>,
    /// Sum over the archive of the distance to the nearest medoid.
    pub loss: f64,
}

impl Taxonomy {
    /// Reads the taxonomy of a campaign; `None` if it is not completed.
    ///
    /// # Errors
    /// If the store cannot be read, or names individuals that it does not hold.
    pub fn read(
        store: &Store,
        campaign: &CampaignId,
        spec: &CampaignSpec,
    ) -> Result<Option<Self>, StoreError> {
        let Some(stored) = store.taxonomy(campaign)? else {
            return Ok(None);
        };
        let model = spec.model();
        let behaviour = |individual: &ArchivedIndividual| {
            spec.method()
                .behaviour(&individual.features, &individual.embedding)
        };
        let archive = store.individuals(campaign, model, 0..stored.clusters.len() as u64, false)?;
        let mut medoids = Vec::with_capacity(stored.medoids.len());
        for (place, &index) in (0u32..).zip(&stored.medoids) {
            let individual = store.individual(campaign, model, index)?;
            let centre = behaviour(&individual);
            let distances: Vec<f64> = archive
                .iter()
                .zip(&stored.clusters)
                .filter(|&(_, &cluster)| cluster == place)
                .map(|(member, _)| distance(&behaviour(member), &centre))
                .collect();
            medoids.push(Medoid {
                cluster_size: distances.len() as u64,
                mean_distance: distances.iter().sum::<f64>() / distances.len().max(1) as f64,
                individual,
            });
        }
        Ok(Some(Self {
            medoids,
            clusters: stored.clusters,
            loss: stored.loss,
        }))
    }
}

fn distance(one: &[f64], other: &[f64]) -> f64 {
    one.iter()
        .zip(other)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}
