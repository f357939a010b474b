//! The taxonomy of a completed campaign, put together from what the store holds.

use murmuration_model::CampaignId;
use murmuration_proto::CampaignSpec;
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids::Clustering,
    novelty::{self, Behaviours},
};
use murmuration_store::{ArchivedIndividual, ClusterMeasures, Store, StoreError, StoredTaxonomy};

/// One behaviour: the individual at the centre of a cluster.
#[derive(Debug, Clone, PartialEq)]
pub struct Medoid {
    /// The individual, with its image.
    pub individual: ArchivedIndividual,
    /// Individuals in its cluster, itself included.
    pub cluster_size: u64,
    /// Mean distance of the cluster's members to it, in units of the behaviour space.
    pub mean_distance: f64,
    /// Mean distance to its nearest neighbours in the whole archive, in units of the behaviour space.
    pub novelty: f64,
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
        let measures = if stored.measures.len() == stored.medoids.len() {
            stored.measures.clone()
        } else {
            measure_again(store, campaign, spec, &stored)?
        };
        let mut sizes = vec![0; stored.medoids.len()];
        for &cluster in &stored.clusters {
            if let Some(size) = sizes.get_mut(cluster as usize) {
                *size += 1;
            }
        }
        let mut medoids = Vec::with_capacity(stored.medoids.len());
        for ((&index, measures), cluster_size) in stored.medoids.iter().zip(measures).zip(sizes) {
            medoids.push(Medoid {
                individual: store.individual(campaign, spec.model(), index)?,
                cluster_size,
                mean_distance: measures.mean_distance,
                novelty: measures.novelty,
            });
        }
        Ok(Some(Self {
            medoids,
            clusters: stored.clusters,
            loss: stored.loss,
        }))
    }
}

/// Measures the clusters of an archive; `neighbours` is the k of novelty.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
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

/// What an older version has not stored with its taxonomy: it follows from the archive, which is read for it.
fn measure_again(
    store: &Store,
    campaign: &CampaignId,
    spec: &CampaignSpec,
    stored: &StoredTaxonomy,
) -> Result<Vec<ClusterMeasures>, StoreError> {
    let damaged = |reason: String| StoreError::Damaged {
        path: Store::FILE.into(),
        reason: format!("the taxonomy of campaign {campaign}: {reason}"),
    };
    let count = stored.clusters.len();
    let archive = store.individuals(campaign, spec.model(), 0..count as u64, false)?;
    let behaviour = |individual: &ArchivedIndividual| {
        spec.method()
            .behaviour(&individual.features, &individual.embedding)
    };
    let mut behaviours = Behaviours::new(archive.first().map_or(0, |first| behaviour(first).len()));
    for individual in &archive {
        behaviours
            .push(&behaviour(individual))
            .map_err(|misfit| damaged(misfit.to_string()))?;
    }
    let known = |index: &u64| *index < behaviours.len() as u64;
    let placed = |cluster: &u32| (*cluster as usize) < stored.medoids.len();
    if behaviours.len() != count || !stored.medoids.iter().all(known) || !stored.clusters.iter().all(placed) {
        return Err(damaged("it is of another archive".to_owned()));
    }
    let neighbours = spec.search().neighbours() as usize;
    // For a page of a completed campaign, as long as it takes.
    measure(
        &behaviours,
        &stored.clone().into(),
        neighbours,
        &Interrupt::default(),
    )
    .map_err(|interrupted| damaged(interrupted.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_model::Weight;
    use murmuration_store::{DataDirectory, GenerationRecord, Provenance};

    #[test]
    fn what_an_older_version_did_not_measure_is_measured_from_the_archive() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let text =
            "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n[search]\npopulation = 4\nneighbours = 2";
        let spec = CampaignSpec::from_toml(text).unwrap();
        let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
        let individual = |(index, speed): (u64, f64)| ArchivedIndividual {
            features: [speed, 0.0, 0.0, 0.0, 0.0],
            novelty: 100.0,
            ..crate::still::still(index, 0)
        };
        let individuals: Vec<_> = (0..).zip([0.0, 1.0, 3.0, 10.0]).map(individual).collect();
        let record = GenerationRecord::of(0, &[100.0], 0);
        store
            .commit_generation(&id, &record, &individuals, &Provenance::default())
            .unwrap();
        let clustering = Clustering {
            medoids: vec![1, 3],
            clusters: vec![0, 0, 0, 1],
            loss: 3.0,
        };
        let read = || Taxonomy::read(&store, &id, &spec).unwrap().unwrap();
        store.complete(&id, &clustering, &[]).unwrap();
        let older = read();
        let figures = |medoid: &Medoid| (medoid.cluster_size, medoid.mean_distance, medoid.novelty);
        let told: Vec<_> = older.medoids.iter().map(figures).collect();
        assert_eq!(told, [(3, 1.0, 1.5), (1, 0.0, 8.0)]);
        // A newer one stores the same.
        let mut behaviours = Behaviours::new(5);
        for individual in &individuals {
            behaviours.push(&individual.features).unwrap();
        }
        store
            .complete(
                &id,
                &clustering,
                &measure(&behaviours, &clustering, 2, &Interrupt::default()).unwrap(),
            )
            .unwrap();
        assert_eq!(read(), older);
    }
}
