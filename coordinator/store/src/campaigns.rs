//! Rows of campaigns.

use super::{Store, StoreError, UnknownCampaign};
use crate::{checkpoint_rows::checkpoint_number, hidden::HIDDEN, numbers::now_ms};
use murmuration_model::{
    ArchiveEmbedder, CampaignHead, CampaignId, CampaignNotes, CampaignRecord, CampaignState, NewCampaign,
    Rounds, Weight, labels::RequestId, study_name,
};
use murmuration_proto::SIMULATOR_VERSION;
use murmuration_swarm::{
    CampaignName, CampaignSpec, CheckpointDigest, EmbedderSource, Invalid, Text, text::nearest,
};
use rusqlite::{Connection, OptionalExtension as _, Params, Row, params};

/// A campaign that a request started.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Started {
    pub id: CampaignId,
    /// Whether this request started the campaign; false if an earlier copy of the request did.
    pub is_new: bool,
}

/// Query for the columns that [`record`] reads by their names.
const SELECT: &str = "
    SELECT c.id, c.spec, c.state, c.error, c.created_ms, c.simulator_version, c.weight, c.rollbacks, c.decisions, c.rounds,
           c.label_cutoff, c.last_label_cutoff, c.study, c.tags, c.note, c.ended_ms, l.best_novelty, l.mean_novelty,
           (SELECT coalesce(max(generation) + 1, 0) FROM generations g WHERE g.campaign = c.number) AS generations_done,
           (SELECT digest FROM checkpoints k WHERE k.number = c.checkpoint) AS checkpoint,
           (SELECT digest FROM checkpoints k WHERE k.number = c.next_checkpoint) AS next_checkpoint,
           (SELECT coalesce(max(place) + 1, 0) FROM pictures p WHERE p.campaign = c.number) AS pictures_done,
           coalesce((SELECT first + individuals FROM embedding_chunks e
            WHERE e.campaign = c.number AND e.checkpoint = c.next_checkpoint ORDER BY first DESC LIMIT 1), 0) AS embedded
    FROM campaigns c LEFT JOIN generations l ON l.campaign = c.number
        AND l.generation = (SELECT max(generation) FROM generations g WHERE g.campaign = c.number)";

/// Query for the columns of a [`CampaignHead`]. The opening of a campaign is the part of its specification before the first TOML
/// table.
const HEADS: &str = "
    SELECT id, study, tags, note, state, substr(spec, 1, instr(spec || char(10) || '[', char(10) || '[')) AS opening
    FROM campaigns WHERE state <> ?1 ORDER BY number";

impl Store {
    /// Stores a new, running campaign of no study.
    ///
    /// # Errors
    /// The errors of [`Store::start_campaign`].
    pub fn create_campaign(
        &self,
        spec: &CampaignSpec,
        weight: Weight,
        created_ms: u64,
    ) -> Result<CampaignId, StoreError> {
        let new = NewCampaign {
            weight,
            ..spec.clone().into()
        };
        Ok(self.start_campaign(&new, created_ms)?.id)
    }

