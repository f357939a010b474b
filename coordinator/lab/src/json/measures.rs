//! Measurements of embeddings, the judge, atlases and this machine.

use super::Whole;
use murmuration_accuracy as accuracy;
use murmuration_train::bench::Figures;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// The labelled behaviours of a measurement.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Set {
    /// Paths of the label files.
    pub(crate) labels: Vec<String>,
    /// Behaviours with a class from an annotator other than the synthetic one.
    pub(crate) behaviours: u64,
    /// Rows by the synthetic annotator, which the measurement ignores.
    pub(crate) synthetic_left_out: u64,
}

/// The accuracy of an embedding.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Accuracy {
    #[serde(flatten)]
    pub(crate) set: Set,
    /// `features`, or the digest of the checkpoint.
    pub(crate) embedding: String,
    /// Triplets whose anchor is of another class than `random`.
    pub(crate) anchor_not_random: Tally,
    /// All triplets.
    pub(crate) every_anchor: Tally,
    /// Triplets by the class of their anchor.
    pub(crate) by_class_of_anchor: BTreeMap<String, Tally>,
}

/// The accuracy of untrained networks.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct UntrainedAccuracy {
    #[serde(flatten)]
    pub(crate) set: Set,
    /// Always `untrained`.
    pub(crate) embedding: String,
    /// Name of the network.
    pub(crate) network: String,
    /// Number of networks.
    pub(crate) networks: u32,
    /// Triplets whose anchor is of another class than `random`.
    pub(crate) anchor_not_random: Spread,
    /// All triplets.
    pub(crate) every_anchor: Spread,
}

/// Triplets, and how many of them are correct.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(crate) struct Tally {
    /// Triplets whose anchor is nearer to the positive than to the negative.
    correct: u64,
    /// All triplets.
    triplets: u64,
    /// The share of correct triplets; null if there are no triplets.
    percent: Option<f64>,
}

/// The accuracy of several networks.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(crate) struct Spread {
    /// Mean over the networks; null if there are no triplets.
    mean_percent: Option<f64>,
    /// Sample standard deviation; null with fewer than two networks.
    deviation_percent: Option<f64>,
}

/// The agreement of the rule-based judge, and of the second judge, with labels.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Judge {
    #[serde(flatten)]
    pub(crate) set: Set,
    /// Agreement of the rule-based judge with annotators.
    #[serde(flatten)]
    pub(crate) agreement: Agreement,
    /// The patterns among behaviours of the class `random`, by name.
    pub(crate) patterns: BTreeMap<String, PatternCounts>,
    /// Number of behaviours in whose world a class has no meaning, by class. The judge cannot give such a class.
    pub(crate) without_meaning: BTreeMap<String, u64>,
    /// Agreement of the second judge with annotators.
    pub(crate) second_judge: Agreement,
    /// Behaviours to which both judges give the same class.
    pub(crate) judges_agreed: u64,
    /// Cohen's kappa between the judges, -1 to 1; null if agreement by chance is certain.
    pub(crate) judges_kappa: Option<f64>,
    /// Behaviours to which both judges and annotators give the same class.
    pub(crate) all_agreed: u64,
}

/// How often a judge and annotators agree.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(crate) struct Agreement {
    /// Behaviours to which the judge and annotators give the same class.
    pub(crate) agreed: u64,
    /// Cohen's kappa, -1 to 1; null if agreement by chance is certain.
    pub(crate) kappa: Option<f64>,
    /// Number of behaviours by the annotators' class, then by the judge's class.
    pub(crate) judged_by_class: BTreeMap<String, BTreeMap<String, u64>>,
}

/// How often annotators and the judge see a pattern.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(crate) struct PatternCounts {
    /// Behaviours in which annotators see the pattern.
    pub(crate) given: u64,
    /// Behaviours in which annotators and the judge see the pattern.
    pub(crate) agreed: u64,
    /// Behaviours in which the judge sees the pattern.
    pub(crate) judged: u64,
}

/// An atlas that was written.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Atlas {
    /// Id of the atlas's campaign.
    pub(crate) campaign: String,
    /// Digest of the campaign's archive.
    pub(crate) digest: String,
    /// Path of the atlas's page, or of its table if the atlas has no page.
    pub(crate) atlas: String,
    /// Controllers that were simulated.
    pub(crate) controllers: u64,
}

/// A speed of Murmuration on this machine, beside the speed of another implementation, the peer.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct BenchAll {
    /// What was measured.
    pub(crate) item: String,
    /// The unit of `ours` and `peer`.
    pub(crate) unit: &'static str,
    /// The speed of Murmuration.
    pub(crate) ours: f64,
    /// The speed of the peer in the same run; null if the peer does not exist or is not installed.
    pub(crate) peer: Option<f64>,
    /// Name of the peer; null without a peer.
    pub(crate) peer_name: Option<&'static str>,
    /// `ours` divided by `peer`; null without `peer`.
    pub(crate) ratio: Option<f64>,
    /// Minimum work per result, counted by hand in docs/performance.md.
    pub(crate) floor: u64,
    /// Unit of `floor`.
    pub(crate) floor_unit: &'static str,
    /// The machine of the measurement.
    pub(crate) machine: Machine,
}

