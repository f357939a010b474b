//! What is stored, as the messages that carry it.

use crate::{ArchivedIndividual, CheckpointRecord, GenerationRecord};
use murmuration_proto::v1;

impl From<ArchivedIndividual> for v1::Individual {
    fn from(individual: ArchivedIndividual) -> Self {
        Self {
            index: individual.index,
            generation: individual.generation,
            controller: individual.controller.genes().to_vec(),
            seed: individual.seed,
            features: individual.features.to_vec(),
            image: individual.image,
            novelty: individual.novelty,
            embedding: individual.embedding,
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
