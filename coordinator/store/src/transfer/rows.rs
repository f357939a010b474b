//! Rows of a campaign that is transferred.

use crate::{
    ArchivedIndividual, GenerationRecord, Store, StoreError, StoredTaxonomy,
    archive::{insert_generation, insert_individuals},
    campaigns::number_of,
    checkpoint_rows::checkpoint_number,
    individual::compressed,
    labels::{entries_with_requests, insert},
    numbers::clamped,
    taxonomies::insert_taxonomy,
};
use murmuration_model::{
    CampaignId, ExportedCampaign,
    labels::{Entry, RequestId},
};
use murmuration_proto::CheckpointDigest;
use rusqlite::params;
use std::{ops::Range, sync::PoisonError};

impl Store {
    /// Entries of a campaign's log, each with the request that it came with.
    ///
    /// # Errors
    /// If they cannot be read.
    pub(super) fn requested_labels(
        &self,
        campaign: &CampaignId,
        range: Range<u64>,
    ) -> Result<Vec<(RequestId, Entry)>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            entries_with_requests(connection, number, range)
        })
    }

    /// Adds entries to a log as they are; whether they follow from those before them the doctor finds out.
    pub(super) fn add_entries(
        &self,
        campaign: &CampaignId,
        entries: &[(RequestId, Entry)],
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            for (request, entry) in entries {
                insert(transaction, number, request, std::slice::from_ref(entry))?;
            }
            Ok(())
        })
    }

    /// Stores a campaign as it was, without an archive. Its checkpoints are stored.
    pub(super) fn add_transferred(&self, campaign: &ExportedCampaign) -> Result<(), StoreError> {
        let record = &campaign.record;
        self.write(|transaction| {
            let checkpoint = |digest: Option<CheckpointDigest>| {
                let number = digest.map(|digest| checkpoint_number(transaction, digest));
                number.transpose()
            };
            transaction.execute(
                "INSERT INTO campaigns (number, id, spec, simulator_version, state, error, created_ms, weight, rollbacks,
                    checkpoint, next_checkpoint, rounds, label_cutoff, last_label_cutoff)
                 VALUES (1, ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)",
                params![
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
                ],
            )?;
            Ok(())
        })
    }

    /// Adds the record of a generation whose individuals are still to come.
    pub(super) fn add_generation(
        &self,
        campaign: &CampaignId,
        record: &GenerationRecord,
    ) -> Result<(), StoreError> {
        self.write(|transaction| insert_generation(transaction, number_of(transaction, campaign)?, record))
    }

    /// Adds individuals as they were.
    pub(super) fn add_individuals(
        &self,
        campaign: &CampaignId,
        individuals: &[ArchivedIndividual],
    ) -> Result<(), StoreError> {
        let images = compressed(individuals)?;
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            insert_individuals(transaction, number, individuals, &images)
        })
    }

    /// Stores a taxonomy as it was.
    pub(super) fn add_taxonomy(
        &self,
        campaign: &CampaignId,
        taxonomy: &StoredTaxonomy,
    ) -> Result<(), StoreError> {
        self.write(|transaction| {
            insert_taxonomy(
                transaction,
                number_of(transaction, campaign)?,
                taxonomy,
                &[],
                None,
            )
        })
    }

    /// Has nothing wait for the disk any more: for a store that is discarded if the system stops.
    pub(super) fn without_sync(self) -> Result<Self, StoreError> {
        let path = self.path.clone();
        let connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        let set = connection.pragma_update(None, "synchronous", "OFF");
        set.map_err(|error| StoreError::from(error).at(&path))?;
        drop(connection);
        Ok(self)
    }
}
