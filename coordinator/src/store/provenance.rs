//! Where results come from, and what befell a campaign: who did what, whom to mistrust, and notices.

use super::{Store, StoreError, archive::clamped, campaigns::number_of};
use crate::{campaign::CampaignId, dispatch::Quarantined, leases::Instance};
use rusqlite::{Connection, Transaction, params};
use std::{
    collections::BTreeMap,
    time::{SystemTime, UNIX_EPOCH},
};

/// Notices of a campaign that are told; older ones stay in the store.
const MOST_NOTICES: u32 = 50;

/// In the place of who alone did something, where two found the same.
const NOBODY: u64 = 0;

/// Where some results come from.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// For each, who alone says what came of it; `None` where two workers found the same. Empty if nobody knows.
    pub unaudited: Vec<Option<Instance>>,
    /// What somebody should know of it, in sentences.
    pub notices: Vec<String>,
}

/// Something unusual that befell a campaign, which went on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// When, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
    /// What, for people.
    pub text: String,
}

/// Work whose results are kept with who did it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Work {
    /// Pictures of a dataset.
    Picture,
    /// Individuals of an archive.
    Evaluation,
    /// Embeddings of an archive by the checkpoint that it moved to.
    Embedding,
}

impl Work {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture",
            Self::Evaluation => "evaluation",
            Self::Embedding => "embedding",
        }
    }
}

/// What of a campaign rests on the word of workers that were found wrong: places, in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Suspects {
    /// Of its dataset's pictures.
    pub pictures: Vec<u64>,
    /// Of its individuals, as they were evaluated.
    pub individuals: Vec<u64>,
    /// Of its individuals, as they were embedded with the checkpoint that the archive moved to.
    pub embeddings: Vec<u64>,
    /// Whose word it is.
    pub workers: Vec<Quarantined>,
}

impl Suspects {
    /// Whether nothing does.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How much does.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.pictures.len() + self.individuals.len() + self.embeddings.len()
    }

    fn of(&mut self, work: &str) -> Option<&mut Vec<u64>> {
        [
            (Work::Picture, &mut self.pictures),
            (Work::Evaluation, &mut self.individuals),
            (Work::Embedding, &mut self.embeddings),
        ]
        .into_iter()
        .find_map(|(known, places)| (known.name() == work).then_some(places))
    }
}

impl Store {
    /// Remembers workers that were found wrong; those that it knows already stay as they are.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn quarantine(&self, workers: &[Quarantined]) -> Result<(), StoreError> {
        self.write(|transaction| {
            let mut statement = transaction.prepare_cached(
                "INSERT OR IGNORE INTO quarantined (instance, name, time_ms) VALUES (?1, ?2, ?3)",
            )?;
            for Quarantined { instance, name } in workers {
                statement.execute(params![instance.0.cast_signed(), name, now_ms()])?;
            }
            Ok(())
        })
    }

    /// Workers that were found wrong, oldest first.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn quarantined(&self) -> Result<Vec<Quarantined>, StoreError> {
        self.read(quarantined)
    }

    /// What of a campaign rests on the word of workers that were found wrong.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn suspects(&self, campaign: &CampaignId) -> Result<Suspects, StoreError> {
        self.read(|connection| {
            let wrong: BTreeMap<u64, Quarantined> = quarantined(connection)?
                .into_iter()
                .map(|wrong| (wrong.instance.0, wrong))
                .collect();
            let mut suspects = Suspects::default();
            let mut whose = BTreeMap::new();
            if wrong.is_empty() {
                return Ok(suspects);
            }
            let number = number_of(connection, campaign)?;
            for (work, first, workers) in provenance(connection, number)? {
                let Some(places) = suspects.of(&work) else {
                    continue;
                };
                for (place, by) in (first..).zip(workers) {
                    if let Some(worker) = wrong.get(&by).filter(|_| by != NOBODY) {
                        places.push(place);
                        whose.insert(by, worker.clone());
                    }
                }
            }
            // A salvaged campaign may lack what its provenance tells of.
            let held = |table| {
                let count = format!("SELECT coalesce(max(place) + 1, 0) FROM {table} WHERE campaign = ?1");
                connection.query_row(&count, [number], |row| row.get::<_, i64>(0))
            };
            let (pictures, individuals) = (held("pictures")?, held("individuals")?);
            suspects.pictures.retain(|&place| clamped(place) < pictures);
            suspects.individuals.retain(|&place| clamped(place) < individuals);
            suspects.embeddings.retain(|&place| clamped(place) < individuals);
            suspects.workers = whose.into_values().collect();
            Ok(suspects)
        })
    }

    /// What these workers said was found by another as well: nothing rests on their word any more. With a notice, in one
    /// transaction.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn confirm(
        &self,
        campaign: &CampaignId,
        workers: &[Quarantined],
        notice: &str,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let confirmed = |by: &u64| workers.iter().any(|worker| worker.instance.0 == *by);
            for (work, first, workers) in provenance(transaction, number)? {
                let left: Vec<u8> = workers
                    .iter()
                    .flat_map(|by| if confirmed(by) { NOBODY } else { *by }.to_le_bytes())
                    .collect();
                transaction.execute(
                    "UPDATE provenance SET workers = ?4 WHERE campaign = ?1 AND work = ?2 AND place = ?3",
                    params![number, work, clamped(first), left],
                )?;
            }
            add_notices(transaction, number, &[notice.to_owned()])
        })
    }

    /// The latest notices of a campaign, at most 50, oldest first.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn notices(&self, campaign: &CampaignId) -> Result<Vec<Notice>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT time_ms, text FROM notices WHERE campaign = ?1 ORDER BY number DESC LIMIT ?2",
            )?;
            let rows = statement.query_map(params![number, MOST_NOTICES], |row| {
                Ok(Notice {
                    time_ms: row.get::<_, i64>(0)?.unsigned_abs(),
                    text: row.get(1)?,
                })
            })?;
            let mut notices = rows.collect::<Result<Vec<_>, _>>()?;
            notices.reverse();
            Ok(notices)
        })
    }
}

