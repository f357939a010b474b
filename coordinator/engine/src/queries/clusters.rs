//! The clusters of an archive, even while it grows, for questions by medoids and for contact sheets.

use crate::{
    space::{Space, SpaceError, Spaces},
    taxonomy,
};
use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};
use murmuration_search::{interrupt::Interrupt, medoids::Clustering};
use murmuration_store::kept::Kept;
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum size in bytes of the clusters that are kept, including their behaviours.
const MOST_BYTES: usize = 128 << 20;

#[derive(Debug, Clone, PartialEq)]
pub struct Clustered {
    pub space: Arc<Space>,
    /// The clusters of the taxonomy, or the clusters that the taxonomy would have if the search ended now.
    pub clustering: Clustering,
    /// Whether `clustering` comes from the taxonomy.
    pub is_taxonomy: bool,
    /// The number of robust trials of each individual, see [`taxonomy::robust_trials`]. Empty if individuals have one trial, or
    /// `clustering` does not come from the taxonomy.
    pub robust_trials: Vec<u8>,
}

/// The latest clusters of each campaign; cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Clusters {
    pub(super) spaces: Spaces,
    /// One lock per campaign, so that concurrent requests cluster an archive only once.
    kept: Arc<Kept<Mutex<Option<Arc<Clustered>>>>>,
}

impl Clustered {
    /// The clusters of the archive up to the individuals in `record`.
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

/// Whether a result for `individuals` individuals of `archive_version` is still good enough. During a search, a result is good
/// enough until the archive is a quarter larger: clustering after every generation would not help.
pub(super) fn serves(individuals: u64, archive_version: ArchiveVersion, record: &CampaignRecord) -> bool {
    let slack = match record.state {
        CampaignState::Running => individuals / 4,
        _ => 0,
    };
    archive_version == record.archive_version() && record.sampled() <= individuals + slack
}

impl Clusters {
    /// Starts without clusters.
    pub(super) fn new(spaces: Spaces) -> Self {
        Self {
            spaces,
            kept: Arc::new(Kept::within(MOST_BYTES)),
        }
    }

    /// The current clusters of an archive.
    pub(super) fn now(
        &self,
        record: &CampaignRecord,
        interrupt: &Interrupt,
    ) -> Result<Arc<Clustered>, SpaceError> {
        Ok(Arc::new(Clustered::read(&self.spaces, record, interrupt)?))
    }

    /// The recent clusters of an archive. Blocks while clusters that are no longer good enough are computed again.
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
