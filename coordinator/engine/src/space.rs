//! The behaviour space of an archive, for novelty, questions and maps.

use murmuration_model::{ArchiveVersion, CampaignRecord};
use murmuration_search::{
    interrupt::Interrupted,
    novelty::{Behaviours, Misfit},
};
use murmuration_store::{Store, StoreError, kept::Kept};
use murmuration_swarm::Scale;
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum size in bytes of the spaces that are kept.
const MOST_BYTES: usize = 128 << 20;

/// Number of individuals that are read from the store at a time.
const CHUNK: u64 = 4096;

/// The behaviours of an archive or of its sample, all in one space.
#[derive(Debug, Clone, PartialEq)]
pub struct Space {
    /// One behaviour per individual, by index; with a sample, one per individual of the sample.
    pub behaviours: Behaviours,
    /// The scale of `behaviours`, which also maps behaviours from elsewhere into the space.
    pub scale: Scale,
    pub archive_version: ArchiveVersion,
}

/// Why there is no behaviour space.
#[derive(Debug, thiserror::Error)]
pub enum SpaceError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("the archive holds vectors that cannot be compared: {0}")]
    Misfit(#[from] Misfit),
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl Space {
    /// Reads the archive up to the individuals in `record`. If the archive's version changes meanwhile, the archive is read
    /// again.
    pub fn read(store: &Store, record: &CampaignRecord) -> Result<Self, SpaceError> {
        Self::read_on(store, record, None)
    }

    /// Like [`Space::read`], but reuses the `known` behaviours of the same archive version.
    fn read_on(store: &Store, record: &CampaignRecord, known: Option<&Self>) -> Result<Self, SpaceError> {
        let archive_version =
            || -> Result<_, StoreError> { Ok(store.campaign(record.id.as_str())?.archive_version()) };
        let mut before = archive_version()?;
        loop {
            let len = record.sampled();
            // The scale is computed from the first generation, so it is known once there is an individual.
            let begun = known.filter(|known| {
                known.archive_version == before
                    && known.behaviours.len() as u64 <= len
                    && !known.behaviours.is_empty()
            });
            let read = match begun {
                Some(known) => Ok((known.scale, known.behaviours.clone())),
                None => store.scale(record).map(|scale| (scale, Behaviours::new(0))),
            };
            let read = read
                .map_err(SpaceError::from)
                .and_then(|(scale, known)| Ok((scale, behaviours(store, record, &scale, known)?)));
            let after = archive_version()?;
            // Behaviours of two archive versions do not make one space.
            if before == after {
                let (scale, behaviours) = read?;
                return Ok(Self {
                    behaviours,
                    scale,
                    archive_version: after,
                });
            }
            before = after;
        }
    }

    pub fn bytes(&self) -> usize {
        self.behaviours.len() * self.behaviours.dims() * size_of::<f64>()
    }
}

/// The spaces of archives; cheap to clone. Only new individuals are read for a space that is kept.
#[derive(Debug, Clone)]
pub struct Spaces {
    pub store: Store,
    /// One lock per campaign, so that concurrent requests read new individuals only once.
    kept: Arc<Kept<Mutex<Option<Arc<Space>>>>>,
}

impl Spaces {
    /// Starts without spaces.
    pub fn new(store: Store) -> Self {
        Self {
            store,
            kept: Arc::new(Kept::within(MOST_BYTES)),
        }
    }

    /// The space of the archive up to the individuals in `record`. Blocks while the archive is read.
    pub fn of(&self, record: &CampaignRecord) -> Result<Arc<Space>, SpaceError> {
        let kept = self.kept.of(&record.id);
        let mut known = kept.lock().unwrap_or_else(PoisonError::into_inner);
        let is = |space: &Arc<Space>| {
            space.archive_version == record.archive_version()
                && space.behaviours.len() as u64 == record.sampled()
        };
        if let Some(space) = known.as_ref().filter(|space| is(space)) {
            return Ok(Arc::clone(space));
        }
        let space = Arc::new(Space::read_on(&self.store, record, known.as_deref())?);
        *known = Some(Arc::clone(&space));
        self.kept.weigh(&record.id, space.bytes());
        Ok(space)
    }
}

/// The behaviours of an archive, appended to the behaviours in `known`.
fn behaviours(
    store: &Store,
    record: &CampaignRecord,
    scale: &Scale,
    known: Behaviours,
) -> Result<Behaviours, SpaceError> {
    let mut behaviours = known;
    let (begun, len) = (behaviours.len() as u64, record.sampled());
    for start in (begun..len).step_by(CHUNK as usize) {
        let range = start..len.min(start + CHUNK);
        for individual in store.individuals(&record.id, record.spec.model(), range, false)? {
            let vector = individual.behaviour(scale);
            if behaviours.is_empty() {
                behaviours = Behaviours::new(vector.len());
            }
            behaviours.push(&vector)?;
        }
    }
    Ok(behaviours)
}
