//! Domain values as the messages that carry them, and errors as statuses.

use crate::{
    blocking::Broken,
    campaign::{CampaignError, CampaignStatus},
    dispatch::JobError,
    model::Stage,
    store::{ArchivedIndividual, GenerationRecord, Notice, StoreError},
    taxonomy::{Medoid, Taxonomy},
};
use murmuration_proto::{CheckpointDigest, PART_BYTES, Text, parts::parts, v1};
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
                .map(
                    |Notice {
                         number,
                         time_ms,
                         text,
                     }| v1::Notice {
                        time_ms,
                        text,
                        number,
                    },
                )
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
            novelty: medoid.novelty,
        }
    }
}

impl Taxonomy {
    /// The messages that carry it, part by part.
    pub(super) fn into_parts(self) -> impl Iterator<Item = v1::Taxonomy> + Send + 'static {
        // At most five bytes each on the wire.
        const CLUSTERS: usize = PART_BYTES / 5;
        let loss = v1::Taxonomy {
            loss: self.loss,
            ..v1::Taxonomy::default()
        };
        let medoids = self.medoids.into_iter().map(v1::Medoid::from);
        let medoids = parts(medoids, |medoids| v1::Taxonomy {
            medoids,
            ..v1::Taxonomy::default()
        });
        let clusters = self.clusters;
        let clusters = (0..clusters.len()).step_by(CLUSTERS).map(move |begin| {
            let end = clusters.len().min(begin + CLUSTERS);
            v1::Taxonomy {
                clusters: clusters[begin..end].to_vec(),
                ..v1::Taxonomy::default()
            }
        });
        std::iter::once(loss).chain(medoids).chain(clusters)
    }
}

impl From<StoreError> for Status {
    fn from(error: StoreError) -> Self {
        // It repeats what was asked for, which may be of any length.
        let said = Text::line(&error.to_string());
        match error {
            StoreError::NoCampaign(_) | StoreError::NoCheckpoint(_) | StoreError::NoIndividual { .. } => {
                Self::not_found(said)
            }
            StoreError::DiskFull { .. } | StoreError::Unwritable { .. } | StoreError::ReadOnly { .. } => {
                Self::resource_exhausted(said)
            }
            StoreError::Damaged { .. } => Self::data_loss(said),
            StoreError::InUse { .. }
            | StoreError::NoDirectory(_)
            | StoreError::Newer { .. }
            | StoreError::Unreleased { .. }
            | StoreError::Superseded(_) => Self::failed_precondition(said),
            StoreError::File { .. } | StoreError::Sqlite { .. } => Self::internal(said),
        }
    }
}

impl From<Broken> for Status {
    fn from(broken: Broken) -> Self {
        Self::internal(broken.to_string())
    }
}

impl From<JobError> for Status {
    fn from(error: JobError) -> Self {
        let said = error.to_string();
        match error {
            JobError::Fatal(_) | JobError::SetAside(_) => Self::failed_precondition(said),
            JobError::Disagreement { .. } => Self::data_loss(said),
            JobError::NoWorker | JobError::ShuttingDown => Self::unavailable(said),
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
            CampaignError::Interrupted(_) => Self::unavailable(error.to_string()),
            CampaignError::Misfit(_) | CampaignError::Broken => Self::internal(error.to_string()),
        }
    }
}
