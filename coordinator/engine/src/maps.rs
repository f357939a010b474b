//! Two-dimensional maps of behaviours for people: a map on the principal axes at once, and a t-SNE map once it has been computed.
//!
//! A map is kept until the archive grows or changes its version, or until other maps need its room. A forgotten map is computed
//! again, with the same result. No result of a campaign depends on maps.

use crate::space::{Space, SpaceError, Spaces};
use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};
use murmuration_search::{
    interrupt::Interrupt,
    projection::{self, Projection},
};
use murmuration_store::kept::Kept;
use murmuration_tsne::{self as tsne, Points};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Maximum size in bytes of the maps that are kept.
const MOST_BYTES: usize = 64 << 20;

/// Handle on the maps of a coordinator's campaigns; cheap to clone.
#[derive(Debug, Clone)]
pub struct Maps {
    spaces: Spaces,
    /// One lock per campaign, so that concurrent requests project an archive only once.
    kept: Arc<Kept<Mutex<Option<Known>>>>,
    interrupt: Interrupt,
}

#[derive(Debug)]
struct Known {
    of: Version,
    axes: Arc<Projection>,
    neighbours: Neighbours,
    /// Ends the t-SNE, which is useless once the archive has changed.
    interrupt: Interrupt,
}

/// The archive that a map shows: its version, and the number of its individuals.
type Version = (ArchiveVersion, u64);

/// Progress of the t-SNE of an archive.
#[derive(Debug, Clone)]
enum Neighbours {
    Unasked,
    UnderWay,
    Known(Arc<Points>),
}

impl Known {
    fn bytes(&self) -> usize {
        let neighbours = match &self.neighbours {
            Neighbours::Known(points) => points.len(),
            Neighbours::Unasked | Neighbours::UnderWay => 0,
        };
        (self.axes.points.len() + neighbours) * size_of::<[f64; 2]>()
    }
}

impl Maps {
    /// Starts without maps. Raising `interrupt` ends computations early.
    pub fn new(spaces: Spaces, interrupt: Interrupt) -> Self {
        Self::within(spaces, interrupt, MOST_BYTES)
    }

    fn within(spaces: Spaces, interrupt: Interrupt, most_bytes: usize) -> Self {
        Self {
            spaces,
            kept: Arc::new(Kept::within(most_bytes)),
            interrupt,
        }
    }

    /// The map of the archive on its principal axes. The first call for an archive version blocks while the archive is read and
    /// projected.
    pub fn axes(&self, record: &CampaignRecord) -> Result<Arc<Projection>, SpaceError> {
        let kept = self.kept.of(&record.id);
        self.current(record, &mut lock(&kept))
            .map(|known| Arc::clone(&known.axes))
    }

    /// The t-SNE map of the archive; `None` until the map is computed. The first request starts the computation, unless the
    /// archive still grows. Blocks like [`Maps::axes`].
    pub fn neighbours(&self, record: &CampaignRecord) -> Result<Option<Arc<Points>>, SpaceError> {
        if record.state == CampaignState::Running {
            return Ok(None);
        }
        let kept = self.kept.of(&record.id);
        let mut guard = lock(&kept);
        let known = self.current(record, &mut guard)?;
        match &known.neighbours {
            Neighbours::Known(points) => return Ok(Some(Arc::clone(points))),
            Neighbours::UnderWay => return Ok(None),
            Neighbours::Unasked => {}
        }
        let (space, axes, of) = (self.spaces.of(record)?, Arc::clone(&known.axes), known.of);
        if version(&space) != of {
            // The archive has changed already. The next request uses its new version.
            return Ok(None);
        }
        known.neighbours = Neighbours::UnderWay;
        let interrupt = known.interrupt.clone();
        drop(guard);
        let (maps, id) = (self.clone(), record.id.clone());
        // The map is not forgotten while the thread holds it.
        std::thread::spawn(move || {
            let Ok(points) = tsne::embed(&space.behaviours, &axes.points, &interrupt) else {
                return;
            };
            let mut known = lock(&kept);
            if let Some(known) = known.as_mut().filter(|known| known.of == of) {
                known.neighbours = Neighbours::Known(Arc::new(points));
                maps.kept.weigh(&id, known.bytes());
            }
        });
        Ok(None)
    }

    /// The map of the archive up to the individuals in `record`.
    fn current<'a>(
        &self,
        record: &CampaignRecord,
        known: &'a mut Option<Known>,
    ) -> Result<&'a mut Known, SpaceError> {
        let of = (record.archive_version(), record.sampled());
        let current = match known.take() {
            Some(current) if current.of == of => current,
            former => {
                if let Some(former) = former {
                    former.interrupt.raise();
                }
                let space = self.spaces.of(record)?;
                let axes = Arc::new(projection::principal_axes(&space.behaviours, &self.interrupt)?);
                // If the archive changed its version after the record was read, no later request needs this map.
                Known {
                    of: version(&space),
                    axes,
                    neighbours: Neighbours::Unasked,
                    interrupt: self.interrupt.child(),
                }
            }
        };
        self.kept.weigh(&record.id, current.bytes());
        Ok(known.insert(current))
    }
}

fn version(space: &Space) -> Version {
    (space.archive_version, space.behaviours.len() as u64)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
