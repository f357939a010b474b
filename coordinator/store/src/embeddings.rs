//! Embeddings, and the switch of an archive from one checkpoint to another.

use super::{
    GenerationRecord, Provenance, Store, StoreError,
    campaigns::number_of,
    chunks::{EMBEDDINGS, NEXT, set_novelty},
    numbers::{blob_to_numbers, clamped, numbers_to_blob},
    provenance::{ResultKind, add_provenance},
    taxonomies::retire_taxonomy,
};
use crate::checkpoint_rows::checkpoint_number;
use murmuration_model::{CampaignId, CampaignState};
use murmuration_swarm::{CheckpointDigest, mean_embedding};
use rusqlite::{Transaction, params};

/// New values of an archive that switches to the next checkpoint, measured in the new behaviour space.
#[derive(Debug, Clone, PartialEq)]
pub struct Switch {
    /// Novelty of every individual, by index.
    pub novelty: Vec<f64>,
    /// Every complete generation, in order.
    pub generations: Vec<GenerationRecord>,
}

impl Store {
    /// Begins a campaign's move to `checkpoint`: the checkpoint will embed the archive's pictures, and then the archive switches
    /// to it. The move sets the campaign running.
    ///
    /// # Errors
    /// [`StoreError::NoCheckpoint`], or if the change cannot be written.
    pub fn move_to(&self, campaign: &CampaignId, checkpoint: CheckpointDigest) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            begin_move(transaction, number, checkpoint)
        })
    }

    /// In one transaction, adds embeddings by the next checkpoint and their provenance. `embeddings` has one embedding for each
    /// trial, of the individuals from `place` on.
    ///
    /// # Errors
    /// If the embeddings cannot be written; none is written then.
    pub fn add_embeddings(
        &self,
        campaign: &CampaignId,
        place: u64,
        embeddings: &[Vec<Vec<f32>>],
        provenance: &Provenance,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let next = "SELECT next_checkpoint FROM campaigns WHERE number = ?1";
            let next = transaction.query_row(next, [number], |row| row.get(0))?;
            let mut writer = EMBEDDINGS.writer(transaction)?;
            for (place, trials) in (place..).zip(embeddings) {
                writer.add(number, next, clamped(place), &[numbers_to_blob(&trials.concat())])?;
            }
            writer.finish()?;
            add_provenance(transaction, number, ResultKind::Embedding, place, provenance)
        })
    }

    /// In one transaction, switches a campaign's archive to the embeddings by the next checkpoint and to the values of `switch`.
    /// The current taxonomy, if any, stays as a former version.
    ///
    /// # Errors
    /// If the switch cannot be written; nothing has changed then.
    pub fn switch(&self, campaign: &CampaignId, switch: &Switch) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            set_novelty(transaction, number, &switch.novelty)?;
            let mut generation = transaction.prepare(
                "UPDATE generations SET best_novelty = ?3, mean_novelty = ?4
                 WHERE campaign = ?1 AND generation = ?2",
            )?;
            for record in &switch.generations {
                generation.execute(params![
                    number,
                    record.generation,
                    record.best_novelty,
                    record.mean_novelty
                ])?;
            }
            transaction.execute(
                "UPDATE campaigns SET checkpoint = next_checkpoint, next_checkpoint = NULL WHERE number = ?1",
                [number],
            )?;
            transaction.execute(
                "DELETE FROM embedding_chunks WHERE campaign = ?1
                    AND checkpoint <> (SELECT checkpoint FROM campaigns WHERE number = ?1)",
                [number],
            )?;
            retire_taxonomy(transaction, number)?;
            transaction.execute("DELETE FROM trainings WHERE campaign = ?1", [number])?;
            Ok(())
        })
    }

    /// The embeddings by the next checkpoint that are on disk, from individual 0 on. Each embedding is the mean over an
    /// individual's trials, of `dimensions` numbers.
    pub fn next_embeddings(
        &self,
        campaign: &CampaignId,
        dimensions: usize,
    ) -> Result<Vec<Vec<f32>>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut rows = EMBEDDINGS.reader(connection, number, NEXT)?;
            let (mut range, mut embeddings) = (0..u64::MAX, Vec::new());
            while let Some(member) = rows.next(&mut range)? {
                if member.place != embeddings.len() as u64 {
                    let text = format!("the embedding of individual {} is missing", embeddings.len());
                    return Err(StoreError::damaged(text));
                }
                let trials = blob_to_numbers(member.value(0));
                embeddings.push(mean_embedding(trials.chunks(dimensions.max(1))));
            }
            Ok(embeddings)
        })
    }
}

/// Begins a campaign's move to `checkpoint`, and sets the campaign running.
pub(super) fn begin_move(
    transaction: &Transaction<'_>,
    number: i64,
    checkpoint: CheckpointDigest,
) -> Result<(), StoreError> {
    let next = checkpoint_number(transaction, checkpoint)?;
    transaction.execute(
        "UPDATE campaigns SET next_checkpoint = ?2, state = ?3, error = '', ended_ms = NULL WHERE number = ?1",
        params![number, next, CampaignState::Running.name()],
    )?;
    // Deletes the embeddings of an earlier, unfinished move.
    transaction.execute(
        "DELETE FROM embedding_chunks WHERE campaign = ?1 AND checkpoint NOT IN
            (SELECT ?2 UNION SELECT checkpoint FROM campaigns WHERE number = ?1 AND checkpoint NOT NULL)",
        params![number, next],
    )?;
    Ok(())
}
