//! Rows of campaigns.

use super::{Store, StoreError};
use crate::checkpoint_rows::checkpoint_number;
use murmuration_model::{CampaignId, CampaignRecord, CampaignState, Weight};
use murmuration_proto::{CampaignSpec, CheckpointDigest, EmbedderSource, Invalid, SIMULATOR_VERSION, Text};
use rusqlite::{Connection, OptionalExtension as _, Row, params};

const SELECT: &str = "
    SELECT c.id, c.spec, c.state, c.error, c.created_ms, c.simulator_version,
           (SELECT coalesce(max(generation) + 1, 0) FROM generations g WHERE g.campaign = c.number), l.best_novelty, l.mean_novelty,
           (SELECT digest FROM checkpoints k WHERE k.number = c.checkpoint),
           (SELECT digest FROM checkpoints k WHERE k.number = c.next_checkpoint),
           (SELECT coalesce(max(place) + 1, 0) FROM pictures p WHERE p.campaign = c.number),
           (SELECT coalesce(max(place) + 1, 0) FROM embeddings e
            WHERE e.campaign = c.number AND e.checkpoint = c.next_checkpoint),
           c.rounds, c.lesson, c.weight, c.taken_back, c.learned,
           c.decisions
    FROM campaigns c LEFT JOIN generations l ON l.campaign = c.number
        AND l.generation = (SELECT max(generation) FROM generations g WHERE g.campaign = c.number)";

impl Store {
    /// Stores a new, running campaign and names it `NAME-N`. One that searches with a published checkpoint moves to that
    /// first.
    ///
    /// # Errors
    /// [`StoreError::NoCheckpoint`] if there is no such checkpoint, or if it cannot be written.
    pub fn create_campaign(
        &self,
        spec: &CampaignSpec,
        weight: Weight,
        created_ms: u64,
    ) -> Result<CampaignId, StoreError> {
        self.write(|transaction| {
            let number: i64 =
                transaction.query_row("SELECT coalesce(max(number), 0) + 1 FROM campaigns", [], |row| {
                    row.get(0)
                })?;
            let id = format!("{}-{number}", spec.name().as_str());
            let next_checkpoint = match spec.embedder() {
                Some(EmbedderSource::Published(digest)) => Some(checkpoint_number(transaction, *digest)?),
                Some(EmbedderSource::Trained { .. }) | None => None,
            };
            transaction.execute(
                "INSERT INTO campaigns
                    (number, id, spec, simulator_version, state, error, created_ms, next_checkpoint, weight)
                 VALUES (?1, ?2, ?3, ?4, ?5, '', ?6, ?7, ?8)",
                params![
                    number,
                    id,
                    spec.to_toml(),
                    SIMULATOR_VERSION,
                    CampaignState::Running.name(),
                    created_ms as i64,
                    next_checkpoint,
                    weight.get(),
                ],
            )?;
            Ok(CampaignId::from_store(id))
        })
    }

    /// The campaign of that id; `latest` is the newest.
    ///
    /// # Errors
    /// [`StoreError::NoCampaign`], or if it cannot be read.
    pub fn campaign(&self, id: &str) -> Result<CampaignRecord, StoreError> {
        self.read(|connection| {
            let found = match id {
                "latest" => {
                    connection.query_row(&format!("{SELECT} ORDER BY c.number DESC LIMIT 1"), [], columns)
                }
                id => connection.query_row(&format!("{SELECT} WHERE c.id = ?1"), [id], columns),
            };
            found
                .optional()?
                .ok_or_else(|| StoreError::NoCampaign(id.to_owned()))?
                .try_into()
        })
    }

    /// Every campaign, oldest first.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn campaigns(&self) -> Result<Vec<CampaignRecord>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare(&format!("{SELECT} ORDER BY c.number"))?;
            let rows = statement.query_map([], columns)?;
            rows.map(|row| row?.try_into()).collect()
        })
    }

    /// Moves a campaign to `state`, with why it failed if it did.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn set_state(&self, id: &CampaignId, state: CampaignState, error: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, id)?;
            transaction.execute(
                "UPDATE campaigns SET state = ?2, error = ?3 WHERE number = ?1",
                params![number, state.name(), error],
            )?;
            Ok(())
        })
    }
}

