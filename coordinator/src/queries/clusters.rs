//! The clusters of an archive, also while it grows: what questions by medoids and contact sheets go by.

use crate::{
    campaign::{CampaignId, CampaignState},
    medoids::{self, Clustering},
    space::{Space, SpaceError},
    store::{CampaignRecord, Edition, Store},
};
use murmuration_proto::{Purpose, Stream};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

/// An archive in clusters.
#[derive(Debug, Clone, PartialEq)]
pub struct Clustered {
    /// What was clustered.
    pub space: Space,
    /// The clusters of the taxonomy, or what they would be if the search ended here.
    pub clustering: Clustering,
    /// Whether they are the taxonomy's.
    pub is_taxonomy: bool,
}

/// What was clustered lately, campaign by campaign; cheap to clone.
#[derive(Debug, Clone, Default)]
pub(super) struct Clusters {
    /// One lock a campaign, so that an archive is clustered once, whoever asks meanwhile.
    campaigns: Arc<Mutex<BTreeMap<CampaignId, Arc<Mutex<Kept>>>>>,
}

/// What there is of a campaign.
type Kept = Option<Arc<Clustered>>;

impl Clustered {
    /// The archive as far as `record` says that it goes.
    ///
    /// # Errors
    /// See [`SpaceError`].
    pub fn read(store: &Store, record: &CampaignRecord) -> Result<Self, SpaceError> {
        let space = Space::read(store, record)?;
        Ok(match store.taxonomy(&record.id)? {
            Some(stored) if stored.clusters.len() == space.behaviours.len() => Self {
                space,
                clustering: stored.into(),
                is_taxonomy: true,
            },
            _ => {
                let count = record.spec.medoids() as usize;
                let mut stream = Stream::derive(record.spec.seed(), Purpose::Medoids, 0);
                Self {
                    clustering: medoids::cluster(&space.behaviours, count, &mut stream),
                    space,
                    is_taxonomy: false,
                }
            }
        })
    }

    fn serves(&self, record: &CampaignRecord) -> bool {
        let individuals = self.space.behaviours.len() as u64;
        let ends = record.state == CampaignState::Completed && !self.is_taxonomy;
        serves(individuals, self.space.edition, record) && !ends
    }
}

/// Whether what was made of so many individuals, of that edition, still serves. While a campaign searches
/// it does until the archive is a quarter larger: clustering it after every generation would help nobody.
pub(super) fn serves(individuals: u64, edition: Edition, record: &CampaignRecord) -> bool {
    let slack = match record.state {
        CampaignState::Running => individuals / 4,
        _ => 0,
    };
    edition == record.edition() && record.individuals() <= individuals + slack
}

impl Clusters {
    /// The clusters of an archive, anew once those that there are no longer serve. Blocks while it is clustered.
    pub(super) fn lately(
        &self,
        store: &Store,
        record: &CampaignRecord,
    ) -> Result<Arc<Clustered>, SpaceError> {
        let campaign = {
            let mut campaigns = self.campaigns.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(campaigns.entry(record.id.clone()).or_default())
        };
        let mut kept = campaign.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(clustered) = kept.as_ref().filter(|clustered| clustered.serves(record)) {
            return Ok(Arc::clone(clustered));
        }
        let clustered = Arc::new(Clustered::read(store, record)?);
        *kept = Some(Arc::clone(&clustered));
        Ok(clustered)
    }
}
