//! Measurements of a taxonomy that no campaign stores: the judge's verdicts on its medoids and on a sample of the archive, and the
//! members that show the spread of each cluster. This process makes them once per version of a taxonomy.

use super::further_starts::most_frequent;
use crate::Web;
use murmuration_engine::{
    blocking::{in_background, parallel},
    taxonomy::{Place, Taxonomy, spreads},
};
use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};
use murmuration_report::{Candidate, Judged};
use murmuration_service::OrStatus as _;
use murmuration_store::{ArchivedIndividual, Store, StoreError, kept::LatestAnswers};
use murmuration_swarm::Verdict;
use std::{collections::BTreeMap, sync::Arc};
use tonic::Status;

/// Maximum size of all kept measurements, in bytes.
const MOST_BYTES: usize = 8 << 20;

/// The measurements of a version of a taxonomy.
#[derive(Debug, Default)]
pub(crate) struct Measured {
    pub(crate) judged: Judged,
    /// The members that show the spread of each cluster, by the place of the cluster; empty for earlier versions, whose space the
    /// archive may have left.
    pub(super) spreads: Vec<Option<[Place; 3]>>,
}

/// The latest measurements. A clone is cheap.
#[derive(Debug, Clone)]
pub struct Measurements(LatestAnswers<Measure, Arc<Measured>>);

/// What measurements depend on: the archive version, the number of individuals, and whether the medoids are those of the current
/// taxonomy; otherwise the medoids themselves.
type Measure = (ArchiveVersion, u64, Option<Vec<u64>>);

impl Default for Measurements {
    fn default() -> Self {
        Self(LatestAnswers::within(MOST_BYTES))
    }
}

impl Measurements {
    /// The measurements of a taxonomy of a campaign. `stands` says whether it is the current taxonomy.
    pub(crate) async fn of(
        &self,
        web: &Web,
        record: &CampaignRecord,
        taxonomy: &Taxonomy,
        stands: bool,
    ) -> Result<Arc<Measured>, Status> {
        let medoids = || taxonomy.medoids.iter().map(|medoid| medoid.individual.index);
        let earlier = (!stands).then(|| medoids().collect());
        let state = (record.archive_version(), record.individuals(), earlier);
        let bytes = |measured: &Arc<Measured>| {
            size_of_val(measured.judged.sample.as_slice()) + size_of_val(measured.spreads.as_slice())
        };
        let medoids: Vec<usize> = medoids().map(|index| index as usize).collect();
        let make = measure(web, record, taxonomy, medoids, stands);
        self.0.of(&record.id, state, bytes, make).await
    }
}

async fn measure(
    web: &Web,
    record: &CampaignRecord,
    taxonomy: &Taxonomy,
    medoids: Vec<usize>,
    stands: bool,
) -> Result<Arc<Measured>, Status> {
    let sample = match stands {
        true => Judged::sample(&record.spec, taxonomy.clusters.len()),
        false => Vec::new(),
    };
    let (id, model) = (record.id.clone(), record.spec.model().clone());
    let indices: Vec<u64> = medoids.iter().map(|&index| index as u64).chain(sample).collect();
    let read = move |store: &Store| -> Result<Vec<ArchivedIndividual>, StoreError> {
        let individuals = indices.into_iter();
        individuals
            .map(|index| store.individual(&id, &model, index))
            .collect()
    };
    let individuals = web.store.run(read).await.or_status()?;
    let (queries, of, clusters) = (
        web.labels.queries.clone(),
        record.clone(),
        taxonomy.clusters.clone(),
    );
    let measured = in_background(move |_| {
        let candidates: Vec<Candidate<'_>> = individuals
            .iter()
            .map(|individual| Candidate {
                index: individual.index,
                controller: &individual.controller,
                seed: individual.seed,
            })
            .collect();
        let (shown, sample) = candidates.split_at(medoids.len());
        let judged = parallel(|| Judged::of(&of.spec, shown, sample))?;
        let spreads = match stands && of.state == CampaignState::Completed {
            true => {
                let space = &queries.clusters(&of).or_status()?.space;
                spreads(&space.behaviours, &medoids, &clusters)
            }
            false => Vec::new(),
        };
        Ok::<_, Status>(Measured { judged, spreads })
    });
    Ok(Arc::new(measured.await.or_status()??))
}

impl Measured {
    /// The judge's verdicts on the medoids of a taxonomy, by the index of the medoid: the most frequent verdict over all starts
    /// where the campaign asked the judge, or else the verdict on the first start.
    pub(crate) fn verdicts(&self, taxonomy: &Taxonomy) -> BTreeMap<u64, Verdict> {
        let verdict = |(place, medoid): (usize, &murmuration_engine::taxonomy::Medoid)| {
            let individual = &medoid.individual;
            let first = self.judged.medoids.get(place).copied();
            Some((individual.index, most_frequent(individual.verdicts()).or(first)?))
        };
        taxonomy.medoids.iter().enumerate().filter_map(verdict).collect()
    }
}
