//! Domain values as the messages that carry them, and errors as statuses.

use crate::{
    campaign::{CampaignError, CampaignStatus, Stage},
    dispatch::JobError,
    store::{ArchivedIndividual, GenerationRecord, Notice, StoreError},
    taxonomy::{Medoid, Taxonomy},
};
use murmuration_proto::{CheckpointDigest, v1};
use tonic::Status;

impl From<CampaignStatus> for v1::Campaign {
    fn from(status: CampaignStatus) -> Self {
        let record = status.record;
        let (generations, dataset_done) = (record.generations(), record.dataset_done());
        let arrived = |stage| if status.stage == stage { status.arrived } else { 0 };
        let digest = |checkpoint: Option<CheckpointDigest>| {
            checkpoint.map(|digest| digest.to_string()).unwrap_or_default()
        };
        Self {
            id: record.id.as_str().to_owned(),
            spec: Some((&record.spec).into()),
            state: v1::CampaignState::from(record.state) as i32,
            error: record.error,
            created_ms: record.created_ms,
            weight: record.weight.get(),
            generations_done: record.generations_done,
            evaluated_in_generation: arrived(Stage::Evolve),
            evaluations_per_second: status.per_second,
            best_novelty: record.last_novelty.map(|(best, _)| best),
            mean_novelty: record.last_novelty.map(|(_, mean)| mean),
            active: status.active,
            workers: status.workers as u32,
            stage: v1::CampaignStage::from(status.stage) as i32,
            dataset_done: dataset_done + u64::from(arrived(Stage::Dataset)),
            training: status.training,
            checkpoint: digest(record.checkpoint),
            next_checkpoint: digest(record.next_checkpoint),
            embedded: record.embedded + u64::from(arrived(Stage::Embed)),
            trainers: status.trainers as u32,
            generations,
            rounds_done: record.rounds_done,
            labelled: arrived(Stage::Label),
            notices: status
                .notices
                .into_iter()
                .map(|Notice { time_ms, text }| v1::Notice { time_ms, text })
                .collect(),
            waiting: status.waiting.unwrap_or_default(),
        }
    }
}

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

impl From<Medoid> for v1::Medoid {
    fn from(medoid: Medoid) -> Self {
        Self {
            individual: Some(medoid.individual.into()),
            cluster_size: medoid.cluster_size,
            mean_distance: medoid.mean_distance,
        }
    }
}

impl From<Taxonomy> for v1::Taxonomy {
    fn from(taxonomy: Taxonomy) -> Self {
        Self {
            medoids: taxonomy.medoids.into_iter().map(Into::into).collect(),
            clusters: taxonomy.clusters,
            loss: taxonomy.loss,
        }
    }
}

impl From<StoreError> for Status {
    fn from(error: StoreError) -> Self {
        let said = error.to_string();
        match error {
            StoreError::NoCampaign(_) | StoreError::NoCheckpoint(_) | StoreError::NoIndividual { .. } => {
                Self::not_found(said)
            }
            StoreError::DiskFull { .. } | StoreError::Unwritable { .. } | StoreError::ReadOnly { .. } => {
                Self::resource_exhausted(said)
            }
            StoreError::Damaged { .. } => Self::data_loss(said),
            StoreError::InUse { .. } | StoreError::NoDirectory(_) | StoreError::Newer { .. } => {
                Self::failed_precondition(said)
            }
            StoreError::File { .. } | StoreError::Sqlite { .. } => Self::internal(said),
        }
    }
}

impl From<JobError> for Status {
    fn from(error: JobError) -> Self {
        let said = error.to_string();
        match error {
            JobError::Fatal(_) | JobError::SetAside(_) => Self::failed_precondition(said),
            JobError::Disagreement { .. } => Self::data_loss(said),
            JobError::ShuttingDown => Self::unavailable(said),
        }
    }
}

impl From<CampaignError> for Status {
    fn from(error: CampaignError) -> Self {
        match error {
            CampaignError::Store(error) => error.into(),
            CampaignError::Job(error) => error.into(),
            CampaignError::Checkpoint(error) => error.into(),
            CampaignError::Query(error) => error.into(),
            CampaignError::Label(error) => error.into(),
            CampaignError::NotAllowed(_)
            | CampaignError::NoEmbedding { .. }
            | CampaignError::OtherSimulator { .. }
            | CampaignError::NoEmbedder(_)
            | CampaignError::TooFewClasses { .. }
            | CampaignError::Untrainable { .. }
            | CampaignError::Tainted { .. }
            | CampaignError::Propose(_) => Self::failed_precondition(error.to_string()),
            CampaignError::Misfit(_) | CampaignError::Broken => Self::internal(error.to_string()),
        }
    }
}
