//! `campaign.json`, and the description of each checkpoint: everything that is in no table.

use crate::{CAMPAIGN, CHECKPOINTS, ExportError, SPEC, digests};
use murmuration_link::{InputKind, read_text};
use murmuration_model::{CampaignState, ExportedCampaign};
use murmuration_proto::{CampaignSpec, CheckpointDigest, v1};
use murmuration_store::CheckpointRecord;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

/// Version of the format of the whole folder.
pub(crate) const FORMAT: u32 = 1;

/// What is in no table of a campaign.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Description {
    /// Version of the format of the folder.
    pub(crate) format: u32,
    /// The version of Murmuration that wrote it.
    pub(crate) murmuration: String,
    campaign: String,
    state: String,
    error: String,
    created_ms: u64,
    weight: u32,
    simulator_version: String,
    rollbacks: u64,
    rounds_done: u32,
    last_label_cutoff: u64,
    label_cutoff: Option<u64>,
    checkpoint: Option<String>,
    next_checkpoint: Option<String>,
    generations: u32,
    /// Individuals of the archive.
    pub(crate) individuals: u64,
    label_entries: u64,
    /// The digest of the archive, as `murmuration digest` prints it.
    pub(crate) digest: String,
    /// The digest of the classes that stand.
    pub(crate) label_digest: String,
    /// Sum of the distances of all individuals to their medoids; of a completed campaign.
    pub(crate) loss: Option<f64>,
    /// The checkpoints, parents first.
    pub(crate) checkpoints: Vec<String>,
}

impl Description {
    /// Of a campaign that was exported whole.
    pub(crate) fn of(
        campaign: &ExportedCampaign,
        digest: String,
        label_digest: String,
        loss: Option<f64>,
        checkpoints: &[CheckpointRecord],
    ) -> Self {
        let message = v1::ExportedCampaign::from(campaign.clone());
        let named = |digest: String| Some(digest).filter(|digest| !digest.is_empty());
        Self {
            format: FORMAT,
            murmuration: env!("CARGO_PKG_VERSION").to_owned(),
            campaign: message.id,
            state: campaign.record.state.name().to_owned(),
            error: message.error,
            created_ms: message.created_ms,
            weight: message.weight,
            simulator_version: message.simulator_version,
            rollbacks: message.rollbacks,
            rounds_done: message.rounds_done,
            last_label_cutoff: message.last_label_cutoff,
            label_cutoff: message.label_cutoff,
            checkpoint: named(message.checkpoint),
            next_checkpoint: named(message.next_checkpoint),
            generations: message.generations,
            individuals: campaign.record.individuals(),
            label_entries: message.label_entries,
            digest,
            label_digest,
            loss,
            checkpoints: checkpoints
                .iter()
                .map(|record| record.digest.to_string())
                .collect(),
        }
    }

    /// Reads that of a folder.
    pub(crate) fn read(folder: &Path) -> Result<Self, ExportError> {
        let path = folder.join(CAMPAIGN);
        let description: Self = from_json(&path)?;
        match description.format {
            FORMAT => Ok(description),
            other => {
                let reason = format!("the export has format {other}, this murmuration reads {FORMAT}");
                Err(ExportError::damaged(&path, reason))
            }
        }
    }

    /// The campaign, with the specification of the folder.
    pub(crate) fn campaign(&self, folder: &Path) -> Result<v1::ExportedCampaign, ExportError> {
        let path = folder.join(SPEC);
        digests::open(&path)?;
        let text = read_text(&path, InputKind::Campaign).map_err(ExportError::file("read", &path))?;
        let spec = CampaignSpec::from_toml(&text).map_err(|error| ExportError::damaged(&path, error))?;
        let state = CampaignState::from_name(&self.state);
        let state = state.ok_or_else(|| {
            let reason = format!("state {:?} is none of a campaign", self.state);
            ExportError::damaged(&folder.join(CAMPAIGN), reason)
        })?;
        Ok(v1::ExportedCampaign {
            id: self.campaign.clone(),
            spec: Some((&spec).into()),
            state: v1::CampaignState::from(state).into(),
            error: self.error.clone(),
            created_ms: self.created_ms,
            weight: self.weight,
            simulator_version: self.simulator_version.clone(),
            rollbacks: self.rollbacks,
            rounds_done: self.rounds_done,
            last_label_cutoff: self.last_label_cutoff,
            label_cutoff: self.label_cutoff,
            checkpoint: self.checkpoint.clone().unwrap_or_default(),
            next_checkpoint: self.next_checkpoint.clone().unwrap_or_default(),
            generations: self.generations,
            label_entries: self.label_entries,
            digest: self.digest.clone(),
        })
    }
}

