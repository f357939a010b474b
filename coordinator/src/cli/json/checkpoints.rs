//! Checkpoints.

use super::Time;
use murmuration_proto::v1;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// A checkpoint.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Checkpoint {
    /// Its digest.
    checkpoint: String,
    /// Bytes of its ONNX file.
    size: u64,
    /// Digest of the checkpoint that its training started from; empty if there was none.
    parent: String,
    /// Digest of the pictures that it was trained on; empty if there were none.
    data_digest: String,
    /// Digest of the labels that it was trained on; empty if there were none.
    label_digest: String,
    /// The configuration of its training, TOML.
    configuration: String,
    /// Figures measured on it, by name.
    metrics: BTreeMap<String, f64>,
    /// When it was stored.
    created: Time,
}

impl From<&v1::Checkpoint> for Checkpoint {
    fn from(checkpoint: &v1::Checkpoint) -> Self {
        let metrics = checkpoint.metrics.iter();
        Self {
            checkpoint: checkpoint.digest.clone(),
            size: checkpoint.size,
            parent: checkpoint.parent.clone(),
            data_digest: checkpoint.data_digest.clone(),
            label_digest: checkpoint.label_digest.clone(),
            configuration: checkpoint.configuration.clone(),
            metrics: metrics.map(|(name, &value)| (name.clone(), value)).collect(),
            created: Time::of_ms(checkpoint.created_ms),
        }
    }
}
