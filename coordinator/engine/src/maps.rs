//! Two-dimensional maps of behaviours for people: a map on the principal axes at once, and a t-SNE map once it has been computed.
//!
//! A map is kept until the archive grows or changes its version, or until other maps need its room. A forgotten map is computed
//! again, with the same result. No result of a campaign depends on maps. A t-SNE map is computed in the turns of the client that
//! asked first, and holds its seat; it is computed only for as long as somebody keeps asking.

use crate::{
    blocking::{Broken, in_background, parallel, spawn},
    space::{Space, SpaceError, Spaces},
};
use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};
use murmuration_search::{
    interrupt::Interrupt,
    projection::{self, Projection},
};
use murmuration_store::kept::Kept;
use murmuration_tsne::{self as tsne, Points};
use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

/// Maximum size in bytes of the maps that are kept.
const MOST_BYTES: usize = 64 << 20;

/// Time for which a t-SNE map is computed after somebody asked for it.
const WANTED_FOR: Duration = Duration::from_secs(20);

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
    UnderWay {
        /// Time of the last request.
        asked: Instant,
    },
    Known(Arc<Points>),
}

/// Answer to a request for a t-SNE map.
enum Asked {
    Known(Arc<Points>),
    UnderWay,
    /// The map is to be computed.
    Wanted(Wanted),
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    #[error(transparent)]
    Space(#[from] SpaceError),
    #[error(transparent)]
    Broken(#[from] Broken),
}

/// A t-SNE map that somebody asked for.
struct Wanted {
    of: Version,
    space: Arc<Space>,
    axes: Arc<Projection>,
    interrupt: Interrupt,
}

impl Known {
    fn bytes(&self) -> usize {
        let neighbours = match &self.neighbours {
            Neighbours::Known(points) => points.len(),
            Neighbours::Unasked | Neighbours::UnderWay { .. } => 0,
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
    /// archive still grows. The computation ends early if nobody asks for the map for [`WANTED_FOR`].
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub async fn neighbours(&self, record: &CampaignRecord) -> Result<Option<Arc<Points>>, MapError> {
        if record.state == CampaignState::Running {
            return Ok(None);
        }
        let (maps, of) = (self.clone(), record.clone());
        let wanted = match in_background(move |_| maps.ask(&of)).await?? {
            Asked::Known(points) => return Ok(Some(points)),
            Asked::UnderWay => return Ok(None),
            Asked::Wanted(wanted) => wanted,
        };
        let (maps, record) = (self.clone(), record.clone());
        spawn(async move { maps.arrange(&record, wanted).await });
        Ok(None)
    }

    /// Notes that somebody asks for the t-SNE map.
    fn ask(&self, record: &CampaignRecord) -> Result<Asked, SpaceError> {
        let kept = self.kept.of(&record.id);
        let mut guard = lock(&kept);
        let known = self.current(record, &mut guard)?;
        match &mut known.neighbours {
            Neighbours::Known(points) => return Ok(Asked::Known(Arc::clone(points))),
            Neighbours::UnderWay { asked } => {
                *asked = Instant::now();
                return Ok(Asked::UnderWay);
            }
            Neighbours::Unasked => {}
        }
        let (space, axes, of) = (self.spaces.of(record)?, Arc::clone(&known.axes), known.of);
        if version(&space) != of {
            // The archive has changed already. The next request uses its new version.
            return Ok(Asked::UnderWay);
        }
        known.neighbours = Neighbours::UnderWay {
            asked: Instant::now(),
        };
        Ok(Asked::Wanted(Wanted {
            of,
            space,
            axes,
            interrupt: known.interrupt.clone(),
        }))
    }

    /// Computes a t-SNE map until the map is done or nobody wants it any more.
    async fn arrange(&self, record: &CampaignRecord, wanted: Wanted) {
        let of = wanted.of;
        // The map is not forgotten while this task holds it.
        let kept = self.kept.of(&record.id);
        let interrupt = wanted.interrupt.clone();
        let compute = move |_: &Interrupt| {
            parallel(|| tsne::embed(&wanted.space.behaviours, &wanted.axes.points, &wanted.interrupt))
        };
        let computed = in_background(compute);
        tokio::pin!(computed);
        let computed = loop {
            tokio::select! {
                computed = &mut computed => break computed.ok().and_then(Result::ok),
                () = tokio::time::sleep(WANTED_FOR / 4) => {
                    if !is_wanted(&kept, of) {
                        // The loop goes on until the thread has noticed: this task holds the client's seat for the thread.
                        interrupt.raise();
                    }
                }
            }
        };
        let mut known = lock(&kept);
        let Some(known) = known.as_mut().filter(|known| known.of == of) else {
            return;
        };
        match computed {
            Some(points) => {
                known.neighbours = Neighbours::Known(Arc::new(points));
                self.kept.weigh(&record.id, known.bytes());
            }
            None => {
                known.neighbours = Neighbours::Unasked;
                known.interrupt = self.interrupt.child();
            }
        }
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
                let axes = parallel(|| projection::principal_axes(&space.behaviours, &self.interrupt));
                let axes = Arc::new(axes?);
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

/// Whether somebody asked lately for the t-SNE map of this version of an archive.
fn is_wanted(kept: &Mutex<Option<Known>>, of: Version) -> bool {
    lock(kept).as_ref().is_some_and(|known| {
        known.of == of
            && matches!(known.neighbours, Neighbours::UnderWay { asked } if asked.elapsed() < WANTED_FOR)
    })
}

fn version(space: &Space) -> Version {
    (space.archive_version, space.behaviours.len() as u64)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
