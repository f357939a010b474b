//! Copies the rows of a campaign from a checked database of its own into a store.
//!
//! Many short transactions copy the rows, and other writes happen between them. The campaign is hidden until the last
//! transaction.

use crate::{
    Store, StoreError,
    campaigns::{next_number, number_of},
    checkpoint_rows::checkpoint_number,
    hidden::{HIDDEN, hidden_id},
    numbers::clamped,
};
use murmuration_model::{CampaignId, ExportedCampaign};
use murmuration_swarm::CheckpointDigest;
use rusqlite::{Connection, OptionalExtension as _, Transaction, params, params_from_iter, types::Value};
use std::collections::BTreeMap;

/// The tables that are copied.
const TABLES: [&str; 6] = [
    "generations",
    "individual_chunks",
    "image_chunks",
    "embedding_chunks",
    "labels",
    "taxonomies",
];

/// Maximum difference between the number of an imported id and the store's next number: no store has so many campaigns.
const FAR: i64 = 1_000_000_000;

/// Approximate number of bytes of rows that one transaction copies.
const BYTES: usize = if cfg!(test) { 1 << 10 } else { 8 << 20 };

impl Store {
    /// Copies a campaign and its checkpoints from a database of its own; returns false if a campaign with the same id exists. The
    /// campaign is hidden until all its rows are copied.
    ///
    /// # Errors
    /// If the campaign cannot be read or written. The store then lacks the campaign, but can have some of its checkpoints.
    pub(super) fn take_over(&self, from: &Self, campaign: &ExportedCampaign) -> Result<bool, StoreError> {
        let Some(number) = self.reserve(&campaign.record.id)? else {
            return Ok(false);
        };
        let taken = from.read(|source| {
            let checkpoints = self.write(|target| take_checkpoints(source, target))?;
            let copied = Copied {
                source,
                target: self,
                campaign: number,
                checkpoints,
            };
            for table in TABLES {
                copied.table(table)?;
            }
            copied.show(campaign)
        });
        if !matches!(taken, Ok(true)) {
            self.remove_hidden_or_later(number);
        }
        taken
    }

    /// Adds a hidden row for a campaign that is being imported, and returns the row's number; `None` if a campaign with this id
    /// exists.
    fn reserve(&self, campaign: &CampaignId) -> Result<Option<i64>, StoreError> {
        self.write(|transaction| {
            if is_there(transaction, campaign)? {
                return Ok(None);
            }
            let number = new_number(transaction, campaign)?;
            transaction.execute(
                "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms)
                 VALUES (?1, ?2, '', '', ?3, '', 0)",
                params![number, hidden_id(number), HIDDEN],
            )?;
            Ok(Some(number))
        })
    }
}

fn is_there(transaction: &Transaction<'_>, campaign: &CampaignId) -> Result<bool, StoreError> {
    match number_of(transaction, campaign) {
        Ok(_) => Ok(true),
        Err(StoreError::NoCampaign(_)) => Ok(false),
        Err(error) => Err(error),
    }
}

/// The number of an imported campaign, which keeps its id. Ids of new campaigns end with their numbers, so the result is at least
/// the id's number. An implausibly large number in the id is ignored: the numbers after it could be too high for an export.
fn new_number(target: &Transaction<'_>, campaign: &CampaignId) -> Result<i64, StoreError> {
    let next = next_number(target)?;
    let named = campaign.number().and_then(|number| i64::try_from(number).ok());
    let near = named.filter(|named| *named < next.saturating_add(FAR));
    Ok(near.map_or(next, |named| named.max(next)))
}

/// Copies the checkpoints that the store lacks. Returns the new number of each checkpoint, by its old number.
fn take_checkpoints(source: &Connection, target: &Transaction<'_>) -> Result<BTreeMap<i64, i64>, StoreError> {
    let columns =
        "digest, size, parent, data_digest, label_digest, configuration, metrics, created_ms, labelled";
    let mut select = source.prepare(&format!(
        "SELECT number, {columns} FROM checkpoints ORDER BY number"
    ))?;
    let mut insert = target.prepare(&format!(
        "INSERT INTO checkpoints ({columns}) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (digest) DO NOTHING"
    ))?;
    let mut numbers = BTreeMap::new();
    let mut rows = select.query([])?;
    while let Some(row) = rows.next()? {
        let values = (1..=9).map(|column| row.get(column));
        let values: Vec<Value> = values.collect::<Result<_, _>>()?;
        insert.execute(params_from_iter(values))?;
        let digest: String = row.get(1)?;
        let number = "SELECT number FROM checkpoints WHERE digest = ?1";
        let number = target.query_row(number, [digest], |row| row.get(0)).optional()?;
        let number = number
            .ok_or_else(|| StoreError::damaged("a checkpoint that was just stored is missing".to_owned()))?;
        numbers.insert(row.get(0)?, number);
    }
    Ok(numbers)
}

