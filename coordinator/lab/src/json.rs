//! The JSON that commands of the lab print for programs, and the schema of each kind of document.

mod measures;
mod study;

pub(crate) use measures::{
    Accuracy, Agreement, Atlas, BenchAll, BenchCluster, BenchLabels, BenchPipeline, BenchSimulate,
    BenchTrain, Judge, Machine, PatternCounts, Set, UntrainedAccuracy,
};
pub(crate) use murmuration_cli::json::{Whole, print, print_all};
pub(crate) use study::{ListedStudy, Study};

use murmuration_cli::json::Kind;

/// The kinds of documents that commands of the lab print with `--json`.
pub const KINDS: [Kind; 12] = [
    Kind::of::<Study>("study", "A study and its tables: lab study run, show, report"),
    Kind::of::<ListedStudy>("listed-study", "A study and how far it is: lab study list"),
    Kind::of::<Atlas>("atlas", "Where an atlas was written: lab atlas"),
    Kind::of::<Accuracy>("accuracy", "The accuracy of an embedding: lab accuracy"),
    Kind::of::<UntrainedAccuracy>(
        "untrained-accuracy",
        "The accuracy of untrained networks: lab accuracy --untrained",
    ),
    Kind::of::<Judge>(
        "judge",
        "The agreement of the rule-based judge and the second judge with labels: lab judge",
    ),
    Kind::of::<BenchAll>(
        "bench-all",
        "A speed of this machine beside that of a peer: lab bench all",
    ),
    Kind::of::<BenchSimulate>("bench-simulate", "A speed of the simulator: lab bench simulate"),
    Kind::of::<BenchCluster>("bench-cluster", "A speed of a cluster: lab bench cluster"),
    Kind::of::<BenchPipeline>(
        "bench-pipeline",
        "The time of a stage of a latent campaign: lab bench pipeline",
    ),
    Kind::of::<BenchTrain>("bench-train", "A speed of training: lab bench train"),
    Kind::of::<BenchLabels>("bench-labels", "An accuracy after labels: lab bench labels"),
];
