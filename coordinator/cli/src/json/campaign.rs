//! Campaigns, their individuals, and how they end.

use super::Time;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use murmuration_proto::{CampaignSpec, Controller, Dataset, EmbedderSource, Evaluation, v1};
use schemars::JsonSchema;
use serde::Serialize;

/// A campaign and its progress.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Campaign {
    /// Its id.
    campaign: String,
    state: State,
    /// Whether this coordinator works on it now. A running campaign that is not active was interrupted.
    active: bool,
    /// Why it failed; empty if it did not.
    error: String,
    /// When it was created.
    created: Time,
    /// When it stopped; null while it runs, and where nobody noted it.
    ended: Option<Time>,
    /// Name of the study that it was started for; null if none.
    study: Option<String>,
    /// Its share of the workers in proportion to the weights of other running campaigns: 1 to 10,000.
    weight: u32,
    /// Complete generations.
    generations_done: u32,
    /// Generations at the end of the rounds that have begun.
    generations: u32,
    /// Evaluations that have arrived; null if its specification cannot be read.
    evaluations_done: Option<u64>,
    /// Evaluations of all generations; null if its specification cannot be read.
    evaluations: Option<u64>,
    /// Evaluations a second over the last seconds.
    evaluations_per_second: f64,
    /// Novelty of the last complete generation, as measured when it was evaluated; null before the first.
    novelty_of_the_last_generation: Option<Novelty>,
    /// Workers connected to the coordinator.
    workers: u32,
    /// Trainers connected to the coordinator.
    trainers: u32,
    stage: Stage,
    /// Pictures of the dataset that have arrived.
    dataset_done: u64,
    /// Pictures of the whole dataset; null if the campaign trains no embedder.
    dataset: Option<u64>,
    /// The training; null unless there is one.
    training: Option<Training>,
    /// Digest of the checkpoint that embedded its archive; empty if none did.
    checkpoint: String,
    /// Digest of the checkpoint that the campaign moves to; empty if there is none.
    next_checkpoint: String,
    /// Pictures embedded by the next checkpoint.
    embedded: u64,
    /// Rounds of feedback that are done.
    rounds_done: u32,
    /// Individuals that the synthetic annotator has labelled in this stage; null in other stages.
    labelled_in_this_stage: Option<u32>,
    /// Unusual events, oldest first: the last 50.
    notices: Vec<Notice>,
    /// What the campaign waits for; empty if it does not wait.
    waiting: String,
    /// Its specification, TOML; null if it cannot be read.
    spec: Option<String>,
}

/// The state of a campaign.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum State {
    Unspecified,
    Running,
    Paused,
    Completed,
    Failed,
    Cancelled,
}

/// What a running campaign does, or a stopped campaign would do next.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum Stage {
    Unspecified,
    Dataset,
    Pretrain,
    Embed,
    Evolve,
    Label,
    FineTune,
    Taxonomy,
}

/// Novelty of a generation.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Novelty {
    /// The highest.
    best: f64,
    /// The mean.
    mean: f64,
}

/// Something unusual that happened to a campaign, which went on.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Notice {
    /// When it happened.
    time: Time,
    /// What happened.
    text: String,
}

/// How far a training is; a figure is null before it is first measured.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Training {
    /// Complete epochs.
    epoch: u64,
    /// Epochs at the end of the training.
    epochs: u64,
    /// Mean loss of the last epoch.
    loss: Option<f64>,
    /// Learning rate of the last step.
    learning_rate: Option<f64>,
    /// Triplets a second in the last epoch.
    triplets_per_second: Option<f64>,
    /// Time that the remaining epochs take at the pace of the last one.
    seconds_left: Option<f64>,
    /// Share of held-out triplets told apart, 0 to 1.
    triplet_accuracy: Option<f64>,
    /// Root mean square distance of the held-out embeddings from their mean.
    spread: Option<f64>,
    /// Dimensions that the held-out embeddings fill.
    rank: Option<f64>,
}

