//! What is measured: embeddings, the judge, the filter, this machine.

use murmuration_accuracy as accuracy;
use murmuration_trainer::bench::Figures;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// The labelled behaviours that something was measured by.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Set {
    /// The files.
    pub(in crate::cli) labels: Vec<String>,
    /// Behaviours with a class that a person gave.
    pub(in crate::cli) behaviours: u64,
    /// Rows by the synthetic annotator, which are not counted.
    pub(in crate::cli) synthetic_left_out: u64,
}

/// The accuracy of an embedding.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Accuracy {
    #[serde(flatten)]
    pub(in crate::cli) set: Set,
    /// `features`, or the digest of the checkpoint.
    pub(in crate::cli) embedding: String,
    /// Triplets whose anchor is of another class than `random`.
    pub(in crate::cli) anchor_not_random: Tally,
    /// All triplets.
    pub(in crate::cli) every_anchor: Tally,
    /// Triplets by the class of their anchor.
    pub(in crate::cli) by_class_of_anchor: BTreeMap<String, Tally>,
}

/// The accuracy of untrained networks.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct UntrainedAccuracy {
    #[serde(flatten)]
    pub(in crate::cli) set: Set,
    /// `untrained`.
    pub(in crate::cli) embedding: String,
    /// Name of the network.
    pub(in crate::cli) network: String,
    /// Number of networks.
    pub(in crate::cli) networks: u32,
    /// Triplets whose anchor is of another class than `random`.
    pub(in crate::cli) anchor_not_random: Spread,
    /// All triplets.
    pub(in crate::cli) every_anchor: Spread,
}

/// Triplets, and how many of them are correct.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(in crate::cli) struct Tally {
    /// Those whose anchor is nearer to the positive than to the negative.
    correct: u64,
    /// All of them.
    triplets: u64,
    /// The share of correct triplets; null if there are no triplets.
    percent: Option<f64>,
}

/// The accuracy of several networks.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(in crate::cli) struct Spread {
    /// Mean; null if there are no triplets.
    mean_percent: Option<f64>,
    /// Sample standard deviation; null with fewer than two networks.
    deviation_percent: Option<f64>,
}

/// The agreement of the rule-based judge with people.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Judge {
    #[serde(flatten)]
    pub(in crate::cli) set: Set,
    /// Behaviours that have the same class from the judge.
    pub(in crate::cli) agreed: u64,
    /// Cohen's kappa, -1 to 1; null if agreement by chance is certain.
    pub(in crate::cli) kappa: Option<f64>,
    /// By the class that people gave: how many behaviours have which class from the judge.
    pub(in crate::cli) judged_by_class: BTreeMap<String, BTreeMap<String, u64>>,
    /// The patterns among behaviours of no class, by name.
    pub(in crate::cli) patterns: BTreeMap<String, PatternCounts>,
    /// By class: number of behaviours in whose world it has no meaning, so that the judge cannot answer with it.
    pub(in crate::cli) without_meaning: BTreeMap<String, u64>,
}

/// How often a pattern was seen.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(in crate::cli) struct PatternCounts {
    /// By people.
    pub(in crate::cli) given: u64,
    /// By people and the judge.
    pub(in crate::cli) agreed: u64,
    /// By the judge.
    pub(in crate::cli) judged: u64,
}

/// The score of a controller.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct FilterScore {
    /// 4 wheel speeds, or 8 wheel speeds and an angle in radians.
    pub(in crate::cli) controller: Vec<f64>,
    /// The metrics, by name.
    pub(in crate::cli) metrics: BTreeMap<String, f64>,
    /// Sum of the metrics' contributions.
    pub(in crate::cli) score: f64,
    /// Controllers with a lower score are discarded.
    pub(in crate::cli) cutoff: f64,
    /// Whether the controller is kept.
    pub(in crate::cli) passes: bool,
}

