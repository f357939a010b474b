//! Measurements of each epoch of a campaign's trainings.

use super::{Store, StoreError, campaigns::number_of, numbers::now_ms};
use murmuration_model::CampaignId;
use rusqlite::params;

/// An epoch of a training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpochRecord {
    /// Number, from 1, of the round of feedback whose labels the training learned from; 0 for the first training.
    pub round: u32,
    /// Number of the epoch, from 1.
    pub epoch: u64,
    /// Mean loss of the epoch's steps.
    pub loss: Option<f64>,
    /// Accuracy on held-out triplets after the epoch, from 0 to 1.
    pub accuracy: Option<f64>,
}

impl Store {
    /// Stores the measurements of an epoch. Deletes former measurements of this and later epochs, which exist if the training was
    /// restarted.
    pub fn add_epoch(&self, campaign: &CampaignId, epoch: &EpochRecord) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let (round, place) = (epoch.round, epoch.epoch.cast_signed());
            transaction.execute(
                "DELETE FROM epochs WHERE campaign = ?1 AND round = ?2 AND epoch >= ?3",
                params![number, round, place],
            )?;
            transaction.execute(
                "INSERT INTO epochs (campaign, round, epoch, generations, loss, accuracy, ended_ms) VALUES (?1, ?2, ?3,
                    (SELECT coalesce(max(generation) + 1, 0) FROM generations WHERE campaign = ?1), ?4, ?5, ?6)",
                params![number, round, place, epoch.loss, epoch.accuracy, now_ms()],
            )?;
            Ok(())
        })
    }

    /// Every epoch of a campaign's trainings, in order, each with the number of complete generations when the epoch ended.
    pub fn epochs(&self, campaign: &CampaignId) -> Result<Vec<(EpochRecord, u32)>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT round, epoch, loss, accuracy, generations FROM epochs WHERE campaign = ?1 ORDER BY round, epoch",
            )?;
            let rows = statement.query_map([number], |row| {
                let epoch = EpochRecord {
                    round: row.get(0)?,
                    epoch: row.get::<_, i64>(1)?.unsigned_abs(),
                    loss: row.get(2)?,
                    accuracy: row.get(3)?,
                };
                Ok((epoch, row.get(4)?))
            })?;
            rows.map(|row| Ok(row?)).collect()
        })
    }

    /// The end times of the epochs of a round's training, in order: milliseconds since 1970-01-01 UTC.
    pub fn epoch_times(&self, campaign: &CampaignId, round: u32) -> Result<Vec<u64>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT ended_ms FROM epochs WHERE campaign = ?1 AND round = ?2 ORDER BY epoch",
            )?;
            let rows = statement.query_map(params![number, round], |row| row.get::<_, i64>(0))?;
            rows.map(|row| Ok(row?.unsigned_abs())).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DataDirectory;
    use murmuration_model::Weight;
    use murmuration_swarm::CampaignSpec;

    #[test]
    fn a_training_that_is_begun_again_replaces_its_epochs_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"latent\"").unwrap();
        let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
        let epoch = |round, epoch| EpochRecord {
            round,
            epoch,
            loss: Some(0.5),
            accuracy: None,
        };
        for (round, place) in [(0, 1), (0, 2), (0, 3), (1, 1), (0, 2)] {
            store.add_epoch(&id, &epoch(round, place)).unwrap();
        }
        let kept = store.epochs(&id).unwrap();
        let expected = [(0, 1), (0, 2), (1, 1)].map(|(round, place)| (epoch(round, place), 0));
        assert_eq!(kept, expected);
        let times = store.epoch_times(&id, 0).unwrap();
        assert!(times.len() == 2 && times.is_sorted() && times[0] > 0, "{times:?}");
    }
}
