//! Provenance of results: which machine made each result, which machines are quarantined, and the notices of a campaign.

use super::{
    Store, StoreError,
    campaigns::number_of,
    chunks,
    numbers::{clamped, now_ms},
};
use murmuration_model::{CampaignId, MachineId, Maker, Quarantined};
use murmuration_swarm::{EmbeddingKind, Text};
use rusqlite::{Connection, Transaction, params};
use std::collections::BTreeMap;

/// Maximum number of notices of a campaign that are returned; older notices stay in the store.
const MOST_NOTICES: u32 = 50;

/// The number that is stored in place of a machine's number if two machines found the same result.
const NOBODY: u64 = 0;

/// Provenance of some results.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Maker of each result; empty if the makers are unknown.
    pub makers: Vec<Maker>,
    /// Notices about the results, as sentences.
    pub notices: Vec<String>,
}

/// An unusual event in a campaign that continued after the event.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// Number of the notice, larger than the numbers of all earlier notices.
    pub number: u64,
    /// Time of the event, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
    /// Description of the event, for people.
    pub text: String,
    /// Number of the campaign's complete generations at the time of the event.
    pub generations: u32,
}

/// Kinds of results that are stored with their makers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum ResultKind {
    /// Pictures of a dataset.
    Picture,
    /// Individuals of an archive.
    Evaluation,
    /// Embeddings of an archive by the checkpoint that it moved to.
    Embedding,
}

impl ResultKind {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture",
            Self::Evaluation => "evaluation",
            Self::Embedding => "embedding",
        }
    }
}

/// A result that only a quarantined machine has computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Suspect {
    pub place: u64,
    /// Embedding kind of the machine; unknown if the machine does not embed.
    pub kind: EmbeddingKind,
}

/// Results of a campaign that only quarantined machines have computed, in the order of places.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Suspects {
    /// Pictures of the campaign's dataset.
    pub pictures: Vec<Suspect>,
    /// Evaluations of the campaign's individuals.
    pub individuals: Vec<Suspect>,
    /// Embeddings of the campaign's individuals by the checkpoint that the archive moved to.
    pub embeddings: Vec<Suspect>,
    pub machines: Vec<Quarantined>,
}

impl Suspects {
    /// Whether no result is suspect.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of suspect results.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.pictures.len() + self.individuals.len() + self.embeddings.len()
    }

    fn of(&mut self, result: &str) -> Option<&mut Vec<Suspect>> {
        [
            (ResultKind::Picture, &mut self.pictures),
            (ResultKind::Evaluation, &mut self.individuals),
            (ResultKind::Embedding, &mut self.embeddings),
        ]
        .into_iter()
        .find_map(|(known, places)| (known.name() == result).then_some(places))
    }
}

impl Store {
    /// Quarantines machines whose results were found wrong. Machines that are already quarantined stay as they are.
    pub fn quarantine(&self, machines: &[Quarantined]) -> Result<(), StoreError> {
        self.write(|transaction| {
            let mut statement = transaction.prepare_cached(
                "INSERT OR IGNORE INTO quarantined (machine, name, time_ms) VALUES (?1, ?2, ?3)",
            )?;
            for Quarantined { machine, name } in machines {
                statement.execute(params![machine.0.cast_signed(), name, now_ms()])?;
            }
            Ok(())
        })
    }

    /// Machines whose results were found wrong, in the order of their quarantines. A machine whose quarantine was lifted stays in
    /// this list, under a number that no machine has: its earlier results stay suspect.
    pub fn quarantined(&self) -> Result<Vec<Quarantined>, StoreError> {
        self.read(|connection| quarantined(connection, ""))
    }

    /// Machines that are still quarantined, in the order of their quarantines.
    pub fn still_quarantined(&self) -> Result<Vec<Quarantined>, StoreError> {
        self.read(|connection| quarantined(connection, "WHERE lifted_ms IS NULL"))
    }

