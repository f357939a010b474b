//! Where behaviours lie in two dimensions, for people to look at: on the principal axes at once, by t-SNE once that has
//! been computed.
//!
//! Maps are kept for as long as they are true: until the archive grows or another edition of it begins. No result rests on
//! them. Knows nothing of pages.

mod neighbours;

use crate::{
    campaign::{CampaignId, CampaignState},
    projection::{self, Projection},
    space::{Space, SpaceError},
    store::{CampaignRecord, Edition, Store},
};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// Handle on the maps of a coordinator's campaigns; cheap to clone.
#[derive(Debug, Clone)]
pub struct Maps {
    store: Store,
    known: Arc<Mutex<BTreeMap<CampaignId, Known>>>,
}

/// Points by index, in units of their own.
pub type Points = Vec<[f64; 2]>;

/// What is known of one campaign.
#[derive(Debug)]
struct Known {
    of: Version,
    space: Arc<Space>,
    axes: Arc<Projection>,
    neighbours: Neighbours,
}

/// What a map is a map of.
type Version = (Edition, u64);

/// How far the t-SNE of an archive has come.
#[derive(Debug, Clone)]
enum Neighbours {
    Unasked,
    UnderWay,
    Known(Arc<Points>),
}

impl Maps {
    /// Nothing is known yet.
    #[must_use]
    pub fn new(store: Store) -> Self {
        Self {
            store,
            known: Arc::default(),
        }
    }

    /// The archive on its principal axes. Blocks while it is read and projected, once a version of it.
    ///
    /// # Errors
    /// See [`SpaceError`].
    pub fn axes(&self, record: &CampaignRecord) -> Result<Arc<Projection>, SpaceError> {
        Ok(self.current(record)?.1)
    }

    /// The archive by t-SNE; `None` while that is computed, which begins when it is asked for first, but not while the
    /// archive grows. Blocks as [`Maps::axes`].
    ///
    /// # Errors
    /// See [`SpaceError`].
    pub fn neighbours(&self, record: &CampaignRecord) -> Result<Option<Arc<Points>>, SpaceError> {
        if record.state == CampaignState::Running {
            return Ok(None);
        }
        let (space, axes) = self.current(record)?;
        let of = version(record);
        let mut known = self.lock();
        let Some(entry) = known.get_mut(&record.id).filter(|entry| entry.of == of) else {
            // It has moved on already; whoever asks again asks about what there is then.
            return Ok(None);
        };
        match &entry.neighbours {
            Neighbours::Known(points) => return Ok(Some(Arc::clone(points))),
            Neighbours::UnderWay => return Ok(None),
            Neighbours::Unasked => entry.neighbours = Neighbours::UnderWay,
        }
        drop(known);
        let (maps, id) = (self.clone(), record.id.clone());
        std::thread::spawn(move || {
            let points = neighbours::embed(&space.behaviours, &axes.points);
            let mut known = maps.lock();
            if let Some(entry) = known.get_mut(&id).filter(|entry| entry.of == of) {
                entry.neighbours = Neighbours::Known(Arc::new(points));
            }
        });
        Ok(None)
    }

    fn current(&self, record: &CampaignRecord) -> Result<(Arc<Space>, Arc<Projection>), SpaceError> {
        let of = version(record);
        if let Some(known) = self.lock().get(&record.id).filter(|known| known.of == of) {
            return Ok((Arc::clone(&known.space), Arc::clone(&known.axes)));
        }
        let space = Arc::new(Space::read(&self.store, record)?);
        let axes = Arc::new(projection::principal_axes(&space.behaviours));
        // A switch after the record was read is another version, which nobody will ask this for.
        let of = (space.edition, of.1);
        let known = Known {
            of,
            space: Arc::clone(&space),
            axes: Arc::clone(&axes),
            neighbours: Neighbours::Unasked,
        };
        self.lock().insert(record.id.clone(), known);
        Ok((space, axes))
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<CampaignId, Known>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn version(record: &CampaignRecord) -> Version {
    (record.edition(), record.individuals())
}

#[cfg(test)]
mod tests;
