//! Rows of committees: the embedders that a campaign has beside its own, to ask where they differ.

use super::{Store, StoreError, campaigns::number_of, checkpoints::checkpoint_number};
use crate::campaign::CampaignId;
use murmuration_proto::{CheckpointDigest, Invalid};
use rusqlite::params;

impl Store {
    /// The checkpoints of the further members of a campaign's committee, from member 1 on.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn committee(&self, campaign: &CampaignId) -> Result<Vec<CheckpointDigest>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare(
                "SELECT k.digest FROM committee m JOIN checkpoints k ON k.number = m.checkpoint
                 WHERE m.campaign = ?1 ORDER BY m.member",
            )?;
            let number = number_of(connection, campaign)?;
            let rows = statement.query_map([number], |row| row.get::<_, String>(0))?;
            let damaged = |error: Invalid| StoreError::damaged(format!("campaign {campaign}: {error}"));
            rows.map(|digest| digest?.parse().map_err(damaged)).collect()
        })
    }

    /// Has `checkpoint` be a further member of a campaign's committee, in the place of what that was before; it has learned
    /// in the first `rounds` rounds. The training that made it is over.
    ///
    /// # Errors
    /// [`StoreError::NoCheckpoint`], or if it cannot be written.
    pub fn seat_member(
        &self,
        campaign: &CampaignId,
        member: u32,
        rounds: u32,
        checkpoint: CheckpointDigest,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let checkpoint = checkpoint_number(transaction, checkpoint)?;
            transaction.execute(
                "INSERT OR REPLACE INTO committee (campaign, member, rounds, checkpoint) VALUES (?1, ?2, ?3, ?4)",
                params![number, member, rounds, checkpoint],
            )?;
            transaction.execute("DELETE FROM trainings WHERE campaign = ?1", [number])?;
            Ok(())
        })
    }
}
