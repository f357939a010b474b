//! What is stored, as the messages that carry it.

use crate::{ArchivedIndividual, CheckpointRecord, GenerationRecord, Trial};
use murmuration_proto::{Starts, v1};

impl From<ArchivedIndividual> for v1::Individual {
    fn from(individual: ArchivedIndividual) -> Self {
        let starts = individual.trials.len();
        let seeds = Starts::new("trials", starts as u32).unwrap_or_default();
        let trial = |(seed, trial): (u64, &Trial)| v1::Trial {
            seed,
            features: trial.features.to_vec(),
            embedding: trial.embedding.clone(),
        };
        let trials = seeds.seeds(individual.seed).zip(&individual.trials);
        Self {
            index: individual.index,
            generation: individual.generation,
            controller: individual.controller.genes().to_vec(),
            seed: individual.seed,
            features: individual.features().to_vec(),
            novelty: individual.novelty,
            embedding: individual.embedding(),
            trials: trials.filter(|_| starts > 1).map(trial).collect(),
            verdicts: individual
                .verdicts()
                .map(|verdict| verdict.number().into())
                .collect(),
            image: individual.into_image(),
        }
    }
}

impl From<GenerationRecord> for v1::GenerationSummary {
    fn from(record: GenerationRecord) -> Self {
        Self {
            generation: record.generation,
            best_novelty: record.best_novelty,
            mean_novelty: record.mean_novelty,
            filtered: record.filtered,
        }
    }
}

impl From<CheckpointRecord> for v1::Checkpoint {
    fn from(record: CheckpointRecord) -> Self {
        record
            .lineage
            .describe(record.digest, record.size, record.created_ms)
    }
}
