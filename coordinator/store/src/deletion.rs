//! Deletes a campaign with everything that belongs to it alone.

use super::{
    Store, StoreError,
    campaigns::number_of,
    hidden::{HIDDEN, hidden_id},
    runs::state,
};
use murmuration_model::{CampaignId, CampaignState};
use murmuration_swarm::{CampaignName, counted};
use rusqlite::params;
use std::collections::BTreeSet;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deletion {
    pub individuals: u64,
    pub pictures: u64,
    /// Number of individuals with a label.
    pub labelled: u64,
    /// Whether the campaign has a current or former taxonomy.
    pub taxonomy: bool,
}

impl Deletion {
    /// The deleted things, as a part of a sentence.
    #[must_use]
    pub fn in_words(&self) -> String {
        let taxonomy = match self.taxonomy {
            true => ", its taxonomy",
            false => "",
        };
        format!(
            "{}, {} of the dataset, the labels of {}{taxonomy} and its notices",
            counted(self.individuals, "individual"),
            counted(self.pictures, "picture"),
            counted(self.labelled, "individual"),
        )
    }
}

/// Why a campaign was not deleted.
#[derive(Debug, thiserror::Error)]
pub enum DeletionError {
    /// The store could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("cannot delete campaign {0}: it is running; cancel it first")]
    Running(CampaignId),
    #[error(
        "cannot delete campaign {id}: it belongs to the study {study}; name the study to delete it all the same (--study {study})"
    )]
    OfStudy { id: CampaignId, study: String },
}

impl Store {
    /// Counts the individuals, pictures and labels that a deletion of the campaign would remove.
    ///
    /// # Errors
    /// [`StoreError::NoCampaign`], or if the campaign cannot be read.
    pub fn deletion(&self, campaign: &CampaignId) -> Result<Deletion, StoreError> {
        let record = self.campaign(campaign.as_str())?;
        let labels = self.labels(campaign)?;
        let labelled: BTreeSet<u64> = labels.standing().map(|label| label.index).collect();
        Ok(Deletion {
            individuals: record.individuals(),
            pictures: record.pictures_done,
            labelled: labelled.len() as u64,
            taxonomy: !self.taxonomy_versions(campaign)?.is_empty(),
        })
    }

    /// Deletes a campaign with everything that belongs to it alone; checkpoints stay. One short transaction hides the campaign,
    /// and many short transactions remove its rows. Rows that cannot be removed are removed at the next start. The campaign's
    /// number, and so its id, is never used again. A campaign of a study is only deleted if `study` names that study. With
    /// `has_failed`, the campaign's run failed and could not record its failure.
    ///
    /// # Errors
    /// [`DeletionError`]; nothing was deleted then, unless it is [`StoreError::Unmirrored`].
    pub fn delete_campaign(
        &self,
        campaign: &CampaignId,
        study: Option<&CampaignName>,
        has_failed: bool,
    ) -> Result<(), DeletionError> {
        let (hidden, committed) = self.commit(|transaction| {
            let number = number_of(transaction, campaign)?;
            if state(transaction, number)? == CampaignState::Running && !has_failed {
                return Ok(Err(DeletionError::Running(campaign.clone())));
            }
            let of = "SELECT study FROM campaigns WHERE number = ?1";
            let of: String = transaction.query_row(of, [number], |row| row.get(0))?;
            if !of.is_empty() && study.map(CampaignName::as_str) != Some(of.as_str()) {
                let id = campaign.clone();
                return Ok(Err(DeletionError::OfStudy { id, study: of }));
            }
            transaction.execute("INSERT INTO deleted (number) VALUES (?1)", [number])?;
            transaction.execute(
                "UPDATE campaigns SET id = ?2, state = ?3, request = NULL WHERE number = ?1",
                params![number, hidden_id(number), HIDDEN],
            )?;
            Ok(Ok(number))
        })?;
        let number = hidden?;
        let mirrored = self.await_mirror(committed);
        self.followed.forget(campaign);
        self.remove_hidden_or_later(number);
        Ok(mirrored?)
    }
}

#[cfg(test)]
mod tests;
