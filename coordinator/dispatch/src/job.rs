//! Jobs that campaigns submit to the dispatcher, and their outcomes.

use super::LeasedTraining;
use murmuration_model::{
    CampaignId, CampaignRecord, EmbedderRef, Maker, SavedTraining, TrainingPictures, Weight,
};
use murmuration_proto::v1;
use murmuration_swarm::{
    CapabilityModel, CheckpointDigest, CompressedImage, Controller, Evaluation, Frames, ImageFormat,
    PictureShape, Starts, World, training::Configuration,
};
use std::fmt;
use tokio::sync::watch;

/// A campaign, or a stream of evaluations. It ends only after the audits of its jobs.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Submitter {
    Campaign(CampaignId),
    /// A stream of evaluations without a campaign, see [`Dispatch::new_stream`](crate::Dispatch::new_stream).
    Stream(u64),
}

impl Submitter {
    #[must_use]
    pub const fn campaign(&self) -> Option<&CampaignId> {
        match self {
            Self::Campaign(campaign) => Some(campaign),
            Self::Stream(_) => None,
        }
    }
}

impl fmt::Display for Submitter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Campaign(campaign) => campaign.fmt(f),
            Self::Stream(number) => write!(f, "stream {number}"),
        }
    }
}

/// Controllers to evaluate. Their tasks differ only in genome and seed.
#[derive(Debug, Clone)]
pub struct EvaluationJob {
    /// Campaign or stream that the job belongs to; `None` if the results are only shown. Audits of such a job end with the job.
    pub submitter: Option<Submitter>,
    /// The job's share of the workers.
    pub weight: Weight,
    pub model: CapabilityModel,
    pub world: World,
    /// Format of the pictures.
    pub image: ImageFormat,
    /// Embedder of the pictures; `None` if they are not embedded.
    pub embedder: Option<EmbedderRef>,
    /// Number of trials of each controller.
    pub starts: Starts,
    /// Whether the judge names the class of each trial.
    pub judges: bool,
    /// Controllers with the seeds of their first starts; at least one.
    pub tasks: Vec<(Controller, u64)>,
    /// Whether the tasks are leased after those of the campaign's earlier jobs: true for a generation that is evaluated beside
    /// the one before it.
    pub next: bool,
}

impl EvaluationJob {
    /// A job that simulates each controller once, from the start of its seed, in the world and picture format of this campaign.
    pub fn of(record: &CampaignRecord, embedder: Option<EmbedderRef>, tasks: Vec<(Controller, u64)>) -> Self {
        Self {
            submitter: Some(Submitter::Campaign(record.id.clone())),
            weight: record.weight,
            model: record.spec.model().clone(),
            world: record.spec.world().clone(),
            image: *record.spec.image(),
            embedder,
            starts: Starts::ONE,
            judges: false,
            tasks,
            next: false,
        }
    }

    /// Like [`EvaluationJob::of`], but each controller has as many trials as an individual of this campaign, and is judged if the
    /// campaign's individuals are.
    pub fn of_individuals(
        record: &CampaignRecord,
        embedder: Option<EmbedderRef>,
        tasks: Vec<(Controller, u64)>,
    ) -> Self {
        Self {
            starts: record.spec.starts(),
            judges: record.spec.judges(),
            ..Self::of(record, embedder, tasks)
        }
    }
}

/// Stored pictures to embed.
#[derive(Debug, Clone)]
pub struct EmbeddingJob {
    pub campaign: CampaignId,
    /// The campaign's share of the workers.
    pub weight: Weight,
    pub embedder: EmbedderRef,
    /// Number of pictures of each individual.
    pub starts: Starts,
    /// For each individual (at least one), a picture of each trial: grey values as in an evaluation, in the shape that the
    /// embedder expects.
    pub images: Vec<Vec<Vec<u8>>>,
}

#[derive(Debug)]
pub struct TrainingJob {
    pub campaign: CampaignId,
    /// The campaign's share of the workers.
    pub weight: Weight,
    pub configuration: Configuration,
    pub shape: PictureShape,
    /// The unlabelled pictures to train on.
    pub pictures: TrainingPictures,
    /// Checkpoint and labels of a fine-tuning; `None` for a pretraining.
    pub fine_tuning: Option<FineTuningParams>,
    /// Receives the progress of the training.
    pub progress: watch::Sender<Option<v1::TrainingProgress>>,
    /// Receives each snapshot of the training; only the newest snapshot matters.
    pub saved: watch::Sender<Option<SavedTraining>>,
}

impl TrainingJob {
    /// The training as it is leased to a trainer.
    pub(super) fn leased(&self) -> LeasedTraining {
        let bytes = self.configuration.saved_bytes(self.shape);
        LeasedTraining {
            configuration: self.configuration.clone(),
            parent: self.fine_tuning.map(|from| from.parent),
            // If the network does not suit the pictures, nothing can be trained.
            snapshot_bytes: bytes.unwrap_or(0),
        }
    }
}

/// The starting point of a training on labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FineTuningParams {
    pub parent: CheckpointDigest,
    /// Number of labelled pictures.
    pub labelled: u32,
    /// Number of labels that the pictures come from.
    pub labels: u32,
}

/// One simulation to watch.
#[derive(Debug, Clone)]
pub struct ReplayJob {
    /// Campaign whose archive has the individual.
    pub campaign: CampaignId,
    pub controller: Controller,
    pub world: World,
    pub seed: u64,
    /// The frames to return.
    pub frames: Frames,
}

/// Outcome of the evaluation of a controller.
#[derive(Debug, Clone)]
pub enum Evaluated {
    Done {
        /// Results of the controller's trials, as many as the job has starts.
        trials: Vec<Evaluation<CompressedImage>>,
        maker: Maker,
    },
    /// The task was given up.
    Poisoned(PoisonedTask),
}

/// A task whose workers were lost, so that it is not tried again.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} workers were lost while they ran this task, the last two while they ran no other task: {}", .workers.len(),
    .workers.join(", ")
)]
pub struct PoisonedTask {
    pub workers: Vec<String>,
}

/// Why a job failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JobError {
    /// Workers or trainers on two machines (or on the only machine) report that the job is impossible.
    #[error("{0}")]
    Fatal(String),
    /// Machines computed different results for the same task.
    #[error(
        "workers disagree about task {task} ({}), and no third machine can decide which of them is right: start a worker \
         on another machine, and resume the campaign", .workers.join(" and ")
    )]
    Disagreement {
        task: usize,
        /// Names of the workers that disagree.
        workers: Vec<String>,
    },
    /// A task was poisoned, and this kind of work has no substitute for it.
    #[error("the work cannot be done: {0}")]
    Poisoned(#[from] PoisonedTask),
    /// No worker is connected.
    #[error("{}", super::NO_WORKER)]
    NoWorker,
    /// The coordinator is stopping.
    #[error("the coordinator is shutting down")]
    ShuttingDown,
}
