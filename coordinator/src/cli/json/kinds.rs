//! Every kind of document, for `murmuration schema`.

use super::{
    Accuracy, AddedLabels, Agreement, Atlas, Backup, BenchAll, BenchCluster, BenchLabels, BenchPipeline,
    BenchSimulate, BenchTrain, Campaign, Certificates, Checkpoint, Class, Deletion, Digest, Doctor,
    Evaluated, Export, ExportedController, FilterScore, Individual, Judge, Label, LiftedQuarantine,
    ListedStudy, Quarantine, Recognised, Report, Robots, Run, Study, Taxonomy, Token, UntrainedAccuracy,
    schema_of,
};
use clap::ValueEnum;
use schemars::Schema;

/// A kind of document that commands print with `--json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(in crate::cli) enum Kind {
    /// A campaign and its progress: list, show, watch, submit, pause, cancel, import
    Campaign,
    /// What was deleted, or would be: delete
    Deletion,
    /// A controller and its behaviour: show --index, simulate
    Individual,
    /// The clusters of a campaign: show --taxonomy
    Taxonomy,
    /// The end of a campaign: run, resume, adopt, refine
    Run,
    /// The digest of an archive: digest
    Digest,
    /// Where a report was written: report
    Report,
    /// What was exported: export
    Export,
    /// A study and its tables: study run, show, report
    Study,
    /// A study and how far it is: study list
    ListedStudy,
    /// Where an atlas was written: atlas
    Atlas,
    /// A checkpoint: checkpoints list, show, import
    Checkpoint,
    /// What was added: label
    AddedLabels,
    /// An answer: labels
    Label,
    /// A class: classes
    Class,
    /// How far two annotators agree: agreement
    Agreement,
    /// The accuracy of an embedding: accuracy
    Accuracy,
    /// The accuracy of untrained networks: accuracy --untrained
    UntrainedAccuracy,
    /// The agreement of the rule-based judge with people: judge
    Judge,
    /// The score of a controller: filter
    FilterScore,
    /// A swarm that a camera tracked: recognise
    Recognised,
    /// What an evaluation of a controller came to: evaluate
    Evaluated,
    /// The robots of a swarm: robot
    Robots,
    /// A controller for other programs: controller export
    ExportedController,
    /// A backup: backup, restore
    Backup,
    /// The condition of a data directory: doctor
    Doctor,
    /// The machines in quarantine: quarantine
    Quarantine,
    /// The machine that left quarantine: quarantine --lift
    LiftedQuarantine,
    /// A new token: token
    Token,
    /// New certificates: certs
    Certificates,
    /// A speed of this machine beside that of a peer: bench all
    BenchAll,
    /// A speed of the simulator: bench simulate
    BenchSimulate,
    /// A speed of a cluster: bench cluster
    BenchCluster,
    /// The time of a stage of a latent campaign: bench pipeline
    BenchPipeline,
    /// A speed of training: bench train
    BenchTrain,
    /// An accuracy after labels: bench labels
    BenchLabels,
}

impl Kind {
    /// The JSON Schema of the documents of this kind.
    pub(in crate::cli) fn schema(self) -> Schema {
        match self {
            Self::Campaign => schema_of::<Campaign>(),
            Self::Deletion => schema_of::<Deletion>(),
            Self::Individual => schema_of::<Individual>(),
            Self::Taxonomy => schema_of::<Taxonomy>(),
            Self::Run => schema_of::<Run>(),
            Self::Digest => schema_of::<Digest>(),
            Self::Report => schema_of::<Report>(),
            Self::Export => schema_of::<Export>(),
            Self::Study => schema_of::<Study>(),
            Self::ListedStudy => schema_of::<ListedStudy>(),
            Self::Atlas => schema_of::<Atlas>(),
            Self::Checkpoint => schema_of::<Checkpoint>(),
            Self::AddedLabels => schema_of::<AddedLabels>(),
            Self::Label => schema_of::<Label>(),
            Self::Class => schema_of::<Class>(),
            Self::Agreement => schema_of::<Agreement>(),
            Self::Accuracy => schema_of::<Accuracy>(),
            Self::UntrainedAccuracy => schema_of::<UntrainedAccuracy>(),
            Self::Judge => schema_of::<Judge>(),
            Self::FilterScore => schema_of::<FilterScore>(),
            Self::Recognised => schema_of::<Recognised>(),
            Self::Evaluated => schema_of::<Evaluated>(),
            Self::Robots => schema_of::<Robots>(),
            Self::ExportedController => schema_of::<ExportedController>(),
            Self::Backup => schema_of::<Backup>(),
            Self::Doctor => schema_of::<Doctor>(),
            Self::Quarantine => schema_of::<Quarantine>(),
            Self::LiftedQuarantine => schema_of::<LiftedQuarantine>(),
            Self::Token => schema_of::<Token>(),
            Self::Certificates => schema_of::<Certificates>(),
            Self::BenchAll => schema_of::<BenchAll>(),
            Self::BenchSimulate => schema_of::<BenchSimulate>(),
            Self::BenchCluster => schema_of::<BenchCluster>(),
            Self::BenchPipeline => schema_of::<BenchPipeline>(),
            Self::BenchTrain => schema_of::<BenchTrain>(),
            Self::BenchLabels => schema_of::<BenchLabels>(),
        }
    }
}
