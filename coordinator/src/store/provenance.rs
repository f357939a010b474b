//! Where results come from, and what befell a campaign: who evaluated what, notices, and the way back when a worker that
//! contributed is found wrong.

use super::{Store, StoreError, campaigns::number_of};
use crate::{campaign::CampaignId, leases::Instance};
use rusqlite::{Transaction, params};
use std::time::{SystemTime, UNIX_EPOCH};

/// Notices of a campaign that are told; older ones stay in the store.
const MOST_NOTICES: u32 = 50;

/// In the place of who alone evaluated something, where two found the same.
const NOBODY: u64 = 0;

/// Where a generation comes from.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Provenance {
    /// For each individual, who alone says what came of it; `None` where two workers found the same. Empty if nobody
    /// knows.
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

impl Provenance {
    pub(super) fn evaluators(&self) -> Vec<u8> {
        let number = |by: &Option<Instance>| by.map_or(NOBODY, |Instance(number)| number).to_le_bytes();
        self.unaudited.iter().flat_map(number).collect()
    }
}

impl Store {
    /// Archive indices that one of `instances` alone evaluated, in generations from `generation` on, in order.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn evaluated_by(
        &self,
        campaign: &CampaignId,
        instances: &[Instance],
        generation: u32,
    ) -> Result<Vec<u64>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT (SELECT min(place) FROM individuals i WHERE i.campaign = g.campaign
                         AND i.generation = g.generation), evaluators
                 FROM generations g WHERE campaign = ?1 AND generation >= ?2 ORDER BY generation",
            )?;
            let rows = statement.query_map(params![number, generation], |row| {
                Ok((row.get::<_, Option<i64>>(0)?, row.get::<_, Vec<u8>>(1)?))
            })?;
            let mut indices = Vec::new();
            for row in rows {
                let (first, evaluators) = row?;
                let first = first.unwrap_or_default().unsigned_abs();
                for (index, by) in (first..).zip(evaluators.as_chunks::<8>().0) {
                    let by = u64::from_le_bytes(*by);
                    if by != NOBODY && instances.contains(&Instance(by)) {
                        indices.push(index);
                    }
                }
            }
            Ok(indices)
        })
    }

    /// Takes back the generations from `generation` on, with everything that they brought, and says why; in one
    /// transaction. Labels stay in their log.
    ///
    /// # Errors
    /// If it cannot be written; then nothing was taken back.
    pub fn take_back(&self, campaign: &CampaignId, generation: u32, why: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            for table in ["images", "embeddings"] {
                let of_place = format!(
                    "DELETE FROM {table} WHERE campaign = ?1 AND place IN
                         (SELECT place FROM individuals WHERE campaign = ?1 AND generation >= ?2)"
                );
                transaction.execute(&of_place, params![number, generation])?;
            }
            for table in ["individuals", "generations"] {
                let of_generation = format!("DELETE FROM {table} WHERE campaign = ?1 AND generation >= ?2");
                transaction.execute(&of_generation, params![number, generation])?;
            }
            add_notices(transaction, number, &[why.to_owned()])
        })
    }

    /// Adds a notice.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn notify(&self, campaign: &CampaignId, text: &str) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            add_notices(transaction, number, &[text.to_owned()])
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

pub(super) fn add_notices(
    transaction: &Transaction<'_>,
    campaign: i64,
    notices: &[String],
) -> Result<(), StoreError> {
    let now = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |age| age.as_millis() as i64);
    let mut statement =
        transaction.prepare_cached("INSERT INTO notices (campaign, time_ms, text) VALUES (?1, ?2, ?3)")?;
    for text in notices {
        statement.execute(params![campaign, now, text])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{ArchivedIndividual, DataDirectory, GenerationRecord};
    use murmuration_proto::{CampaignSpec, CapabilityModel};

    /// A campaign of three generations of two; of each, worker 7 did the first and two workers the second.
    fn open() -> (tempfile::TempDir, Store, CampaignId) {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
        for generation in 0..3 {
            let first = 2 * u64::from(generation);
            let individuals = [first, first + 1].map(|index| ArchivedIndividual {
                image: Some(vec![index as u8; 4]),
                ..ArchivedIndividual::still(index, generation)
            });
            let provenance = Provenance {
                unaudited: vec![Some(Instance(7)), None],
                notices: vec![format!("generation {generation}")],
            };
            let record = GenerationRecord::of(generation, &[0.0], 0);
            store
                .commit_generation(&id, &record, &individuals, &provenance)
                .unwrap();
        }
        (folder, store, id)
    }

    fn texts(store: &Store, id: &CampaignId) -> Vec<String> {
        let notices = store.notices(id).unwrap();
        notices.into_iter().map(|notice| notice.text).collect()
    }

    #[test]
    fn it_is_known_who_alone_evaluated_what() {
        let (_folder, store, id) = open();
        let by = |instance, from| store.evaluated_by(&id, &[Instance(instance)], from).unwrap();
        assert_eq!(by(7, 0), [0, 2, 4]);
        assert_eq!(by(7, 2), [4]);
        assert!(by(8, 0).is_empty());
        assert!(by(0, 0).is_empty(), "nobody is not somebody");
    }

    #[test]
    fn what_is_taken_back_is_gone_and_can_be_done_again() {
        let (_folder, store, id) = open();
        store.take_back(&id, 1, "a worker was wrong").unwrap();
        assert_eq!(store.campaign(id.as_str()).unwrap().generations_done, 1);
        let left = store
            .individuals(&id, CapabilityModel::SingleSensor, 0..9, true)
            .unwrap();
        assert_eq!(left.len(), 2);
        assert_eq!(texts(&store, &id).last().unwrap(), "a worker was wrong");
        let again = GenerationRecord::of(1, &[0.0], 0);
        let individuals = [2, 3].map(|index| ArchivedIndividual {
            image: Some(vec![0; 4]),
            ..ArchivedIndividual::still(index, 1)
        });
        store
            .commit_generation(&id, &again, &individuals, &Provenance::default())
            .unwrap();
    }

    #[test]
    fn the_latest_notices_are_told_oldest_first() {
        let (_folder, store, id) = open();
        for number in 0..60 {
            store.notify(&id, &number.to_string()).unwrap();
        }
        let expected: Vec<String> = (10..60).map(|number| number.to_string()).collect();
        assert_eq!(texts(&store, &id), expected);
    }
}
