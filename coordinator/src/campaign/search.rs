//! The evolve stage: propose, have evaluated, absorb, commit; and the taxonomy at the end.

use super::{
    CampaignError, CampaignId,
    live::Live,
    run::{Means, Outcome, blocking},
};
use crate::{
    breeding::{self, Parent, Proposal, ProposeError},
    dispatch::{Embedder, EvaluationJob},
    medoids,
    novelty::{self, Behaviours},
    store::{ArchivedIndividual, CampaignRecord, GenerationRecord, Store, StoreError},
};
use murmuration_proto::{CampaignSpec, Evaluation, Method, Purpose, Stream};
use std::sync::Arc;

/// Individuals read from the store at a time.
const CHUNK: u64 = 4096;

/// A campaign's search between two generations: a function of its specification, its embedder and its archive.
struct Search {
    store: Store,
    id: CampaignId,
    spec: Arc<CampaignSpec>,
    embedder: Option<Embedder>,
    behaviours: Behaviours,
    /// The last generation; empty before the first.
    parents: Vec<Parent>,
    next_generation: u32,
}

/// Searches from where the archive ends to the last generation.
pub(super) async fn evolve(
    means: &Means,
    record: CampaignRecord,
    live: &mut Live,
) -> Result<Outcome, CampaignError> {
    let generations = record.generations();
    let mut search = restore(means, record).await?;
    while search.next_generation < generations {
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
            embedder: search.embedder,
            tasks: proposal
                .controllers
                .iter()
                .copied()
                .zip(seeds.iter().copied())
                .collect(),
        };
        let evaluated = live
            .until_stopped(|done| means.dispatch.evaluate(job, done))
            .await;
        let Some(evaluations) = evaluated else {
            return Ok(Outcome::Stopped);
        };
        let evaluations = evaluations?;
        let count = evaluations.len() as u64;
        search = blocking(move || search.absorb(proposal, &seeds, evaluations)).await??;
        live.committed(count);
    }
    Ok(Outcome::Done)
}

/// Clusters the archive and completes the campaign.
pub(super) async fn complete(means: &Means, record: CampaignRecord) -> Result<(), CampaignError> {
    let search = restore(means, record).await?;
    Ok(blocking(move || search.complete()).await??)
}

/// Numbers in a behaviour vector.
pub(super) const fn dimensions(method: Method, embedding: Option<usize>) -> usize {
    let features = if method.has_features() { 5 } else { 0 };
    match embedding {
        Some(embedding) => embedding + features,
        None => features,
    }
}

/// The search as the store left it.
async fn restore(means: &Means, record: CampaignRecord) -> Result<Search, CampaignError> {
    let embedder = match record.checkpoint {
        Some(checkpoint) => Some(
            means
                .checkpoints
                .embedder(checkpoint, record.spec.image())
                .await?,
        ),
        None => None,
    };
    let store = means.store.clone();
    blocking(move || Search::restore(store, record, embedder)).await?
}

impl Search {
    fn restore(
        store: Store,
        record: CampaignRecord,
        embedder: Option<Embedder>,
    ) -> Result<Self, CampaignError> {
        let population = u64::from(record.spec.search().population());
        let method = record.spec.method();
        let len = u64::from(record.generations_done) * population;
        let mut search = Self {
            behaviours: Behaviours::new(dimensions(method, embedder.map(|embedder| embedder.dimensions))),
            parents: Vec::new(),
            next_generation: record.generations_done,
            store,
            id: record.id,
            spec: Arc::new(record.spec),
            embedder,
        };
        for start in (0..len).step_by(CHUNK as usize) {
            let range = start..len.min(start + CHUNK);
            for individual in search
                .store
                .individuals(&search.id, search.spec.model(), range, false)?
            {
                let behaviour = method.behaviour(&individual.features, &individual.embedding);
                search.behaviours.push(&behaviour)?;
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
        let method = self.spec.method();
        for evaluation in &evaluations {
            let behaviour = method.behaviour(evaluation.features(), evaluation.embedding());
            self.behaviours.push(&behaviour)?;
        }
        let neighbours = self.spec.search().neighbours() as usize;
        let novelty = novelty::novelty(&self.behaviours, first..self.behaviours.len(), neighbours);
        let record = GenerationRecord::of(self.next_generation, &novelty, proposal.filtered);
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
                    embedding: evaluation.embedding().to_vec(),
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
