//! `campaign.json` and the description of each checkpoint: the facts that no table has.

use crate::CHECKPOINTS;
use murmuration_proto::v1;
use murmuration_store::{CheckpointRecord, transfer::ReceivedCampaign};
use murmuration_swarm::CheckpointDigest;
use serde::Serialize;
use std::collections::BTreeMap;

/// Version of the format of the whole folder.
pub(crate) const FORMAT: u32 = 1;

/// The facts about a campaign that no table has.
#[derive(Debug, Serialize)]
pub(crate) struct Description {
    /// Version of the format of the folder.
    pub(crate) format: u32,
    /// The version of Murmuration that wrote the folder.
    pub(crate) murmuration: String,
    campaign: String,
    state: String,
    error: String,
    created_ms: u64,
    tags: Vec<String>,
    note: String,
    weight: u32,
    simulator_version: String,
    rollbacks: u64,
    rounds_done: u32,
    last_label_cutoff: u64,
    label_cutoff: Option<u64>,
    checkpoint: Option<String>,
    next_checkpoint: Option<String>,
    generations: u32,
    /// Number of individuals of the archive.
    pub(crate) individuals: u64,
    label_entries: u64,
    /// The digest of the archive, as `murmuration digest` prints it.
    pub(crate) digest: String,
    /// The digest of the current classes.
    pub(crate) label_digest: String,
    /// Sum of the distances of all individuals to their medoids, if the campaign has completed.
    pub(crate) loss: Option<f64>,
    /// The checkpoints, parents first.
    pub(crate) checkpoints: Vec<String>,
}

impl Description {
    pub(crate) fn of(received: &ReceivedCampaign) -> Self {
        let campaign = received.campaign();
        let record = &campaign.record;
        let named = |digest: Option<CheckpointDigest>| digest.map(|digest| digest.to_string());
        Self {
            format: FORMAT,
            murmuration: env!("CARGO_PKG_VERSION").to_owned(),
            campaign: record.id.to_string(),
            state: record.state.name().to_owned(),
            error: record.error.clone(),
            created_ms: record.created_ms,
            tags: record.notes.tags.iter().map(ToString::to_string).collect(),
            note: record.notes.note.as_str().to_owned(),
            weight: record.weight.get(),
            simulator_version: record.simulator_version.clone(),
            rollbacks: record.rollbacks,
            rounds_done: record.rounds.done,
            last_label_cutoff: record.rounds.last_cutoff,
            label_cutoff: record.rounds.current_cutoff,
            checkpoint: named(record.embedder.checkpoint()),
            next_checkpoint: named(record.embedder.next()),
            generations: record.generations_done,
            individuals: record.individuals(),
            label_entries: campaign.label_entries,
            digest: campaign.digest.clone(),
            label_digest: received.labels().digest().to_string(),
            loss: received.taxonomy().map(|taxonomy| taxonomy.loss),
            checkpoints: received
                .checkpoints()
                .iter()
                .map(|record| record.digest.to_string())
                .collect(),
        }
    }
}

/// A checkpoint without its bytes.
#[derive(Debug, Serialize)]
struct CheckpointDescription {
    checkpoint: String,
    size: u64,
    parent: Option<String>,
    data_digest: String,
    label_digest: String,
    configuration: String,
    metrics: BTreeMap<String, f64>,
    created_ms: u64,
    /// The first eight bytes, hexadecimal, of the digest of each picture that the checkpoint learned with a class.
    labelled: Vec<String>,
}

/// The name of the file with a checkpoint's bytes.
pub(crate) fn onnx(digest: CheckpointDigest) -> String {
    format!("{CHECKPOINTS}/{digest}.onnx")
}

/// The name of the file with a checkpoint's description.
pub(crate) fn lineage(digest: CheckpointDigest) -> String {
    format!("{CHECKPOINTS}/{digest}.json")
}

/// The description of a checkpoint as a text.
pub(crate) fn checkpoint_to_json(record: &CheckpointRecord) -> String {
    let message = v1::Checkpoint::from(record.clone());
    let hexadecimal = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    to_json(&CheckpointDescription {
        checkpoint: message.digest,
        size: message.size,
        parent: Some(message.parent).filter(|parent| !parent.is_empty()),
        data_digest: message.data_digest,
        label_digest: message.label_digest,
        configuration: message.configuration,
        metrics: message.metrics.into_iter().collect(),
        created_ms: message.created_ms,
        labelled: message.labelled.chunks(8).map(hexadecimal).collect(),
    })
}

/// A document as a text of several lines.
pub(crate) fn to_json(document: &impl Serialize) -> String {
    // Writing JSON cannot fail here, because all keys of these documents are strings.
    serde_json::to_string_pretty(document).unwrap_or_default() + "\n"
}
