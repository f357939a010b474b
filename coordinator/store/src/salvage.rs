//! Taking over what remains of a damaged store, into a new one.

use super::{
    Store, StoreError,
    campaigns::{ended_ms, number_of},
    numbers::clamped,
};
use murmuration_model::{CampaignId, CampaignState};
use rusqlite::{Connection, Params, Transaction, params, params_from_iter, types::Value};

/// What of a campaign is whole, from its beginning on.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Recoverable {
    /// Pictures of its dataset.
    pub pictures: u64,
    /// Generations.
    pub generations: u32,
    /// Their individuals.
    pub individuals: u64,
    /// Entries of its label log.
    pub labels: u64,
    /// The version of its taxonomy that stands.
    pub taxonomy: bool,
    /// The numbers of the former versions of its taxonomy.
    pub former_taxonomies: Vec<u32>,
}

impl Store {
    /// Takes over the descriptions of all checkpoints of another store, as far as they can be read, and the machines that
    /// it mistrusts; how many checkpoints.
    ///
    /// # Errors
    /// If they cannot be written.
    pub(crate) fn take_checkpoints(&self, from: &Self) -> Result<u64, StoreError> {
        from.read(|source| {
            self.write(|target| {
                copy(source, target, "quarantined", "ORDER BY machine", [])?;
                copy(source, target, "deleted", "ORDER BY number", [])?;
                copy(source, target, "checkpoints", "ORDER BY number", [])
            })
        })
    }

    /// Takes over what remains of a campaign of another store, in one transaction. One that is `cut` off somewhere has
    /// failed for the reason given, so that it waits for a person to resume it.
    ///
    /// # Errors
    /// If it cannot be written, or less can be read than should remain.
    pub(crate) fn take_campaign(
        &self,
        from: &Self,
        campaign: &CampaignId,
        remains: &Recoverable,
        cut: Option<&str>,
    ) -> Result<(), StoreError> {
        from.read(|source| {
            let number = number_of(source, campaign)?;
            self.write(|target| {
                copy(source, target, "campaigns", "WHERE number = ?1", [number])?;
                let take = |table, which: &str, most: u64| {
                    let which = format!("WHERE campaign = ?1 AND {which} < ?2 ORDER BY {which}");
                    let copied = copy(source, target, table, &which, params![number, clamped(most)])?;
                    match copied == most {
                        true => Ok(()),
                        false => Err(StoreError::damaged(format!(
                            "{table}: {copied} of {most} can be read"
                        ))),
                    }
                };
                take("generations", "generation", remains.generations.into())?;
                take("individuals", "place", remains.individuals)?;
                take("images", "place", remains.individuals)?;
                take("pictures", "place", remains.pictures)?;
                take("labels", "entry", remains.labels)?;
                // Those of a move that has not ended are made anew.
                let current = "WHERE campaign = ?1 AND place < ?2 AND checkpoint =
                    (SELECT checkpoint FROM campaigns WHERE number = ?1) ORDER BY place";
                let individuals = clamped(remains.individuals);
                copy(
                    source,
                    target,
                    "embeddings",
                    current,
                    params![number, individuals],
                )?;
                if remains.taxonomy {
                    let standing = "WHERE campaign = ?1 AND stands";
                    copy(source, target, "taxonomies", standing, [number])?;
                }
                for version in &remains.former_taxonomies {
                    let former = "WHERE campaign = ?1 AND version = ?2";
                    copy(source, target, "taxonomies", former, params![number, version])?;
                }
                copy(source, target, "trainings", "WHERE campaign = ?1", [number])?;
                copy(source, target, "epochs", "WHERE campaign = ?1", [number])?;
                copy(source, target, "notices", "WHERE campaign = ?1", [number])?;
                copy(source, target, "provenance", "WHERE campaign = ?1", [number])?;
                if let Some(why) = cut {
                    target.execute(
                        "UPDATE campaigns SET state = ?2, error = ?3, ended_ms = ?4 WHERE number = ?1",
                        params![
                            number,
                            CampaignState::Failed.name(),
                            why,
                            ended_ms(CampaignState::Failed)
                        ],
                    )?;
                }
                Ok(())
            })
        })
    }
}

/// Copies rows as far as they can be read; how many. Both tables are of the newest schema.
fn copy(
    source: &Connection,
    target: &Transaction<'_>,
    table: &str,
    which: &str,
    parameters: impl Params,
) -> Result<u64, StoreError> {
    let mut select = source.prepare(&format!("SELECT * FROM {table} {which}"))?;
    let names = select.column_names().collect::<Vec<_>>().join(", ");
    let columns = select.column_count();
    let places = vec!["?"; columns].join(", ");
    let mut insert = target.prepare(&format!("INSERT INTO {table} ({names}) VALUES ({places})"))?;
    let mut rows = select.query(parameters)?;
    let mut copied = 0;
    // An error is the end of what can be read.
    while let Ok(Some(row)) = rows.next() {
        let values: Result<Vec<Value>, _> = (0..columns).map(|column| row.get(column)).collect();
        let Ok(values) = values else { break };
        insert.execute(params_from_iter(values))?;
        copied += 1;
    }
    Ok(copied)
}
