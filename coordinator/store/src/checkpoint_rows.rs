//! Rows of checkpoints: all data of a checkpoint except its bytes.

use super::{Store, StoreError};
use murmuration_proto::v1;
use murmuration_swarm::{CheckpointDigest, Invalid, Lineage};
use rusqlite::{Connection, OptionalExtension as _, Row, params};
use std::collections::BTreeMap;

#[derive(Debug, Clone, PartialEq)]
pub struct CheckpointRecord {
    /// BLAKE3 of the checkpoint's bytes.
    pub digest: CheckpointDigest,
    /// Number of the checkpoint's bytes.
    pub size: u64,
    /// Origin and metrics of the checkpoint.
    pub lineage: Lineage,
    /// When the checkpoint was stored, milliseconds since 1970-01-01 UTC.
    pub created_ms: u64,
}

#[cfg(test)]
impl CheckpointRecord {
    /// A checkpoint without parent, data or labels.
    pub(crate) fn of(bytes: &[u8]) -> Self {
        Self {
            digest: CheckpointDigest::of(bytes),
            size: bytes.len() as u64,
            lineage: Lineage::default(),
            created_ms: 0,
        }
    }
}

const SELECT: &str = "
    SELECT digest, size, parent, data_digest, label_digest, configuration, metrics, created_ms, labelled FROM checkpoints";

impl Store {
    /// Records a checkpoint whose bytes are stored. An existing record of the same digest stays unchanged.
    pub(crate) fn add_checkpoint(&self, record: &CheckpointRecord) -> Result<(), StoreError> {
        let message = record
            .lineage
            .describe(record.digest, record.size, record.created_ms);
        let metrics = serde_json::to_string(&record.lineage.metrics)
            .map_err(|error| StoreError::damaged(error.to_string()))?;
        self.write(|transaction| {
            transaction.execute(
                "INSERT INTO checkpoints
                    (digest, size, parent, data_digest, label_digest, configuration, metrics, created_ms, labelled)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9) ON CONFLICT (digest) DO NOTHING",
                params![
                    message.digest,
                    message.size as i64,
                    message.parent,
                    message.data_digest,
                    message.label_digest,
                    message.configuration,
                    metrics,
                    message.created_ms as i64,
                    message.labelled,
                ],
            )?;
            Ok(())
        })
    }

    /// The record of the checkpoint with this digest.
    ///
    /// # Errors
    /// [`StoreError::NoCheckpoint`], or if the record cannot be read.
    pub fn checkpoint(&self, digest: CheckpointDigest) -> Result<CheckpointRecord, StoreError> {
        let digest = digest.to_string();
        self.read(|connection| {
            let found = connection.query_row(&format!("{SELECT} WHERE digest = ?1"), [&digest], columns);
            found
                .optional()?
                .ok_or_else(|| StoreError::NoCheckpoint(digest.clone()))?
                .try_into()
        })
    }

    /// Every checkpoint, oldest first.
    pub fn checkpoints(&self) -> Result<Vec<CheckpointRecord>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare(&format!("{SELECT} ORDER BY number"))?;
            let rows = statement.query_map([], columns)?;
            rows.map(|row| row?.try_into()).collect()
        })
    }
}

/// The key of a checkpoint's rows.
pub(super) fn checkpoint_number(
    connection: &Connection,
    digest: CheckpointDigest,
) -> Result<i64, StoreError> {
    let digest = digest.to_string();
    connection
        .query_row(
            "SELECT number FROM checkpoints WHERE digest = ?1",
            [&digest],
            |row| row.get(0),
        )
        .optional()?
        .ok_or(StoreError::NoCheckpoint(digest))
}

struct Columns {
    message: v1::Checkpoint,
    metrics: String,
}

fn columns(row: &Row<'_>) -> rusqlite::Result<Columns> {
    Ok(Columns {
        message: v1::Checkpoint {
            digest: row.get(0)?,
            size: row.get::<_, i64>(1)?.unsigned_abs(),
            parent: row.get(2)?,
            data_digest: row.get(3)?,
            label_digest: row.get(4)?,
            configuration: row.get(5)?,
            created_ms: row.get::<_, i64>(7)?.unsigned_abs(),
            metrics: Default::default(),
            labelled: row.get(8)?,
        },
        metrics: row.get(6)?,
    })
}

impl TryFrom<Columns> for CheckpointRecord {
    type Error = StoreError;

    fn try_from(Columns { message, metrics }: Columns) -> Result<Self, StoreError> {
        let damaged = |what: String| StoreError::damaged(format!("checkpoint {}: {what}", message.digest));
        let invalid = |error: Invalid| damaged(error.to_string());
        let digest = message.digest.parse().map_err(invalid)?;
        let metrics: BTreeMap<String, f64> =
            serde_json::from_str(&metrics).map_err(|error| damaged(error.to_string()))?;
        let lineage = Lineage::try_from(message.clone()).map_err(invalid)?;
        Ok(Self {
            digest,
            size: message.size,
            created_ms: message.created_ms,
            lineage: Lineage { metrics, ..lineage },
        })
    }
}

impl From<CheckpointRecord> for v1::Checkpoint {
    fn from(record: CheckpointRecord) -> Self {
        record
            .lineage
            .describe(record.digest, record.size, record.created_ms)
    }
}