/// The key of a campaign's rows.
pub(super) fn number_of(connection: &Connection, id: &CampaignId) -> Result<i64, StoreError> {
    connection
        .query_row(
            "SELECT number FROM campaigns WHERE id = ?1",
            [id.as_str()],
            |row| row.get(0),
        )
        .optional()?
        .ok_or_else(|| StoreError::NoCampaign(id.as_str().to_owned()))
}

struct Columns {
    id: String,
    spec: String,
    state: String,
    error: String,
    created_ms: i64,
    simulator_version: String,
    generations_done: u32,
    best_novelty: Option<f64>,
    mean_novelty: Option<f64>,
    checkpoint: Option<String>,
    next_checkpoint: Option<String>,
    pictures_done: i64,
    embedded: i64,
    rounds_done: u32,
    lesson: Option<i64>,
    weight: u32,
    taken_back: i64,
    learned: Option<i64>,
    decisions: i64,
}

fn columns(row: &Row<'_>) -> rusqlite::Result<Columns> {
    Ok(Columns {
        id: row.get(0)?,
        spec: row.get(1)?,
        state: row.get(2)?,
        error: row.get(3)?,
        created_ms: row.get(4)?,
        simulator_version: row.get(5)?,
        generations_done: row.get(6)?,
        best_novelty: row.get(7)?,
        mean_novelty: row.get(8)?,
        checkpoint: row.get(9)?,
        next_checkpoint: row.get(10)?,
        pictures_done: row.get(11)?,
        embedded: row.get(12)?,
        rounds_done: row.get(13)?,
        lesson: row.get(14)?,
        weight: row.get(15)?,
        taken_back: row.get(16)?,
        learned: row.get(17)?,
        decisions: row.get(18)?,
    })
}

impl TryFrom<Columns> for CampaignRecord {
    type Error = StoreError;

    fn try_from(columns: Columns) -> Result<Self, StoreError> {
        let id = columns.id.clone();
        let damaged = |what: String| StoreError::damaged(format!("campaign {id}: {what}"));
        let checkpoint = digest(&columns.id, columns.checkpoint)?;
        let next_checkpoint = digest(&columns.id, columns.next_checkpoint)?;
        let spec = CampaignSpec::from_toml(&columns.spec).map_err(|error| damaged(error.to_string()))?;
        let state = CampaignState::from_name(&columns.state)
            .ok_or_else(|| damaged(format!("state {:?}", columns.state)))?;
        Ok(Self {
            id: CampaignId::from_store(columns.id),
            spec,
            weight: Weight::try_from(columns.weight).map_err(|error| damaged(error.to_string()))?,
            state,
            // Earlier versions stored the words of workers as they came.
            error: Text::line(&columns.error).into(),
            created_ms: columns.created_ms.unsigned_abs(),
            taken_back: columns.taken_back.unsigned_abs(),
            decisions: columns.decisions.unsigned_abs(),
            simulator_version: columns.simulator_version,
            generations_done: columns.generations_done,
            last_novelty: columns.best_novelty.zip(columns.mean_novelty),
            checkpoint,
            next_checkpoint,
            pictures_done: columns.pictures_done.unsigned_abs(),
            embedded: columns.embedded.unsigned_abs(),
            rounds_done: columns.rounds_done,
            lesson: columns.lesson.map(i64::unsigned_abs),
            learned: columns.learned.map(i64::unsigned_abs),
        })
    }
}

fn digest(campaign: &str, text: Option<String>) -> Result<Option<CheckpointDigest>, StoreError> {
    let digest = text.map(|text| text.parse()).transpose();
    digest.map_err(|error: Invalid| StoreError::damaged(format!("campaign {campaign}: {error}")))
}
