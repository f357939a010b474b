//! Rows of campaigns.

use super::{Store, StoreError};
use crate::campaign::{CampaignId, CampaignState};
use murmuration_proto::{CampaignSpec, SIMULATOR_VERSION};
use rusqlite::{Connection, OptionalExtension as _, Row, params};

/// A campaign as it is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignRecord {
    /// Its id.
    pub id: CampaignId,
    /// What it was asked to do.
    pub spec: CampaignSpec,
    /// Where it stands.
    pub state: CampaignState,
    /// Why it failed; empty unless it did.
    pub error: String,
    /// When it was created, milliseconds since 1970-01-01 UTC.
    pub created_ms: u64,
    /// Version of the simulator that its evaluations come from.
    pub simulator_version: String,
    /// Complete generations on disk.
    pub generations_done: u32,
    /// Best and mean novelty of the last complete generation.
    pub last_novelty: Option<(f64, f64)>,
}

const SELECT: &str = "
    SELECT c.id, c.spec, c.state, c.error, c.created_ms, c.simulator_version,
           (SELECT count(*) FROM generations g WHERE g.campaign = c.number), l.best_novelty, l.mean_novelty
    FROM campaigns c LEFT JOIN generations l ON l.campaign = c.number
        AND l.generation = (SELECT max(generation) FROM generations g WHERE g.campaign = c.number)";

impl Store {
    /// Stores a new, running campaign and names it `NAME-N`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create_campaign(&self, spec: &CampaignSpec, created_ms: u64) -> Result<CampaignId, StoreError> {
        self.write(|transaction| {
            let number: i64 =
                transaction.query_row("SELECT coalesce(max(number), 0) + 1 FROM campaigns", [], |row| {
                    row.get(0)
                })?;
            let id = format!("{}-{number}", spec.name().as_str());
            transaction.execute(
                "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
                 VALUES (?1, ?2, ?3, ?4, ?5, '', ?6)",
                params![
                    number,
                    id,
                    spec.to_toml(),
                    SIMULATOR_VERSION,
                    CampaignState::Running.name(),
                    created_ms as i64
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
    })
}

impl TryFrom<Columns> for CampaignRecord {
    type Error = StoreError;

    fn try_from(columns: Columns) -> Result<Self, StoreError> {
        let damaged = |what: String| StoreError::damaged(format!("campaign {}: {what}", columns.id));
        let spec = CampaignSpec::from_toml(&columns.spec).map_err(|error| damaged(error.to_string()))?;
        let state = CampaignState::from_name(&columns.state)
            .ok_or_else(|| damaged(format!("state {:?}", columns.state)))?;
        Ok(Self {
            id: CampaignId::from_store(columns.id),
            spec,
            state,
            error: columns.error,
            created_ms: columns.created_ms.unsigned_abs(),
            simulator_version: columns.simulator_version,
            generations_done: columns.generations_done,
            last_novelty: columns.best_novelty.zip(columns.mean_novelty),
        })
    }
}