    /// Stores a new, running campaign with the id `NAME-N`, or finds the campaign that an earlier copy of the request started. A
    /// campaign that searches with a published checkpoint first moves to that checkpoint.
    ///
    /// # Errors
    /// [`StoreError::OtherRequest`] if an earlier request with the same id asked for another campaign;
    /// [`StoreError::NoCheckpoint`] if the checkpoint is not stored; or if the campaign cannot be written.
    pub fn start_campaign(&self, new: &NewCampaign, created_ms: u64) -> Result<Started, StoreError> {
        let spec = &new.spec;
        let request = new.request.as_ref().map(ToString::to_string);
        self.write(|transaction| {
            if let Some(request) = &new.request
                && let Some(id) = started_by(transaction, request, new)?
            {
                return Ok(Started { id, is_new: false });
            }
            let number = next_number(transaction)?;
            let id = format!("{}-{number}", spec.name().as_str());
            let next_checkpoint = match spec.embedder() {
                Some(EmbedderSource::Published(digest)) => Some(checkpoint_number(transaction, *digest)?),
                Some(EmbedderSource::Trained { .. }) | None => None,
            };
            transaction.execute(
                "INSERT INTO campaigns
                    (number, id, spec, simulator_version, state, error, created_ms, next_checkpoint, weight, study, request)
                 VALUES (?1, ?2, ?3, ?4, ?5, '', ?6, ?7, ?8, ?9, ?10)",
                params![
                    number,
                    id,
                    spec.to_toml(),
                    SIMULATOR_VERSION,
                    CampaignState::Running.name(),
                    created_ms as i64,
                    next_checkpoint,
                    new.weight.get(),
                    new.study.as_ref().map_or("", CampaignName::as_str),
                    request,
                ],
            )?;
            Ok(Started {
                id: CampaignId::from_store(id),
                is_new: true,
            })
        })
    }

    /// The campaign with this id. The id `latest` means the newest campaign that belongs to no study.
    ///
    /// # Errors
    /// [`StoreError::NoCampaign`], or if the campaign cannot be read.
    pub fn campaign(&self, id: &str) -> Result<CampaignRecord, StoreError> {
        self.read(|connection| campaign(connection, id))
    }

    /// Every campaign, oldest first.
    pub fn campaigns(&self) -> Result<Vec<CampaignRecord>, StoreError> {
        self.read(|connection| records(connection, "TRUE ORDER BY c.number", []))
    }

    /// For every campaign, oldest first: the fields that a search in the list of campaigns uses.
    pub fn campaign_heads(&self) -> Result<Vec<CampaignHead>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare_cached(HEADS)?;
            let head = |row: &Row<'_>| -> Result<CampaignHead, StoreError> {
                let (study, state): (String, String) = (row.get("study")?, row.get("state")?);
                let known = CampaignState::from_name(&state);
                Ok(CampaignHead {
                    id: CampaignId::from_store(row.get("id")?),
                    study: study_name(study).map_err(|error| StoreError::damaged(error.to_string()))?,
                    notes: notes(row)?,
                    state: known.ok_or_else(|| StoreError::damaged(format!("state {state:?}")))?,
                    opening: row.get("opening")?,
                })
            };
            statement.query_and_then([HIDDEN], head)?.collect()
        })
    }

    /// The medoid of the largest cluster of a campaign's taxonomy; `None` without a taxonomy.
    pub fn first_medoid(&self, campaign: &CampaignId) -> Result<Option<u64>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let first = "SELECT substr(medoids, 1, 8) FROM taxonomies WHERE campaign = ?1 AND stands";
            let first: Option<[u8; 8]> = connection
                .query_row(first, [number], |row| row.get(0))
                .optional()?;
            Ok(first.map(u64::from_le_bytes))
        })
    }

    /// Sets the state of a campaign, with the reason if the campaign failed.
    pub fn set_state(&self, id: &CampaignId, state: CampaignState, error: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, id)?;
            transaction.execute(
                "UPDATE campaigns SET state = ?2, error = ?3, ended_ms = ?4 WHERE number = ?1",
                params![number, state.name(), error, ended_ms(state)],
            )?;
            Ok(())
        })
    }
}

/// The campaign that an earlier copy of the request started; an error if the earlier request asked for another campaign.
fn started_by(
    connection: &Connection,
    request: &RequestId,
    new: &NewCampaign,
) -> Result<Option<CampaignId>, StoreError> {
    let id = "SELECT id FROM campaigns WHERE request = ?1";
    let id: Option<String> = connection
        .query_row(id, [request.as_str()], |row| row.get(0))
        .optional()?;
    let Some(started) = id.map(|id| campaign(connection, &id)).transpose()? else {
        return Ok(None);
    };
    let is_same = started.spec.to_toml() == new.spec.to_toml()
        && started.weight == new.weight
        && started.study == new.study;
    match is_same {
        true => Ok(Some(started.id)),
        false => Err(StoreError::OtherRequest {
            request: request.clone(),
            campaign: started.id,
        }),
    }
}