    /// Ends a machine's quarantine, but the machine's earlier results stay suspect. Returns false if the machine was not
    /// quarantined.
    pub fn lift_quarantine(&self, machine: MachineId) -> Result<bool, StoreError> {
        self.write(|transaction| {
            // The earlier results get an even number, which no machine has: the numbers of machines are odd.
            let random: i64 = transaction.query_row("SELECT random()", [], |row| row.get(0))?;
            let past = (random.cast_unsigned() & !1).max(2);
            let lifted = transaction.execute(
                "UPDATE quarantined SET machine = ?2, lifted_ms = ?3 WHERE machine = ?1 AND lifted_ms IS NULL",
                params![machine.0.cast_signed(), past.cast_signed(), now_ms()],
            )?;
            if lifted == 0 {
                return Ok(false);
            }
            let mut statement = transaction.prepare("SELECT DISTINCT campaign FROM provenance")?;
            let campaigns = statement.query_map([], |row| row.get(0))?;
            for campaign in campaigns.collect::<Result<Vec<i64>, _>>()? {
                replace(transaction, campaign, |by| if by == machine.0 { past } else { by })?;
            }
            Ok(true)
        })
    }

    /// Results of a campaign that only quarantined machines have computed.
    pub fn suspects(&self, campaign: &CampaignId) -> Result<Suspects, StoreError> {
        self.read(|connection| suspects(connection, number_of(connection, campaign)?))
    }

    /// Marks results of these machines as confirmed by another machine, and adds a notice, in one transaction.
    pub fn confirm(
        &self,
        campaign: &CampaignId,
        machines: &[Quarantined],
        notice: &str,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let confirmed = |by| machines.iter().any(|machine| machine.machine.0 == by);
            replace(transaction, number, |by| if confirmed(by) { NOBODY } else { by })?;
            add_notices(transaction, number, &[notice.to_owned()])
        })
    }

    /// The latest notices of a campaign, at most 50, oldest first.
    pub fn notices(&self, campaign: &CampaignId) -> Result<Vec<Notice>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT number, time_ms, text, generations FROM notices WHERE campaign = ?1 ORDER BY number DESC LIMIT ?2",
            )?;
            let rows = statement.query_map(params![number, MOST_NOTICES], |row| {
                Ok(Notice {
                    number: row.get::<_, i64>(0)?.unsigned_abs(),
                    time_ms: row.get::<_, i64>(1)?.unsigned_abs(),
                    text: Text::line(&row.get::<_, String>(2)?).into(),
                    generations: row.get(3)?,
                })
            })?;
            let mut notices = rows.collect::<Result<Vec<_>, _>>()?;
            notices.reverse();
            Ok(notices)
        })
    }
}

/// Results of a campaign that only quarantined machines have computed.
pub(super) fn suspects(connection: &Connection, number: i64) -> Result<Suspects, StoreError> {
    let wrong: BTreeMap<u64, Quarantined> = quarantined(connection, "")?
        .into_iter()
        .map(|wrong| (wrong.machine.0, wrong))
        .collect();
    let mut suspects = Suspects::default();
    let mut whose = BTreeMap::new();
    if wrong.is_empty() {
        return Ok(suspects);
    }
    for run in provenance(connection, number)? {
        let Some(places) = suspects.of(&run.result) else {
            continue;
        };
        let kinds = run.kinds.into_iter().map(EmbeddingKind::from);
        for ((place, by), kind) in (run.first..).zip(run.machines).zip(kinds) {
            if let Some(machine) = wrong.get(&by).filter(|_| by != NOBODY) {
                places.push(Suspect { place, kind });
                whose.insert(by, machine.clone());
            }
        }
    }
    // A rollback of generations does not delete the provenance of their embeddings, so suspects beyond the archive are removed
    // here.
    let individuals = chunks::archive_len(connection, number)?;
    suspects.embeddings.retain(|suspect| suspect.place < individuals);
    suspects.machines = whose.into_values().collect();
    Ok(suspects)
}