/// A checkpoint without its bytes.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckpointDescription {
    checkpoint: String,
    size: u64,
    parent: Option<String>,
    data_digest: String,
    label_digest: String,
    configuration: String,
    metrics: BTreeMap<String, f64>,
    created_ms: u64,
    /// The first eight bytes of the digest of each picture whose class it was told, hexadecimal.
    labelled: Vec<String>,
}

/// The name of the file with a checkpoint's bytes.
pub(crate) fn onnx(digest: CheckpointDigest) -> String {
    onnx_of(&digest.to_string())
}

/// The same of the digest as a text.
pub(crate) fn onnx_of(digest: &str) -> String {
    format!("{CHECKPOINTS}/{digest}.onnx")
}

/// The name of the file with a checkpoint's description.
pub(crate) fn lineage(digest: CheckpointDigest) -> String {
    lineage_of(&digest.to_string())
}

/// The same of the digest as a text.
pub(crate) fn lineage_of(digest: &str) -> String {
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

/// The description of a checkpoint of a folder, as a message.
pub(crate) fn read_checkpoint(
    folder: &Path,
    digest: CheckpointDigest,
) -> Result<v1::Checkpoint, ExportError> {
    let path: PathBuf = folder.join(lineage(digest));
    let described: CheckpointDescription = from_json(&path)?;
    if described.checkpoint != digest.to_string() {
        return Err(ExportError::damaged(&path, "it describes another checkpoint"));
    }
    let mut labelled = Vec::new();
    for picture in &described.labelled {
        let number = u64::from_str_radix(picture, 16)
            .ok()
            .filter(|_| picture.len() == 16);
        let number =
            number.ok_or_else(|| ExportError::damaged(&path, "labelled: not 16 hexadecimal digits each"))?;
        labelled.extend(number.to_be_bytes());
    }
    Ok(v1::Checkpoint {
        digest: described.checkpoint,
        size: described.size,
        parent: described.parent.unwrap_or_default(),
        data_digest: described.data_digest,
        label_digest: described.label_digest,
        configuration: described.configuration,
        metrics: described.metrics.into_iter().collect(),
        created_ms: described.created_ms,
        labelled,
    })
}

/// A document as a text of several lines.
pub(crate) fn to_json(document: &impl Serialize) -> String {
    // No document has a key that is no string, and nothing else can fail.
    serde_json::to_string_pretty(document).unwrap_or_default() + "\n"
}

fn from_json<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<T, ExportError> {
    digests::open(path)?;
    let text = read_text(path, InputKind::Manifest).map_err(ExportError::file("read", path))?;
    serde_json::from_str(&text).map_err(|error| ExportError::damaged(path, error))
}

/// The bytes of a file of a folder, no more than a checkpoint can have.
pub(crate) fn read_onnx(folder: &Path, digest: CheckpointDigest) -> Result<Vec<u8>, ExportError> {
    let path = folder.join(onnx(digest));
    digests::open(&path)?;
    let limit = InputKind::Checkpoint.max_bytes();
    let size = fs::metadata(&path)
        .map_err(ExportError::file("read", &path))?
        .len();
    if size > limit {
        return Err(ExportError::damaged(
            &path,
            format!("it has {size} bytes, a checkpoint has {limit} at most"),
        ));
    }
    fs::read(&path).map_err(ExportError::file("read", &path))
}
