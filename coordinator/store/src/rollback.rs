//! Rollbacks: delete results after workers were found wrong, so that other workers repeat the work. Each rollback is one
//! transaction, and adds a notice with its reason. A rollback deletes parts of datasets and archives, or embeddings. A rollback
//! keeps the label log, and adds entries that withdraw the answers about deleted individuals.

use super::{
    LabelError, Store, StoreError,
    campaigns::number_of,
    labels::insert,
    numbers::{clamped, now_ms},
    provenance::{ResultKind, add_notices},
    taxonomies::withdraw_taxonomies,
};
use murmuration_model::{
    CampaignId,
    labels::{Action, Change, Labels, RequestId},
};
use rusqlite::{Transaction, params};

impl Store {
    /// Rolls back the generations from `generation` on, with everything that belongs to these generations.
    ///
    /// # Errors
    /// If the rollback cannot be written; nothing was rolled back then.
    pub fn roll_back_generations(
        &self,
        campaign: &CampaignId,
        generation: u32,
        why: &str,
    ) -> Result<(), StoreError> {
        self.roll_back(campaign, |transaction, number, labels| {
            delete_generations(transaction, number, labels, generation)?;
            add_notices(transaction, number, &[why.to_owned()])
        })
    }

    /// Rolls back the embeddings of an archive, including embeddings of an unfinished move, and the generations after the first
    /// `kept` individuals. The remaining individuals are embedded again.
    ///
    /// # Errors
    /// If the rollback cannot be written; nothing was rolled back then.
    pub fn roll_back_embeddings(
        &self,
        campaign: &CampaignId,
        kept: u64,
        why: &str,
    ) -> Result<(), StoreError> {
        self.roll_back(campaign, |transaction, number, labels| {
            let first: Option<u32> = transaction.query_row(
                "SELECT min(generation) FROM individual_chunks WHERE campaign = ?1 AND first + individuals > ?2",
                params![number, clamped(kept)],
                |row| row.get(0),
            )?;
            if let Some(generation) = first {
                delete_generations(transaction, number, labels, generation)?;
            }
            withdraw_taxonomies(transaction, number)?;
            transaction.execute("DELETE FROM embedding_chunks WHERE campaign = ?1", [number])?;
            forget(transaction, number, ResultKind::Embedding, 0)?;
            transaction.execute(
                "UPDATE campaigns SET next_checkpoint = coalesce(next_checkpoint, checkpoint), checkpoint = NULL
                 WHERE number = ?1",
                [number],
            )?;
            add_notices(transaction, number, &[why.to_owned()])
        })
    }

    /// Rolls back everything except the first `pictures` pictures of a campaign's dataset: the campaign begins again, with a new
    /// embedder.
    ///
    /// # Errors
    /// If the rollback cannot be written; nothing was rolled back then.
    pub fn roll_back_dataset(
        &self,
        campaign: &CampaignId,
        pictures: u64,
        why: &str,
    ) -> Result<(), StoreError> {
        self.roll_back(campaign, |transaction, number, labels| {
            delete_generations(transaction, number, labels, 0)?;
            for table in ["embedding_chunks", "trainings", "epochs"] {
                transaction.execute(&format!("DELETE FROM {table} WHERE campaign = ?1"), [number])?;
            }
            forget(transaction, number, ResultKind::Embedding, 0)?;
            forget(transaction, number, ResultKind::Picture, pictures)?;
            transaction.execute(
                "DELETE FROM pictures WHERE campaign = ?1 AND place >= ?2",
                params![number, clamped(pictures)],
            )?;
            transaction.execute(
                "UPDATE campaigns SET checkpoint = NULL, next_checkpoint = NULL WHERE number = ?1",
                [number],
            )?;
            add_notices(transaction, number, &[why.to_owned()])
        })
    }

