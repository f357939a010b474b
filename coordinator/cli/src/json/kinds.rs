//! Every kind of document, for `murmuration schema`.

use super::{
    AddedLabels, Agreement, Backup, Certificates, Deletion, Digest, Doctor, Document, Evaluated, Export,
    ExportedController, Figure, FilterScore, LiftedQuarantine, Link, Quarantine, Recognised, Report, Robots,
    Run, Simulated, Taxonomy, Token, schema_of,
};
use murmuration_proto::v1;
use schemars::{JsonSchema, Schema};

/// A kind of document that commands print with `--json`.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    pub name: &'static str,
    /// Subject of the document, and the commands that print it.
    pub help: &'static str,
    /// The JSON Schema of the documents of this kind.
    pub schema: fn() -> Schema,
}

impl Kind {
    pub const fn of<T: JsonSchema>(name: &'static str, help: &'static str) -> Self {
        Self {
            name,
            help,
            schema: schema_of::<T>,
        }
    }
}

/// The kinds of documents that the client's commands print.
pub const KINDS: [Kind; 29] = [
    Kind::of::<Document<'_, v1::Campaign>>(
        "campaign",
        "A campaign and its progress: list, show, watch, submit, pause, cancel, import",
    ),
    Kind::of::<Deletion<'_>>("deletion", "What was deleted, or would be: delete"),
    Kind::of::<Document<'_, v1::Individual>>("individual", "An individual of an archive: show --index"),
    Kind::of::<Simulated>("simulated", "A controller and its behaviour: simulate"),
    Kind::of::<Taxonomy<'_>>("taxonomy", "The clusters of a campaign: show --taxonomy"),
    Kind::of::<Run>("run", "The end of a campaign: run, resume, adopt, refine, extend"),
    Kind::of::<Digest<'_>>("digest", "The digest of an archive: digest"),
    Kind::of::<Report>("report", "Where a report was written: report"),
    Kind::of::<Figure>("figure", "A figure for a paper: figure"),
    Kind::of::<Export>("export", "What was exported: export"),
    Kind::of::<Document<'_, v1::Checkpoint>>("checkpoint", "A checkpoint: checkpoints list, show, import"),
    Kind::of::<AddedLabels>("added-labels", "What was added: label"),
    Kind::of::<Document<'_, v1::Label>>("label", "An answer: labels"),
    Kind::of::<Document<'_, v1::LabelClass>>("class", "A class: classes"),
    Kind::of::<Agreement<'_>>("agreement", "How far two annotators agree: agreement"),
    Kind::of::<FilterScore>("filter-score", "The score of a controller: filter"),
    Kind::of::<Recognised<'_>>("recognised", "A swarm that a camera tracked: recognise"),
    Kind::of::<Evaluated>("evaluated", "The result of evaluating a controller: evaluate"),
    Kind::of::<Robots>("robots", "The robots of a swarm: robot"),
    Kind::of::<ExportedController>(
        "exported-controller",
        "A controller for other programs: controller export",
    ),
    Kind::of::<Backup>("backup", "A backup: backup, restore"),
    Kind::of::<Doctor>("doctor", "The condition of a data directory: doctor"),
    Kind::of::<Quarantine>("quarantine", "The machines in quarantine: quarantine"),
    Kind::of::<LiftedQuarantine>(
        "lifted-quarantine",
        "The machine that left quarantine: quarantine --lift",
    ),
    Kind::of::<Document<'_, v1::Node>>("node", "A connected worker or trainer: nodes"),
    Kind::of::<Document<'_, v1::Demand>>(
        "demand",
        "How many workers the open work could use: nodes --wanted",
    ),
    Kind::of::<Link>("link", "A link to the pages of a coordinator: link"),
    Kind::of::<Token>("token", "A new token: token"),
    Kind::of::<Certificates>("certificates", "New certificates: certs"),
];