/// Consecutive results, with the machine that made each result.
struct Run {
    result: String,
    first: u64,
    machines: Vec<u64>,
    kinds: Vec<u64>,
}

fn provenance(connection: &Connection, campaign: i64) -> Result<Vec<Run>, StoreError> {
    let mut statement = connection.prepare_cached(
        "SELECT result, place, machines, kinds FROM provenance WHERE campaign = ?1 ORDER BY result, place",
    )?;
    let numbers = |bytes: Vec<u8>| {
        let numbers = bytes.as_chunks().0.iter();
        numbers.map(|number| u64::from_le_bytes(*number)).collect()
    };
    let rows = statement.query_map([campaign], |row| {
        Ok(Run {
            result: row.get(0)?,
            first: row.get::<_, i64>(1)?.unsigned_abs(),
            machines: numbers(row.get(2)?),
            kinds: numbers(row.get(3)?),
        })
    })?;
    Ok(rows.collect::<Result<_, _>>()?)
}

/// Replaces each machine's number in the provenance of a campaign by `other` of that number.
fn replace(
    transaction: &Transaction<'_>,
    campaign: i64,
    other: impl Fn(u64) -> u64,
) -> Result<(), StoreError> {
    for run in provenance(transaction, campaign)? {
        let replaced = run.machines.iter().map(|&by| other(by));
        let replaced: Vec<u8> = replaced.flat_map(u64::to_le_bytes).collect();
        transaction.execute(
            "UPDATE provenance SET machines = ?4 WHERE campaign = ?1 AND result = ?2 AND place = ?3",
            params![campaign, run.result, clamped(run.first), replaced],
        )?;
    }
    Ok(())
}

/// Machines whose results were found wrong, in the order of their quarantines. `which` is a WHERE clause of SQL, or empty.
fn quarantined(connection: &Connection, which: &str) -> Result<Vec<Quarantined>, StoreError> {
    let select = format!("SELECT machine, name FROM quarantined {which} ORDER BY time_ms, machine");
    let mut statement = connection.prepare_cached(&select)?;
    let rows = statement.query_map([], |row| {
        Ok(Quarantined {
            machine: MachineId(row.get::<_, i64>(0)?.cast_unsigned()),
            name: row.get(1)?,
        })
    })?;
    Ok(rows.collect::<Result<_, _>>()?)
}

/// Stores the makers of results of one kind, from place `first` on, and the notices about these results.
pub(super) fn add_provenance(
    transaction: &Transaction<'_>,
    campaign: i64,
    kind: ResultKind,
    first: u64,
    Provenance { makers, notices }: &Provenance,
) -> Result<(), StoreError> {
    let machine = |maker: &Maker| maker.unaudited.map_or(NOBODY, |machine| machine.0);
    let machines: Vec<u8> = makers
        .iter()
        .flat_map(|maker| machine(maker).to_le_bytes())
        .collect();
    let kinds = makers.iter().map(|maker| maker.kind.number());
    let kinds: Vec<u8> = kinds.flat_map(u64::to_le_bytes).collect();
    if !machines.is_empty() {
        transaction.execute(
            "INSERT OR REPLACE INTO provenance (campaign, result, place, machines, kinds) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![campaign, kind.name(), clamped(first), machines, kinds],
        )?;
    }
    add_notices(transaction, campaign, notices)
}

pub(super) fn add_notices(
    transaction: &Transaction<'_>,
    campaign: i64,
    notices: &[String],
) -> Result<(), StoreError> {
    let mut statement = transaction.prepare_cached(
        "INSERT INTO notices (campaign, time_ms, text, generations)
         VALUES (?1, ?2, ?3, (SELECT coalesce(max(generation) + 1, 0) FROM generations WHERE campaign = ?1))",
    )?;
    for text in notices {
        statement.execute(params![campaign, now_ms(), text])?;
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests;
