//! Rounds of feedback: the labels that a fine-tuning learns from, and the move to the fine-tuned checkpoint.

use super::{
    Store, StoreError,
    campaigns::number_of,
    embeddings::begin_move,
    labels::{self, LabelError},
};
use murmuration_model::{
    CampaignId, CampaignRecord, CampaignState, TrainingPictures,
    labels::{Change, Labels, RequestId},
};
use murmuration_swarm::CheckpointDigest;
use rusqlite::{Transaction, params};
use std::{collections::BTreeMap, ops::Range};

impl Store {
    /// Begins a round, and sets the campaign running: a fine-tuning will learn from the first `cutoff` entries of the label log,
    /// from the first epoch on.
    #[cfg(test)]
    pub(crate) fn begin_round(&self, campaign: &CampaignId, cutoff: u64) -> Result<(), StoreError> {
        self.write(|transaction| begin(transaction, number_of(transaction, campaign)?, cutoff))
    }

    /// Adds the changes of a request to the label log, as [`Store::add_labels`] does, and begins a round with the resulting log,
    /// all in one transaction.
    ///
    /// # Errors
    /// The errors of [`Store::add_labels`]; nothing has changed then.
    pub fn answer_round(
        &self,
        campaign: &CampaignId,
        request: &RequestId,
        changes: Vec<Change>,
    ) -> Result<(), LabelError> {
        self.add_to_log(campaign, |transaction, number, labels| {
            labels::add(transaction, campaign, number, request, changes, labels)?;
            begin(transaction, number, labels.entries()).map_err(LabelError::Store)
        })
    }

    /// The labels that follow from the first `cutoff` entries of a campaign's label log: a round learns from these labels.
    pub(crate) fn labels_until(&self, campaign: &CampaignId, cutoff: u64) -> Result<Labels, StoreError> {
        let mut log = self.label_log(campaign)?;
        log.truncate(usize::try_from(cutoff).unwrap_or(usize::MAX));
        let mut labels = Labels::default();
        labels
            .follow(log)
            .map_err(|error| StoreError::damaged(error.to_string()))?;
        Ok(labels)
    }

    /// The individuals that had a class when the last completed round began, each with the number of its class
    /// ([`Labels::numbered_classes`]). The campaign's embedder has learned from these labels; the result is empty before the
    /// first round.
    ///
    /// # Errors
    /// If the labels cannot be read.
    pub fn learned_classes(&self, record: &CampaignRecord) -> Result<BTreeMap<usize, u32>, StoreError> {
        let learned = self.labels_until(&record.id, record.rounds.last_cutoff)?;
        Ok(learned
            .numbered_classes()
            .into_iter()
            .map(|(index, class)| (index as usize, class))
            .collect())
    }

    /// Ends a round, and begins the campaign's move to the fine-tuned `checkpoint`.
    ///
    /// # Errors
    /// [`StoreError::NoCheckpoint`], or if the change cannot be written.
    pub fn finish_round(
        &self,
        campaign: &CampaignId,
        checkpoint: CheckpointDigest,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            transaction.execute(
                "UPDATE campaigns SET rounds = rounds + 1, label_cutoff = NULL,
                    last_label_cutoff = coalesce(label_cutoff, last_label_cutoff)
                 WHERE number = ?1",
                [number],
            )?;
            begin_move(transaction, number, checkpoint)
        })
    }

    /// The images of a campaign's [`TrainingPictures`] at the places `range`, in order, one after the other; fewer if the
    /// pictures end before.
    pub fn training_images(&self, record: &CampaignRecord, range: Range<u64>) -> Result<Vec<u8>, StoreError> {
        let pictures = TrainingPictures::of(record);
        let range = range.start..range.end.min(pictures.count());
        if !pictures.is_from_archive() {
            return self.dataset_images(&record.id, range);
        }
        let individuals = self.individuals(&record.id, record.spec.model(), range, true)?;
        Ok(individuals
            .into_iter()
            .flat_map(|individual| individual.into_image().unwrap_or_default())
            .collect())
    }
}

pub(super) fn begin(transaction: &Transaction<'_>, number: i64, cutoff: u64) -> Result<(), StoreError> {
    transaction.execute(
        "UPDATE campaigns SET label_cutoff = ?2, state = ?3, error = '', ended_ms = NULL WHERE number = ?1",
        params![
            number,
            super::numbers::clamped(cutoff),
            CampaignState::Running.name()
        ],
    )?;
    // Deletes the saved training, because it learned from other labels.
    transaction.execute("DELETE FROM trainings WHERE campaign = ?1", [number])?;
    Ok(())
}

#[cfg(test)]
mod tests;