/// Who did each of a run of results: the work, the first place, and a number for each worker.
type Run = (String, u64, Vec<u64>);

fn provenance(connection: &Connection, campaign: i64) -> Result<Vec<Run>, StoreError> {
    let mut statement = connection.prepare_cached(
        "SELECT work, place, workers FROM provenance WHERE campaign = ?1 ORDER BY work, place",
    )?;
    let rows = statement.query_map([campaign], |row| {
        let workers: Vec<u8> = row.get(2)?;
        let workers = workers.as_chunks().0.iter().map(|by| u64::from_le_bytes(*by));
        Ok((
            row.get(0)?,
            row.get::<_, i64>(1)?.unsigned_abs(),
            workers.collect(),
        ))
    })?;
    Ok(rows.collect::<Result<_, _>>()?)
}

fn quarantined(connection: &Connection) -> Result<Vec<Quarantined>, StoreError> {
    let mut statement =
        connection.prepare_cached("SELECT instance, name FROM quarantined ORDER BY time_ms, instance")?;
    let rows = statement.query_map([], |row| {
        Ok(Quarantined {
            instance: Instance(row.get::<_, i64>(0)?.cast_unsigned()),
            name: row.get(1)?,
        })
    })?;
    Ok(rows.collect::<Result<_, _>>()?)
}

/// Notes where results come from, the first of them at a place of this kind of work.
pub(super) fn add_provenance(
    transaction: &Transaction<'_>,
    campaign: i64,
    (work, first): (Work, u64),
    Provenance { unaudited, notices }: &Provenance,
) -> Result<(), StoreError> {
    let number = |by: &Option<Instance>| by.map_or(NOBODY, |Instance(number)| number).to_le_bytes();
    let workers: Vec<u8> = unaudited.iter().flat_map(number).collect();
    if !workers.is_empty() {
        transaction.execute(
            "INSERT OR REPLACE INTO provenance (campaign, work, place, workers) VALUES (?1, ?2, ?3, ?4)",
            params![campaign, work.name(), clamped(first), workers],
        )?;
    }
    add_notices(transaction, campaign, notices)
}

pub(super) fn add_notices(
    transaction: &Transaction<'_>,
    campaign: i64,
    notices: &[String],
) -> Result<(), StoreError> {
    let mut statement =
        transaction.prepare_cached("INSERT INTO notices (campaign, time_ms, text) VALUES (?1, ?2, ?3)")?;
    for text in notices {
        statement.execute(params![campaign, now_ms(), text])?;
    }
    Ok(())
}

pub(super) fn now_ms() -> i64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_millis() as i64)
}

#[cfg(test)]
pub(super) mod tests;
