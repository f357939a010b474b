//! The taxonomy of a completed campaign, read from the store; its former versions, and what became of their clusters and names.

mod alike;
mod change;
mod names;
mod spread;

pub use alike::{Alike, distance, touch};
pub use change::Change;
pub use names::{ClusterName, Names, NotCarried, Origin, Uncarried};
pub use spread::{Place, spreads};

use crate::{blocking::parallel, space::SpaceError};
use murmuration_model::{CampaignId, CampaignRecord};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids::{self, Clustering},
    novelty::{self, Behaviours},
};
use murmuration_store::{ArchivedIndividual, ClusterMeasures, Store, StoreError, StoredTaxonomy, Trial};
use murmuration_swarm::{CampaignSpec, Choice, Scale};
use std::collections::BTreeMap;

/// Clusters the archive of a campaign by the campaign's specification. `told` gets the progress.
pub(crate) fn cluster(
    store: &Store,
    record: &CampaignRecord,
    behaviours: &Behaviours,
    interrupt: &Interrupt,
    told: &(dyn Fn(medoids::Progress) + Sync),
) -> Result<Clustering, SpaceError> {
    let spec = &record.spec;
    let labelled = match spec.choice() {
        Choice::Medoids => BTreeMap::new(),
        Choice::Coverage | Choice::ByClass => store.learned_classes(record)?,
    };
    Ok(parallel(|| {
        medoids::choose(spec, behaviours, &labelled, interrupt, told)
    })?)
}

/// One behaviour: the individual that represents a cluster.
#[derive(Debug, Clone, PartialEq)]
pub struct Medoid {
    /// The individual, with its picture.
    pub individual: ArchivedIndividual,
    /// Number of individuals in the medoid's cluster, including the medoid.
    pub cluster_size: u64,
    /// Mean distance of the cluster, in units of the behaviour space.
    pub mean_distance: f64,
    /// Mean distance of the medoid to its nearest neighbours in the whole archive, in units of the behaviour space.
    pub novelty: f64,
}

/// The behaviours that a campaign found, largest cluster first.
#[derive(Debug, Clone, PartialEq)]
pub struct Taxonomy {
    /// One medoid per cluster.
    pub medoids: Vec<Medoid>,
    /// For each individual by index, the place of its medoid.
    pub clusters: Vec<u32>,
    /// Sum over the archive of the distance to the nearest medoid.
    pub loss: f64,
    /// The number of robust trials of each individual by index, see [`robust_trials`]; empty if individuals have one trial.
    pub robust_trials: Vec<u8>,
}

impl Taxonomy {
    /// Reads the taxonomy of a campaign; `None` if the campaign is not completed.
    ///
    /// # Errors
    /// If the store cannot be read, or lacks an individual of the taxonomy.
    pub fn read(
        store: &Store,
        campaign: &CampaignId,
        spec: &CampaignSpec,
    ) -> Result<Option<Self>, StoreError> {
        let stored = store.taxonomy(campaign)?;
        stored
            .map(|stored| Self::of(stored, store, campaign, spec))
            .transpose()
    }

    /// Reads any version of the taxonomy of a campaign; `None` if there is no version of this number.
    pub fn read_version(
        store: &Store,
        campaign: &CampaignId,
        version: u32,
        spec: &CampaignSpec,
    ) -> Result<Option<Self>, StoreError> {
        let stored = store.taxonomy_of_version(campaign, version)?;
        stored
            .map(|stored| Self::of(stored, store, campaign, spec))
            .transpose()
    }

    fn of(
        stored: StoredTaxonomy,
        store: &Store,
        campaign: &CampaignId,
        spec: &CampaignSpec,
    ) -> Result<Self, StoreError> {
        let mut sizes = vec![0; stored.medoids.len()];
        for &cluster in &stored.clusters {
            if let Some(size) = sizes.get_mut(cluster as usize) {
                *size += 1;
            }
        }
        let mut medoids = Vec::with_capacity(stored.medoids.len());
        for ((&index, measures), cluster_size) in stored.medoids.iter().zip(stored.measures).zip(sizes) {
            medoids.push(Medoid {
                individual: store.individual(campaign, spec.model(), index)?,
                cluster_size,
                mean_distance: measures.mean_distance,
                novelty: measures.novelty,
            });
        }
        Ok(Self {
            medoids,
            clusters: stored.clusters,
            loss: stored.loss,
            robust_trials: stored.robust_trials,
        })
    }
}

/// The number of an individual's robust trials: trials that are at least as near to the individual's own medoid as to every other
/// medoid. `behaviours` are the behaviours of the archive. `medoids` are the indices of the medoids, and `own` is the place of
/// the individual's own medoid.
pub fn robust_trials(
    individual: &ArchivedIndividual,
    scale: &Scale,
    behaviours: &Behaviours,
    medoids: &[usize],
    own: u32,
) -> u8 {
    let is_own = |trial: &&Trial| {
        let behaviour = scale.behaviour(&trial.features, &trial.embedding);
        let distance = |medoid: usize| behaviours.squared_distance_to(medoid, &behaviour);
        let to_own = medoids
            .get(own as usize)
            .map_or(f64::INFINITY, |&own| distance(own));
        medoids.iter().all(|&medoid| to_own <= distance(medoid))
    };
    individual.trials.iter().filter(is_own).count() as u8
}

/// Measures the clusters of an archive. `neighbours` is the number of nearest neighbours that novelty uses.
pub fn measure(
    behaviours: &Behaviours,
    clustering: &Clustering,
    neighbours: usize,
    interrupt: &Interrupt,
) -> Result<Vec<ClusterMeasures>, Interrupted> {
    let mut sums = vec![(0.0, 0_u64); clustering.medoids.len()];
    for (member, &cluster) in clustering.clusters.iter().enumerate() {
        let medoid = clustering.medoids[cluster as usize];
        let (distances, members) = &mut sums[cluster as usize];
        *distances += behaviours.squared_distance(member, medoid).sqrt();
        *members += 1;
    }
    let novelty = novelty::novelty_of(behaviours, &clustering.medoids, neighbours, interrupt)?;
    let measured = |((distances, members), novelty): ((f64, u64), f64)| ClusterMeasures {
        mean_distance: distances / members.max(1) as f64,
        novelty,
    };
    Ok(sums.into_iter().zip(novelty).map(measured).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cluster_is_measured_to_its_medoid_and_its_medoid_to_the_whole_archive() {
        let mut behaviours = Behaviours::new(1);
        for place in [0.0, 1.0, 3.0, 10.0] {
            behaviours.push(&[place]).unwrap();
        }
        let clustering = Clustering {
            medoids: vec![1, 3],
            clusters: vec![0, 0, 0, 1],
            loss: 3.0,
        };
        let measured = measure(&behaviours, &clustering, 2, &Interrupt::default()).unwrap();
        let figures = [(1.0, 1.5), (0.0, 8.0)].map(|(mean_distance, novelty)| ClusterMeasures {
            mean_distance,
            novelty,
        });
        assert_eq!(measured, figures);
    }
}