/// End time of a campaign that enters this state now; `None` if the campaign is running.
pub(super) fn ended_ms(state: CampaignState) -> Option<i64> {
    (state != CampaignState::Running).then(now_ms)
}

/// The number of the next campaign: larger than the number of any existing or deleted campaign.
pub(super) fn next_number(connection: &Connection) -> Result<i64, StoreError> {
    let next = "SELECT coalesce(max(number), 0) + 1 FROM
        (SELECT max(number) AS number FROM campaigns UNION SELECT max(number) FROM deleted)";
    Ok(connection.query_row(next, [], |row| row.get(0))?)
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
        .ok_or_else(|| {
            StoreError::NoCampaign(UnknownCampaign {
                id: id.as_str().to_owned(),
                nearest: None,
            })
        })
}

/// The campaign with this id. The id `latest` means the newest campaign that belongs to no study.
pub(super) fn campaign(connection: &Connection, id: &str) -> Result<CampaignRecord, StoreError> {
    let found = match id {
        "latest" => records(connection, "c.study = '' ORDER BY c.number DESC LIMIT 1", []),
        id => records(connection, "c.id = ?1", [id]),
    };
    match found?.pop() {
        Some(record) => Ok(record),
        None => Err(StoreError::NoCampaign(unknown(connection, id)?)),
    }
}

/// Longest id, in bytes, for which a similar id is searched. Every campaign's id is shorter.
const LONGEST_ID: usize = 128;

fn unknown(connection: &Connection, id: &str) -> Result<UnknownCampaign, StoreError> {
    let mut known: Vec<String> = Vec::new();
    // `latest` is not a misspelt id.
    if id != "latest" && id.len() <= LONGEST_ID {
        let mut statement =
            connection.prepare("SELECT id FROM campaigns WHERE state <> ?1 ORDER BY number")?;
        let ids = statement.query_map([HIDDEN], |row| row.get(0))?;
        known = ids.collect::<Result<_, _>>()?;
    }
    let nearest = nearest(id, known.iter().map(String::as_str));
    Ok(UnknownCampaign {
        id: id.to_owned(),
        nearest: nearest.map(|id| CampaignId::from_store(id.to_owned())),
    })
}

/// The campaigns for which the SQL condition `which` holds, except hidden campaigns.
fn records(
    connection: &Connection,
    which: &str,
    parameters: impl Params,
) -> Result<Vec<CampaignRecord>, StoreError> {
    let mut statement = connection.prepare(&format!("{SELECT} WHERE c.state <> '{HIDDEN}' AND {which}"))?;
    statement.query_and_then(parameters, record)?.collect()
}

/// The tags and the note in the columns `tags` and `note` of a row.
pub(super) fn notes(row: &Row<'_>) -> Result<CampaignNotes, StoreError> {
    let damaged = |error: Invalid| StoreError::damaged(error.to_string());
    let (tags, note): (String, String) = (row.get("tags")?, row.get("note")?);
    Ok(CampaignNotes {
        tags: tags.parse().map_err(damaged)?,
        note: note.parse().map_err(damaged)?,
    })
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
        study: study_name(row.get("study")?).map_err(invalid)?,
        notes: notes(row)?,
        state: CampaignState::from_name(&state).ok_or_else(|| damaged(format!("state {state:?}")))?,
        // The error can contain text from another machine, so it is cleaned.
        error: Text::line(&row.get::<_, String>("error")?).into(),
        created_ms: count("created_ms")?,
        ended_ms: row.get::<_, Option<i64>>("ended_ms")?.map(i64::unsigned_abs),
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
