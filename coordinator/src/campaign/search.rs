//! One campaign's search: propose, have evaluated, absorb, commit; and the taxonomy at the end.

use super::{CampaignError, CampaignId, CampaignState, live::Live};
use crate::{
    breeding::{self, Parent, Proposal, ProposeError},
    dispatch::{Dispatch, EvaluationJob, JobError},
    medoids,
    novelty::{self, Behaviours},
    store::{ArchivedIndividual, GenerationRecord, Store, StoreError},
};
use murmuration_proto::{CampaignSpec, Evaluation, Purpose, Stream};
use std::sync::Arc;

/// Individuals read from the store at a time.
const CHUNK: u64 = 4096;

/// A campaign's search between two generations: a function of its specification and its archive.
pub(super) struct Search {
    store: Store,
    id: CampaignId,
    spec: Arc<CampaignSpec>,
    behaviours: Behaviours,
    /// The last generation; empty before the first.
    parents: Vec<Parent>,
    next_generation: u32,
}

/// Runs the campaign from where its archive ends until it is complete, failed or stopped.
pub(super) async fn run(
    store: Store,
    dispatch: Dispatch,
    id: CampaignId,
    spec: Arc<CampaignSpec>,
    mut live: Live,
) {
    match generations(store.clone(), dispatch, id.clone(), spec, &mut live).await {
        Ok(Outcome::Completed) => tracing::info!(campaign = %id, "completed"),
        // Whoever shuts the coordinator down wants the campaign to go on with the next one.
        Ok(Outcome::Stopped) | Err(CampaignError::Job(JobError::ShuttingDown)) => {}
        Err(error) => {
            let said = error.to_string();
            tracing::error!(campaign = %id, error = said, "failed");
            live.failed(&said);
            let recorded = blocking(move || store.set_state(&id, CampaignState::Failed, &said)).await;
            if let Ok(Err(error)) = recorded {
                tracing::warn!(%error, "the failure could not be recorded");
            }
        }
    }
}

enum Outcome {
    Completed,
    Stopped,
}

async fn generations(
    store: Store,
    dispatch: Dispatch,
    id: CampaignId,
    spec: Arc<CampaignSpec>,
    live: &mut Live,
) -> Result<Outcome, CampaignError> {
    let mut search = blocking(move || Search::restore(store, id, spec)).await??;
    while search.next_generation < search.spec.search().generations() {
        let (unchanged, proposal) = blocking(move || {
            let proposal = search.propose();
            (search, proposal)
        })
        .await?;
        search = unchanged;
        let proposal = proposal?;
        let seeds = search.seeds();
        let job = EvaluationJob {
            model: search.spec.model(),
            world: *search.spec.world(),
            image: *search.spec.image(),
            tasks: proposal
                .controllers
                .iter()
                .copied()
                .zip(seeds.iter().copied())
                .collect(),
        };
        let Some(evaluations) = live.until_stopped(|done| dispatch.evaluate(job, done)).await else {
            return Ok(Outcome::Stopped);
        };
        let evaluations = evaluations?;
        search = blocking(move || search.absorb(proposal, &seeds, evaluations)).await??;
        live.committed();
    }
    blocking(move || search.complete()).await??;
    Ok(Outcome::Completed)
}

impl Search {
    /// The search as the store left it.
    fn restore(store: Store, id: CampaignId, spec: Arc<CampaignSpec>) -> Result<Self, CampaignError> {
        let population = u64::from(spec.search().population());
        let next_generation = store.generations(&id)?.len() as u32;
        let len = u64::from(next_generation) * population;
        let mut search = Self {
            behaviours: Behaviours::new(5),
            parents: Vec::new(),
            next_generation,
            store,
            id,
            spec,
        };
        for start in (0..len).step_by(CHUNK as usize) {
            let range = start..len.min(start + CHUNK);
            for individual in search
                .store
                .individuals(&search.id, search.spec.model(), range, false)?
            {
                search.behaviours.push(&individual.features)?;
                if individual.index + population >= len {
                    let ArchivedIndividual {
                        controller, novelty, ..
                    } = individual;
                    search.parents.push(Parent { controller, novelty });
                }
            }
        }
        if search.behaviours.len() as u64 != len {
            let reason = format!(
                "campaign {} lacks individuals of its complete generations",
                search.id
            );
            return Err(StoreError::Damaged {
                path: Store::FILE.into(),
                reason,
            }
            .into());
        }
        Ok(search)
    }

    fn propose(&self) -> Result<Proposal, ProposeError> {
        breeding::propose(&self.spec, self.next_generation, &self.parents)
    }

    /// Seeds of the starts of the generation to come.
    fn seeds(&self) -> Vec<u64> {
        let first = self.behaviours.len() as u64;
        let population = u64::from(self.spec.search().population());
        (first..first + population)
            .map(|index| Stream::derive(self.spec.seed(), Purpose::Start, index).bits())
            .collect()
    }

    /// Adds an evaluated generation to the archive, in memory and on disk.
    fn absorb(
        mut self,
        proposal: Proposal,
        seeds: &[u64],
        evaluations: Vec<Evaluation>,
    ) -> Result<Self, CampaignError> {
        let first = self.behaviours.len();
        for evaluation in &evaluations {
            self.behaviours.push(evaluation.features())?;
        }
        let neighbours = self.spec.search().neighbours() as usize;
        let novelty = novelty::novelty(&self.behaviours, first..self.behaviours.len(), neighbours);
        let record = GenerationRecord {
            generation: self.next_generation,
            best_novelty: novelty.iter().copied().fold(0.0, f64::max),
            mean_novelty: novelty.iter().sum::<f64>() / novelty.len().max(1) as f64,
            filtered: proposal.filtered,
        };
        let individuals: Vec<_> = (first as u64..)
            .zip(&proposal.controllers)
            .zip(seeds.iter().zip(evaluations).zip(&novelty))
            .map(
                |((index, &controller), ((&seed, evaluation), &novelty))| ArchivedIndividual {
                    index,
                    generation: record.generation,
                    controller,
                    seed,
                    features: *evaluation.features(),
                    novelty,
                    image: Some(evaluation.into_image()),
                },
            )
            .collect();
        self.store.commit_generation(&self.id, &record, &individuals)?;
        let parent = |(controller, novelty)| Parent { controller, novelty };
        self.parents = proposal
            .controllers
            .into_iter()
            .zip(novelty)
            .map(parent)
            .collect();
        self.next_generation += 1;
        Ok(self)
    }

    /// Clusters the archive and completes the campaign.
    fn complete(self) -> Result<(), StoreError> {
        let mut stream = Stream::derive(self.spec.seed(), Purpose::Medoids, 0);
        let taxonomy = medoids::cluster(&self.behaviours, self.spec.medoids() as usize, &mut stream);
        self.store.complete(&self.id, &taxonomy)
    }
}

/// Runs `work`, which computes or waits for the disk, where it does not hold up the network.
pub(crate) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, CampaignError> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|_| CampaignError::Broken)
}