/// Copies rows into another store, with that store's keys.
struct Copied<'a> {
    source: &'a Connection,
    target: &'a Store,
    campaign: i64,
    /// The new number of each checkpoint, by its old number.
    checkpoints: BTreeMap<i64, i64>,
}

impl Copied<'_> {
    /// Copies a table, some rows in each transaction.
    fn table(&self, table: &str) -> Result<(), StoreError> {
        let mut select = self.source.prepare(&format!("SELECT * FROM {table}"))?;
        let names: Vec<String> = select.column_names().map(str::to_owned).collect();
        let mut rows = select.query([])?;
        loop {
            let (mut batch, mut bytes) = (Vec::new(), 0);
            while bytes < BYTES {
                let Some(row) = rows.next()? else { break };
                let mut values = Vec::with_capacity(names.len());
                for (column, name) in names.iter().enumerate() {
                    values.push(self.renumbered(name, row.get(column)?));
                }
                bytes += values.iter().map(bytes_of).sum::<usize>();
                batch.push(values);
            }
            if batch.is_empty() {
                return Ok(());
            }
            self.target
                .write(|target| insert_rows(target, table, &names, &batch))?;
        }
    }

    /// Fills in the campaign's row, which makes the campaign visible; returns false if a campaign with the same id has appeared
    /// meanwhile.
    fn show(&self, campaign: &ExportedCampaign) -> Result<bool, StoreError> {
        let record = &campaign.record;
        self.target.write(|target| {
            if is_there(target, &record.id)? {
                return Ok(false);
            }
            let checkpoint = |digest: Option<CheckpointDigest>| {
                let number = digest.map(|digest| checkpoint_number(target, digest));
                number.transpose()
            };
            target.execute(
                "UPDATE campaigns SET id = ?2, spec = ?3, simulator_version = ?4, state = ?5, error = ?6, created_ms = ?7,
                    weight = ?8, rollbacks = ?9, checkpoint = ?10, next_checkpoint = ?11, rounds = ?12, label_cutoff = ?13,
                    last_label_cutoff = ?14, tags = ?15, note = ?16
                 WHERE number = ?1",
                params![
                    self.campaign,
                    record.id.as_str(),
                    record.spec.to_toml(),
                    record.simulator_version,
                    campaign.state_when_imported().name(),
                    record.error,
                    clamped(record.created_ms),
                    record.weight.get(),
                    clamped(record.rollbacks),
                    checkpoint(record.embedder.checkpoint())?,
                    checkpoint(record.embedder.next())?,
                    record.rounds.done,
                    record.rounds.current_cutoff.map(clamped),
                    clamped(record.rounds.last_cutoff),
                    record.notes.tags.to_string(),
                    record.notes.note.as_str(),
                ],
            )?;
            Ok(true)
        })
    }

    /// The value of a column, with the numbers of the campaign and its checkpoints replaced by the target store's numbers.
    fn renumbered(&self, column: &str, value: Value) -> Value {
        match (column, value) {
            ("campaign", Value::Integer(_)) => Value::Integer(self.campaign),
            ("checkpoint", Value::Integer(number)) => {
                let number = self.checkpoints.get(&number).copied();
                number.map_or(Value::Null, Value::Integer)
            }
            (_, other) => other,
        }
    }
}

fn insert_rows(
    target: &Transaction<'_>,
    table: &str,
    names: &[String],
    rows: &[Vec<Value>],
) -> Result<(), StoreError> {
    let places = vec!["?"; names.len()].join(", ");
    let insert = format!("INSERT INTO {table} ({}) VALUES ({places})", names.join(", "));
    let mut insert = target.prepare_cached(&insert)?;
    for row in rows {
        insert.execute(params_from_iter(row))?;
    }
    Ok(())
}

/// Approximate bytes of a value.
fn bytes_of(value: &Value) -> usize {
    match value {
        Value::Null | Value::Integer(_) | Value::Real(_) => 8,
        Value::Text(text) => text.len(),
        Value::Blob(bytes) => bytes.len(),
    }
}

#[cfg(test)]
mod tests;