    /// Runs a rollback in one transaction, and increases the campaign's number of rollbacks.
    fn roll_back(
        &self,
        campaign: &CampaignId,
        change: impl FnOnce(&Transaction<'_>, i64, &mut Labels) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let rolled_back = self.add_to_log(campaign, |transaction, number, labels| {
            change(transaction, number, labels)?;
            let archive_version = "UPDATE campaigns SET rollbacks = rollbacks + 1 WHERE number = ?1";
            transaction
                .execute(archive_version, [number])
                .map_err(StoreError::from)?;
            Ok(())
        });
        rolled_back.map_err(|error| match error {
            LabelError::Store(error) => error,
            refused => StoreError::damaged(refused.to_string()),
        })
    }

    /// Number of individuals that an archive had when it moved to its current or next checkpoint; 0 if the archive began with
    /// this checkpoint.
    pub fn embedded_when_moved(&self, campaign: &CampaignId) -> Result<u64, StoreError> {
        self.read(|connection| {
            let end: i64 = connection.query_row(
                "SELECT coalesce(max(place + length(machines) / 8), 0) FROM provenance
                 WHERE campaign = ?1 AND result = ?2",
                params![number_of(connection, campaign)?, ResultKind::Embedding.name()],
                |row| row.get(0),
            )?;
            Ok(end.unsigned_abs())
        })
    }
}

/// Deletes generations from an archive, and withdraws answers about their individuals.
fn delete_generations(
    transaction: &Transaction<'_>,
    number: i64,
    labels: &mut Labels,
    generation: u32,
) -> Result<(), StoreError> {
    let first: Option<i64> = transaction.query_row(
        "SELECT min(first) FROM individual_chunks WHERE campaign = ?1 AND generation >= ?2",
        params![number, generation],
        |row| row.get(0),
    )?;
    if let Some(first) = first {
        withdraw_answers(transaction, number, labels, first.unsigned_abs())?;
        forget(transaction, number, ResultKind::Evaluation, first.unsigned_abs())?;
        for table in ["image_chunks", "embedding_chunks"] {
            let from_first = format!("DELETE FROM {table} WHERE campaign = ?1 AND first >= ?2");
            transaction.execute(&from_first, params![number, first])?;
        }
        // A move adds embeddings whose chunks can continue past `first`.
        transaction.execute(
            "UPDATE embedding_chunks SET individuals = ?2 - first,
                 embeddings = substr(embeddings, 1, length(embeddings) / individuals * (?2 - first))
             WHERE campaign = ?1 AND first + individuals > ?2",
            params![number, first],
        )?;
    }
    for table in ["individual_chunks", "generations"] {
        let of_generation = format!("DELETE FROM {table} WHERE campaign = ?1 AND generation >= ?2");
        transaction.execute(&of_generation, params![number, generation])?;
    }
    withdraw_taxonomies(transaction, number)
}

/// Withdraws the answers about individuals from `first` on, because other individuals will take their places.
fn withdraw_answers(
    transaction: &Transaction<'_>,
    number: i64,
    labels: &mut Labels,
    first: u64,
) -> Result<(), StoreError> {
    // Answers that a deleted class set aside are also withdrawn: they would stand again if the deletion were reverted.
    let answers = labels.standing().chain(labels.set_aside());
    let about: Vec<_> = answers.filter(|label| label.index >= first).collect();
    let withdrawn = about.into_iter().map(|label| {
        labels.record(Change {
            annotator: label.annotator,
            time_ms: now_ms().unsigned_abs(),
            action: Action::Withdraw { index: label.index },
        })
    });
    let withdrawn: Vec<_> = withdrawn
        .collect::<Result<_, _>>()
        .map_err(|refusal| StoreError::damaged(refusal.to_string()))?;
    insert(transaction, number, &RequestId::of_withdrawal(), &withdrawn)
}

/// Deletes the provenance of results from `first` on. A row of consecutive results that continues past `first` is cut at `first`.
fn forget(
    transaction: &Transaction<'_>,
    number: i64,
    kind: ResultKind,
    first: u64,
) -> Result<(), StoreError> {
    transaction.execute(
        "DELETE FROM provenance WHERE campaign = ?1 AND result = ?2 AND place >= ?3",
        params![number, kind.name(), clamped(first)],
    )?;
    transaction.execute(
        "UPDATE provenance SET machines = substr(machines, 1, 8 * (?3 - place)),
             kinds = substr(kinds, 1, 8 * (?3 - place))
         WHERE campaign = ?1 AND result = ?2 AND place + length(machines) / 8 > ?3",
        params![number, kind.name(), clamped(first)],
    )?;
    Ok(())
}

#[cfg(test)]
mod tests;