/// A controller and its behaviour.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Individual {
    /// Place in the archive, from 0; null for a controller that was only simulated.
    index: Option<u64>,
    /// Generation, from 0; null for a controller that was only simulated.
    generation: Option<u32>,
    /// The genes, in the order in which `murmuration robot` names them; of the paper's robots 4 wheel speeds, or 8 and an angle in radians.
    controller: Vec<f64>,
    /// Seed of the start, the first one if there are several.
    seed: u64,
    /// Average speed, angular momentum, radial variance, scatter, group rotation: means over the trials.
    features: Vec<f64>,
    /// Mean distance to the nearest neighbours in the archive as it stood after the individual's generation; null for a
    /// controller that was only simulated.
    novelty_when_evaluated: Option<f64>,
    /// Embedding by the campaign's checkpoint, the mean over the trials; empty if there is none.
    embedding: Vec<f64>,
    /// Its trials, one a start; empty if there is one.
    trials: Vec<Trial>,
    /// Grey values of the picture (of the first trial), base64, channel by channel and column by column; null if there is no picture.
    image: Option<String>,
}

/// One simulation of an individual that has several.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Trial {
    /// Seed of its start.
    seed: u64,
    /// Average speed, angular momentum, radial variance, scatter, group rotation.
    features: Vec<f64>,
    /// Embedding by the campaign's checkpoint; empty if there is none.
    embedding: Vec<f64>,
}

/// How a campaign ended.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Run {
    /// Its id.
    pub(crate) campaign: String,
    /// Digest of its archive.
    pub(crate) digest: String,
    /// Path of its report.
    pub(crate) report: String,
    /// Evaluations of its archive.
    pub(crate) evaluations: u64,
    /// Time that the command took.
    pub(crate) seconds: f64,
}

/// What was deleted with a campaign, or would be.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Deletion {
    /// Id of the campaign.
    campaign: String,
    /// Whether it was deleted.
    deleted: bool,
    /// Individuals of its archive.
    individuals: u64,
    /// Pictures of its dataset.
    pictures: u64,
    /// Individuals with a label.
    labelled: u64,
    /// Whether it had a taxonomy.
    taxonomy: bool,
}

impl Deletion {
    /// What a coordinator said of a campaign that it has `deleted`, or only looked at.
    pub(crate) fn of(deletion: &v1::DeleteCampaignResponse, deleted: bool) -> Self {
        Self {
            campaign: deletion.campaign.clone(),
            deleted,
            individuals: deletion.individuals,
            pictures: deletion.pictures,
            labelled: deletion.labelled,
            taxonomy: deletion.taxonomy,
        }
    }
}

/// The digest of an archive.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Digest {
    /// Id of the campaign.
    pub(crate) campaign: String,
    /// Digest of its archive.
    pub(crate) digest: String,
    /// Evaluations of its archive.
    pub(crate) evaluations: u64,
    /// Whether the campaign is completed; otherwise its archive still grows, or stays without its end.
    pub(crate) complete: bool,
}

/// Where a report was written.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Report {
    /// Path of its page.
    pub(crate) report: String,
}

impl From<&v1::Campaign> for Campaign {
    fn from(campaign: &v1::Campaign) -> Self {
        let spec = campaign
            .spec
            .clone()
            .map(CampaignSpec::try_from)
            .and_then(Result::ok);
        let search = spec.as_ref().map(|spec| *spec.search());
        let evaluations =
            |generations| search.map(|search| u64::from(generations) * u64::from(search.population()));
        let labels_now = campaign.active && campaign.stage() == v1::CampaignStage::Label;
        Self {
            campaign: campaign.id.clone(),
            state: campaign.state().into(),
            active: campaign.active,
            error: campaign.error.clone(),
            created: Time::of_ms(campaign.created_ms),
            ended: campaign.ended_ms.map(Time::of_ms),
            study: (!campaign.study.is_empty()).then(|| campaign.study.clone()),
            weight: campaign.weight,
            generations_done: campaign.generations_done,
            generations: campaign.generations,
            evaluations_done: evaluations(campaign.generations_done)
                .map(|done| done + u64::from(campaign.evaluated_in_generation)),
            evaluations: evaluations(campaign.generations),
            evaluations_per_second: campaign.evaluations_per_second,
            novelty_of_the_last_generation: Novelty::of(campaign),
            workers: campaign.workers,
            trainers: campaign.trainers,
            stage: campaign.stage().into(),
            dataset_done: campaign.dataset_done,
            dataset: spec.as_ref().and_then(dataset).map(Dataset::pictures),
            training: campaign.training.as_ref().map(Training::from),
            checkpoint: campaign.checkpoint.clone(),
            next_checkpoint: campaign.next_checkpoint.clone(),
            embedded: campaign.embedded,
            rounds_done: campaign.rounds_done,
            labelled_in_this_stage: labels_now.then_some(campaign.labelled),
            notices: campaign.notices.iter().map(Notice::from).collect(),
            waiting: campaign.waiting.clone(),
            spec: spec.map(|spec| spec.to_toml()),
        }
    }
}

