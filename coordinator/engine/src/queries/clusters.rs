//! The clusters of an archive, also while it grows: what questions by medoids and contact sheets go by.

use crate::{
    space::{Space, SpaceError, Spaces},
    taxonomy,
};
use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};
use murmuration_search::{interrupt::Interrupt, medoids::Clustering};
use murmuration_store::kept::Kept;
use std::sync::{Arc, Mutex, PoisonError};

/// Most bytes of clusters that are kept, with the behaviours that are in them.
const MOST_BYTES: usize = 128 << 20;

#[derive(Debug, Clone, PartialEq)]
pub struct Clustered {
    pub space: Arc<Space>,
    /// The clusters of the taxonomy, or what they would be if the search ended here.
    pub clustering: Clustering,
    /// Whether they are the taxonomy's.
    pub is_taxonomy: bool,
    /// For each individual, the number of its trials to which no other medoid is nearer than its own; empty if individuals
    /// have one trial, or these are not the taxonomy's clusters.
    pub robust_trials: Vec<u8>,
}

/// The latest clusters of each campaign; cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Clusters {
    spaces: Spaces,
    /// One lock a campaign, so that an archive is clustered once, whoever asks meanwhile.
    kept: Arc<Kept<Mutex<Option<Arc<Clustered>>>>>,
}

impl Clustered {
    /// The archive as far as `record` says that it goes.
    pub fn read(spaces: &Spaces, record: &CampaignRecord, interrupt: &Interrupt) -> Result<Self, SpaceError> {
        let space = spaces.of(record)?;
        Ok(match spaces.store.taxonomy(&record.id)? {
            Some(mut stored) if stored.clusters.len() == space.behaviours.len() => Self {
                space,
                is_taxonomy: true,
                robust_trials: std::mem::take(&mut stored.robust_trials),
                clustering: stored.into(),
            },
            _ => Self {
                clustering: taxonomy::cluster(&spaces.store, record, &space.behaviours, interrupt, &|_| {})?,
                space,
                is_taxonomy: false,
                robust_trials: Vec::new(),
            },
        })
    }

    fn bytes(&self) -> usize {
        let Clustering {
            medoids, clusters, ..
        } = &self.clustering;
        self.space.bytes()
            + size_of_val(medoids.as_slice())
            + size_of_val(clusters.as_slice())
            + self.robust_trials.len()
    }

    fn serves(&self, record: &CampaignRecord) -> bool {
        let individuals = self.space.behaviours.len() as u64;
        let ends = record.state == CampaignState::Completed && !self.is_taxonomy;
        serves(individuals, self.space.archive_version, record) && !ends
    }
}

/// Whether what was made of so many individuals, of that archive version, still serves. While a campaign searches
/// it does until the archive is a quarter larger: clustering it after every generation would help nobody.
pub(super) fn serves(individuals: u64, archive_version: ArchiveVersion, record: &CampaignRecord) -> bool {
    let slack = match record.state {
        CampaignState::Running => individuals / 4,
        _ => 0,
    };
    archive_version == record.archive_version() && record.individuals() <= individuals + slack
}

impl Clusters {
    /// Nothing has been clustered yet.
    pub(super) fn new(spaces: Spaces) -> Self {
        Self {
            spaces,
            kept: Arc::new(Kept::within(MOST_BYTES)),
        }
    }

    /// The clusters of an archive as it stands.
    pub(super) fn now(
        &self,
        record: &CampaignRecord,
        interrupt: &Interrupt,
    ) -> Result<Arc<Clustered>, SpaceError> {
        Ok(Arc::new(Clustered::read(&self.spaces, record, interrupt)?))
    }

    /// The clusters of an archive, anew once those that there are no longer serve. Blocks while it is clustered.
    pub(super) fn lately(
        &self,
        record: &CampaignRecord,
        interrupt: &Interrupt,
    ) -> Result<Arc<Clustered>, SpaceError> {
        let campaign = self.kept.of(&record.id);
        let mut kept = campaign.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(clustered) = kept.as_ref().filter(|clustered| clustered.serves(record)) {
            return Ok(Arc::clone(clustered));
        }
        let clustered = self.now(record, interrupt)?;
        *kept = Some(Arc::clone(&clustered));
        self.kept.weigh(&record.id, clustered.bytes());
        Ok(clustered)
    }

    #[cfg(test)]
    pub(super) fn within(spaces: Spaces, most_bytes: usize) -> Self {
        Self {
            spaces,
            kept: Arc::new(Kept::within(most_bytes)),
        }
    }

    #[cfg(test)]
    pub(super) fn bytes(&self) -> usize {
        self.kept.bytes()
    }
}
