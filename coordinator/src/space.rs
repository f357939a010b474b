//! The behaviour space of an archive: what novelty, questions and maps are measured in.

use crate::{
    novelty::{Behaviours, Misfit},
    store::{CampaignRecord, Edition, Store, StoreError},
};

/// Individuals read from the store at a time.
const CHUNK: u64 = 4096;

/// The behaviours of an archive, all in one space.
#[derive(Debug, Clone, PartialEq)]
pub struct Space {
    /// One an individual, by index.
    pub behaviours: Behaviours,
    /// What they are of.
    pub edition: Edition,
}

/// Why there is no space to measure in.
#[derive(Debug, thiserror::Error)]
pub enum SpaceError {
    /// The store could not be read.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The archive holds vectors that cannot be compared.
    #[error("the archive holds vectors that cannot be compared: {0}")]
    Misfit(#[from] Misfit),
}

impl Space {
    /// Reads the archive as far as `record` says that it goes. One of which another edition begins meanwhile is
    /// read again.
    ///
    /// # Errors
    /// See [`SpaceError`].
    pub fn read(store: &Store, record: &CampaignRecord) -> Result<Self, SpaceError> {
        let edition = || -> Result<_, StoreError> { Ok(store.campaign(record.id.as_str())?.edition()) };
        let mut before = edition()?;
        loop {
            let read = behaviours(store, record);
            let after = edition()?;
            // Two editions are no space.
            if before == after {
                return Ok(Self {
                    behaviours: read?,
                    edition: after,
                });
            }
            before = after;
        }
    }
}

fn behaviours(store: &Store, record: &CampaignRecord) -> Result<Behaviours, SpaceError> {
    let (model, method) = (record.spec.model(), record.spec.method());
    let mut behaviours: Option<Behaviours> = None;
    let len = record.individuals();
    for start in (0..len).step_by(CHUNK as usize) {
        let range = start..len.min(start + CHUNK);
        for individual in store.individuals(&record.id, model, range, false)? {
            let vector = method.behaviour(&individual.features, &individual.embedding);
            behaviours
                .get_or_insert_with(|| Behaviours::new(vector.len()))
                .push(&vector)?;
        }
    }
    Ok(behaviours.unwrap_or_else(|| Behaviours::new(0)))
}
