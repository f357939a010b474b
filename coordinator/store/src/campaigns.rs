//! Rows of campaigns.

use super::{Store, StoreError};
use crate::checkpoint_rows::checkpoint_number;
use murmuration_model::{ArchiveEmbedder, CampaignId, CampaignRecord, CampaignState, Rounds, Weight};
use murmuration_proto::{CampaignSpec, CheckpointDigest, EmbedderSource, Invalid, SIMULATOR_VERSION, Text};
use rusqlite::{Connection, OptionalExtension as _, Params, Row, params};

/// The columns that [`record`] maps, by name.
const SELECT: &str = "
    SELECT c.id, c.spec, c.state, c.error, c.created_ms, c.simulator_version, c.weight, c.rollbacks, c.decisions, c.rounds,
           c.label_cutoff, c.last_label_cutoff, l.best_novelty, l.mean_novelty,
           (SELECT coalesce(max(generation) + 1, 0) FROM generations g WHERE g.campaign = c.number) AS generations_done,
           (SELECT digest FROM checkpoints k WHERE k.number = c.checkpoint) AS checkpoint,
           (SELECT digest FROM checkpoints k WHERE k.number = c.next_checkpoint) AS next_checkpoint,
           (SELECT coalesce(max(place) + 1, 0) FROM pictures p WHERE p.campaign = c.number) AS pictures_done,
           (SELECT coalesce(max(place) + 1, 0) FROM embeddings e
            WHERE e.campaign = c.number AND e.checkpoint = c.next_checkpoint) AS embedded
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
                "latest" => records(connection, "ORDER BY c.number DESC LIMIT 1", []),
                id => records(connection, "WHERE c.id = ?1", [id]),
            };
            found?.pop().ok_or_else(|| StoreError::NoCampaign(id.to_owned()))
        })
    }

    /// Every campaign, oldest first.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn campaigns(&self) -> Result<Vec<CampaignRecord>, StoreError> {
        self.read(|connection| records(connection, "ORDER BY c.number", []))
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

fn records(
    connection: &Connection,
    which: &str,
    parameters: impl Params,
) -> Result<Vec<CampaignRecord>, StoreError> {
    let mut statement = connection.prepare(&format!("{SELECT} {which}"))?;
    statement.query_and_then(parameters, record)?.collect()
}

fn record(row: &Row<'_>) -> Result<CampaignRecord, StoreError> {
    let id: CampaignId = row
        .get::<_, String>("id")?
        .parse()
        .map_err(|error: Invalid| StoreError::damaged(error.to_string()))?;
    let damaged = |what: String| StoreError::damaged(format!("campaign {id}: {what}"));
    let invalid = |error: Invalid| damaged(error.to_string());
    let count = |column| row.get::<_, i64>(column).map(i64::unsigned_abs);
    let digest = |column| {
        let digest: Option<String> = row.get(column)?;
        let digest = digest.map(|digest| digest.parse::<CheckpointDigest>());
        digest.transpose().map_err(invalid)
    };
    let (spec, state): (String, String) = (row.get("spec")?, row.get("state")?);
    let (best, mean): (Option<f64>, Option<f64>) = (row.get("best_novelty")?, row.get("mean_novelty")?);
    Ok(CampaignRecord {
        spec: CampaignSpec::from_toml(&spec).map_err(|error| damaged(error.to_string()))?,
        weight: Weight::try_from(row.get::<_, u32>("weight")?).map_err(invalid)?,
        state: CampaignState::from_name(&state).ok_or_else(|| damaged(format!("state {state:?}")))?,
        // Earlier versions stored the words of workers as they came.
        error: Text::line(&row.get::<_, String>("error")?).into(),
        created_ms: count("created_ms")?,
        rollbacks: count("rollbacks")?,
        decisions: count("decisions")?,
        simulator_version: row.get("simulator_version")?,
        generations_done: row.get("generations_done")?,
        last_novelty: best.zip(mean),
        embedder: match (digest("checkpoint")?, digest("next_checkpoint")?) {
            (None, None) => ArchiveEmbedder::None,
            (Some(checkpoint), None) => ArchiveEmbedder::Checkpoint(checkpoint),
            (from, Some(to)) => ArchiveEmbedder::Switching {
                from,
                to,
                embedded: count("embedded")?,
            },
        },
        pictures_done: count("pictures_done")?,
        rounds: Rounds {
            done: row.get("rounds")?,
            last_cutoff: count("last_label_cutoff")?,
            current_cutoff: row.get::<_, Option<i64>>("label_cutoff")?.map(i64::unsigned_abs),
        },
        id,
    })
}