/// A machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
#[schemars(inline)]
pub(crate) struct Machine {
    /// Name of the CPU; null if the system does not report the name.
    pub(crate) cpu: Option<String>,
    /// Number of threads that run at the same time.
    pub(crate) cores: usize,
    /// Bits of the vectors that the simulator computes with; 64 without vectors.
    pub(crate) vector_bits: u32,
}

/// A speed of the simulator.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct BenchSimulate {
    /// Capability model.
    pub(crate) model: &'static str,
    /// Work per controller.
    pub(crate) what: &'static str,
    /// Evaluations a second on one core.
    pub(crate) evaluations_per_second_per_core: f64,
    /// The speed divided by the speed without SIMD.
    pub(crate) ratio_to_scalar: f64,
}

/// A speed of a cluster in one process.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct BenchCluster {
    /// What was measured.
    pub(crate) what: &'static str,
    /// Workers of one thread each.
    pub(crate) workers: u16,
    /// Number of evaluations in a round.
    pub(crate) results: u64,
    /// Evaluations written to disk a second, in the best round.
    pub(crate) results_per_second: f64,
    /// CPU time per evaluation in the best round: of coordinator and workers, or of the coordinator alone for null evaluations.
    pub(crate) cpu_seconds_per_result: f64,
    /// Evaluations a second of a plain loop on as many threads; null for null evaluations.
    pub(crate) loop_results_per_second: Option<f64>,
    /// CPU time per evaluation in the plain loop; null for null evaluations.
    pub(crate) loop_cpu_seconds_per_result: Option<f64>,
    /// The speed divided by the speed of the plain loop; null for null evaluations.
    pub(crate) ratio_to_loop: Option<f64>,
}

/// The time that a stage of a latent campaign takes.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct BenchPipeline {
    /// The stage: `dataset`, `pretrain`, `evolve` or `taxonomy`.
    pub(crate) stage: &'static str,
    /// Duration of the stage.
    pub(crate) seconds: f64,
    /// CPU time of coordinator, workers and trainer during the stage.
    pub(crate) cpu_seconds: f64,
    /// The stage's share of the campaign's time, 0 to 1.
    pub(crate) share: f64,
    /// Simulations of dataset and archive.
    pub(crate) simulations: u64,
    /// Time that a plain loop takes for `simulations` simulations.
    pub(crate) loop_seconds: f64,
}

/// A speed of training.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct BenchTrain {
    /// Name of the network.
    network: &'static str,
    /// Name of the recipe.
    recipe: &'static str,
    /// Weights of the network.
    weights: usize,
    /// Triplets that a step learns from.
    triplets_per_step: u64,
    /// Mean time of a step.
    seconds_per_step: f64,
    /// Time of an epoch.
    seconds_per_epoch: f64,
    /// Peak memory of the process so far; null if the system does not report it.
    peak_memory_bytes: Option<u64>,
}

/// Accuracy after a number of labels.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct BenchLabels {
    /// Query strategy that chose the labelled behaviours.
    pub(crate) strategy: &'static str,
    /// Number of labels.
    pub(crate) labels: usize,
    /// Seed of dataset, embedder and fine-tuning.
    pub(crate) seed: Whole,
    /// Correct triplets, in percent of the triplets whose anchor is of another class than `random`; null without such triplets.
    pub(crate) anchor_not_random_percent: Option<f64>,
    /// Correct triplets, in percent of all triplets; null if there are no triplets.
    pub(crate) every_anchor_percent: Option<f64>,
    /// Time of the fine-tuning.
    pub(crate) seconds: f64,
}

impl From<accuracy::Tally> for Tally {
    fn from(tally: accuracy::Tally) -> Self {
        Self {
            correct: tally.correct,
            triplets: tally.triplets,
            percent: tally.percent(),
        }
    }
}

impl From<Option<accuracy::Summary>> for Spread {
    fn from(summary: Option<accuracy::Summary>) -> Self {
        Self {
            mean_percent: summary.map(|summary| summary.mean),
            deviation_percent: summary.and_then(|summary| summary.deviation),
        }
    }
}

impl From<&Figures> for BenchTrain {
    fn from(figures: &Figures) -> Self {
        Self {
            network: figures.network,
            recipe: figures.recipe,
            weights: figures.weights,
            triplets_per_step: figures.triplets_per_step,
            seconds_per_step: figures.step_seconds,
            seconds_per_epoch: figures.epoch_seconds,
            peak_memory_bytes: figures.peak_memory,
        }
    }
}