/// What a campaign's embedder is trained on, if it trains one.
fn dataset(spec: &CampaignSpec) -> Option<&Dataset> {
    match spec.embedder()? {
        EmbedderSource::Trained { dataset, .. } => Some(dataset),
        EmbedderSource::Published(_) => None,
    }
}

impl From<v1::CampaignState> for State {
    fn from(state: v1::CampaignState) -> Self {
        match state {
            v1::CampaignState::Unspecified => Self::Unspecified,
            v1::CampaignState::Running => Self::Running,
            v1::CampaignState::Paused => Self::Paused,
            v1::CampaignState::Completed => Self::Completed,
            v1::CampaignState::Failed => Self::Failed,
            v1::CampaignState::Cancelled => Self::Cancelled,
        }
    }
}

impl From<v1::CampaignStage> for Stage {
    fn from(stage: v1::CampaignStage) -> Self {
        match stage {
            v1::CampaignStage::Unspecified => Self::Unspecified,
            v1::CampaignStage::Dataset => Self::Dataset,
            v1::CampaignStage::Pretrain => Self::Pretrain,
            v1::CampaignStage::Embed => Self::Embed,
            v1::CampaignStage::Evolve => Self::Evolve,
            v1::CampaignStage::Label => Self::Label,
            v1::CampaignStage::FineTune => Self::FineTune,
            v1::CampaignStage::Taxonomy => Self::Taxonomy,
        }
    }
}

impl Novelty {
    fn of(campaign: &v1::Campaign) -> Option<Self> {
        let (best, mean) = (campaign.best_novelty?, campaign.mean_novelty?);
        Some(Self { best, mean })
    }
}

impl From<&v1::Notice> for Notice {
    fn from(notice: &v1::Notice) -> Self {
        Self {
            time: Time::of_ms(notice.time_ms),
            text: notice.text.clone(),
        }
    }
}

impl From<&v1::TrainingProgress> for Training {
    fn from(progress: &v1::TrainingProgress) -> Self {
        Self {
            epoch: progress.epoch,
            epochs: progress.epochs,
            loss: progress.loss,
            learning_rate: progress.learning_rate,
            triplets_per_second: progress.triplets_per_second,
            seconds_left: progress.seconds_left,
            triplet_accuracy: progress.triplet_accuracy,
            spread: progress.spread,
            rank: progress.rank,
        }
    }
}

impl Individual {
    /// A controller as it was simulated here, in no archive.
    pub(crate) fn simulated(controller: &Controller, seed: u64, evaluation: &Evaluation) -> Self {
        Self {
            index: None,
            generation: None,
            controller: controller.genes().to_vec(),
            seed,
            features: evaluation.features().to_vec(),
            novelty_when_evaluated: None,
            embedding: Vec::new(),
            trials: Vec::new(),
            image: Some(STANDARD.encode(evaluation.image())),
        }
    }
}

impl From<&v1::Trial> for Trial {
    fn from(trial: &v1::Trial) -> Self {
        Self {
            seed: trial.seed,
            features: trial.features.clone(),
            embedding: trial.embedding.iter().copied().map(f64::from).collect(),
        }
    }
}

impl From<&v1::Individual> for Individual {
    fn from(individual: &v1::Individual) -> Self {
        Self {
            index: Some(individual.index),
            generation: Some(individual.generation),
            controller: individual.controller.clone(),
            seed: individual.seed,
            features: individual.features.clone(),
            novelty_when_evaluated: Some(individual.novelty),
            embedding: individual.embedding.iter().copied().map(f64::from).collect(),
            trials: individual.trials.iter().map(Trial::from).collect(),
            image: individual.image.as_deref().map(|image| STANDARD.encode(image)),
        }
    }
}
