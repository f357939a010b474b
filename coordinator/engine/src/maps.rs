//! Two-dimensional maps of behaviours for people: a map on the principal axes at once, and a t-SNE map once it has been computed.
//!
//! A map is kept until the archive grows or changes its version, or until other maps need its room. A forgotten map is computed
//! again, with the same result. No result of a campaign depends on maps. A t-SNE map is long work of the client that asked first
//! (see [`LongTurn`]), and is computed only for as long as somebody keeps asking. While the client has another map in work, the map
//! waits for the next request.

use crate::{
    blocking::{Broken, LongTurn, in_background, outlive, parallel},
    space::{Space, SpaceError, Spaces},
};
use murmuration_model::{ArchiveVersion, CampaignId, CampaignRecord, CampaignState};
use murmuration_search::{
    interrupt::Interrupt,
    projection::{self, Projection},
};
use murmuration_store::kept::Kept;
use murmuration_tsne::{self as tsne, Points};
use std::{
    collections::HashMap,
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
    /// The time of the last request for the t-SNE map of each campaign, kept for [`WANTED_FOR`].
    asked: Arc<Mutex<HashMap<CampaignId, Instant>>>,
    interrupt: Interrupt,
}

#[derive(Debug)]
struct Known {
    of: Version,
    axes: Arc<Projection>,
    /// Locked only for a moment, unlike the map itself.
    neighbours: Arc<Mutex<Neighbours>>,
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

/// Answer to a request for a t-SNE map.
enum Asked {
    Known(Arc<Points>),
    UnderWay,
    /// The map is to be computed, in this turn.
    Wanted(Wanted, LongTurn),
}

/// A t-SNE map that is to be computed. If it is dropped before that, the next request asks for the map again.
struct Wanted {
    space: Arc<Space>,
    axes: Arc<Projection>,
    neighbours: Arc<Mutex<Neighbours>>,
    interrupt: Interrupt,
}

impl Drop for Wanted {
    fn drop(&mut self) {
        let mut neighbours = lock(&self.neighbours);
        if matches!(*neighbours, Neighbours::UnderWay) {
            *neighbours = Neighbours::Unasked;
        }
    }
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    #[error(transparent)]
    Space(#[from] SpaceError),
    #[error(transparent)]
    Broken(#[from] Broken),
}

impl Known {
    fn bytes(&self) -> usize {
        let neighbours = match &*lock(&self.neighbours) {
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
            asked: Arc::default(),
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

    /// Notes that somebody asks for the t-SNE map of a campaign. Call this before anything else of a request, because a request
    /// may wait for its client's other work.
    pub fn somebody_asks(&self, campaign: &CampaignId) {
        let mut asked = lock(&self.asked);
        asked.retain(|_, at| at.elapsed() < WANTED_FOR);
        asked.insert(campaign.clone(), Instant::now());
    }

    fn is_wanted(&self, campaign: &CampaignId) -> bool {
        let asked = lock(&self.asked);
        asked.get(campaign).is_some_and(|at| at.elapsed() < WANTED_FOR)
    }

    /// The t-SNE map of the archive; `None` until the map is computed. The first request starts the computation, unless the
    /// archive still grows. The computation ends early if nobody asks for the map for 20 s.
    ///
    /// # Errors
    /// If the archive cannot be read.
    pub async fn neighbours(&self, record: &CampaignRecord) -> Result<Option<Arc<Points>>, MapError> {
        if record.state == CampaignState::Running {
            return Ok(None);
        }
        self.somebody_asks(&record.id);
        let turn = LongTurn::free();
        let (maps, of) = (self.clone(), record.clone());
        match in_background(move |_| maps.ask(&of, turn)).await?? {
            Asked::Known(points) => return Ok(Some(points)),
            Asked::UnderWay => {}
            Asked::Wanted(wanted, turn) => {
                let (maps, id) = (self.clone(), record.id.clone());
                outlive(async move { maps.arrange(&id, wanted, turn).await });
            }
        }
        Ok(None)
    }

    /// Notes that the map is under way if `turn` allows this.
    fn ask(&self, record: &CampaignRecord, turn: Option<LongTurn>) -> Result<Asked, SpaceError> {
        let kept = self.kept.of(&record.id);
        let mut guard = lock(&kept);
        let known = self.current(record, &mut guard)?;
        match &*lock(&known.neighbours) {
            Neighbours::Known(points) => return Ok(Asked::Known(Arc::clone(points))),
            Neighbours::UnderWay => return Ok(Asked::UnderWay),
            Neighbours::Unasked => {}
        }
        let Some(turn) = turn else {
            return Ok(Asked::UnderWay);
        };
        let space = self.spaces.of(record)?;
        if version(&space) != known.of {
            // The archive has changed already. The next request uses its new version.
            return Ok(Asked::UnderWay);
        }
        *lock(&known.neighbours) = Neighbours::UnderWay;
        let wanted = Wanted {
            space,
            axes: Arc::clone(&known.axes),
            neighbours: Arc::clone(&known.neighbours),
            interrupt: known.interrupt.child(),
        };
        Ok(Asked::Wanted(wanted, turn))
    }

    /// Computes a t-SNE map until the map is done or nobody wants it any more.
    async fn arrange(&self, campaign: &CampaignId, wanted: Wanted, turn: LongTurn) {
        // The map is not forgotten while this task holds it.
        let _kept = self.kept.of(campaign);
        let (interrupt, neighbours) = (wanted.interrupt.clone(), Arc::clone(&wanted.neighbours));
        let compute = move || {
            let Wanted {
                space,
                axes,
                interrupt,
                ..
            } = &wanted;
            let points = parallel(|| tsne::embed(&space.behaviours, &axes.points, interrupt)).ok()?;
            let bytes = (axes.points.len() + points.len()) * size_of::<[f64; 2]>();
            *lock(&wanted.neighbours) = Neighbours::Known(Arc::new(points));
            Some(bytes)
        };
        let computed = turn.run(compute);
        tokio::pin!(computed);
        let bytes = loop {
            tokio::select! {
                computed = &mut computed => break computed.ok().flatten(),
                () = tokio::time::sleep(WANTED_FOR / 4) => {
                    if !self.is_wanted(campaign) {
                        interrupt.raise();
                        return;
                    }
                }
            }
        };
        // A map of another version may have replaced this one meanwhile.
        if let Some(bytes) = bytes.filter(|_| Arc::strong_count(&neighbours) > 1) {
            self.kept.weigh(campaign, bytes);
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
                    neighbours: Arc::new(Mutex::new(Neighbours::Unasked)),
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