/// A speed of this machine beside that of a peer.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct BenchAll {
    /// What was measured.
    pub(in crate::cli) item: String,
    /// The unit of `ours` and `peer`.
    pub(in crate::cli) unit: &'static str,
    /// The speed of Murmuration.
    pub(in crate::cli) ours: f64,
    /// The speed of the peer in the same run; null if there is no peer, or it is not installed.
    pub(in crate::cli) peer: Option<f64>,
    /// Name of the peer; null if there is none.
    pub(in crate::cli) peer_name: Option<&'static str>,
    /// `ours` divided by `peer`; null without `peer`.
    pub(in crate::cli) ratio: Option<f64>,
    /// The least that one result takes, as docs/performance.md counts it by hand.
    pub(in crate::cli) floor: u64,
    /// What the floor counts.
    pub(in crate::cli) floor_unit: &'static str,
    /// Where it was measured.
    pub(in crate::cli) machine: Machine,
}

/// A machine that measures.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
#[schemars(inline)]
pub(in crate::cli) struct Machine {
    /// Name of the CPU; null if the system does not say.
    pub(in crate::cli) cpu: Option<String>,
    /// Threads that run at once.
    pub(in crate::cli) cores: usize,
    /// Bits of the vectors that the simulator computes with; 64 without vectors.
    pub(in crate::cli) vector_bits: u32,
}

/// A speed of the simulator.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct BenchSimulate {
    /// Capability model.
    pub(in crate::cli) model: &'static str,
    /// What was done with each controller.
    pub(in crate::cli) what: &'static str,
    /// Evaluations a second on one core.
    pub(in crate::cli) evaluations_per_second_per_core: f64,
    /// The speed divided by that without SIMD.
    pub(in crate::cli) ratio_to_scalar: f64,
}

/// A speed of a cluster in one process.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct BenchCluster {
    /// What was measured.
    pub(in crate::cli) what: &'static str,
    /// Workers of one thread each.
    pub(in crate::cli) workers: u16,
    /// Evaluations of a round.
    pub(in crate::cli) results: u64,
    /// Evaluations on disk a second, in the best round.
    pub(in crate::cli) results_per_second: f64,
    /// CPU time of an evaluation, in the best round: of coordinator and workers, or of the coordinator alone for null
    /// evaluations.
    pub(in crate::cli) cpu_seconds_per_result: f64,
    /// Evaluations a second of a plain loop on as many threads; null for null evaluations.
    pub(in crate::cli) loop_results_per_second: Option<f64>,
    /// CPU time of an evaluation in the plain loop; null for null evaluations.
    pub(in crate::cli) loop_cpu_seconds_per_result: Option<f64>,
    /// The speed divided by that of the plain loop; null for null evaluations.
    pub(in crate::cli) ratio_to_loop: Option<f64>,
}

/// The time that a stage of a latent campaign takes.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct BenchPipeline {
    /// The stage: `dataset`, `pretrain`, `evolve` or `taxonomy`.
    pub(in crate::cli) stage: &'static str,
    /// How long it lasted.
    pub(in crate::cli) seconds: f64,
    /// CPU time of coordinator, workers and trainer meanwhile.
    pub(in crate::cli) cpu_seconds: f64,
    /// Its share of the campaign's time, 0 to 1.
    pub(in crate::cli) share: f64,
    /// Simulations of dataset and archive.
    pub(in crate::cli) simulations: u64,
    /// How long that many simulations take in a plain loop.
    pub(in crate::cli) loop_seconds: f64,
}

/// A speed of training.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct BenchTrain {
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
    /// Most memory that the process has held so far; null if the system does not say.
    peak_memory_bytes: Option<u64>,
}

/// An accuracy after labels.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct BenchLabels {
    /// What was asked: `names` or `comparisons`.
    pub(in crate::cli) questions: &'static str,
    /// How the questions were chosen: by a query strategy, or, for comparisons, `unsure`.
    pub(in crate::cli) strategy: &'static str,
    /// Number of answers.
    pub(in crate::cli) labels: usize,
    /// Answers that say something: all names, and comparisons in which one behaviour was more alike.
    pub(in crate::cli) told: usize,
    /// Seed of dataset, embedder and fine-tuning.
    pub(in crate::cli) seed: u64,
    /// Correct triplets whose anchor is of another class than `random`; null if there are no such triplets.
    pub(in crate::cli) anchor_not_random_percent: Option<f64>,
    /// Correct triplets; null if there are no triplets.
    pub(in crate::cli) every_anchor_percent: Option<f64>,
    /// Time of the fine-tuning.
    pub(in crate::cli) seconds: f64,
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
