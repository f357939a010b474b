//! The registry: every campaign of the store, and those at work in this process.

use super::{
    CampaignError, CampaignId, CampaignState, Stage, Weight,
    live::{Live, Progress},
    run::{self, Means, blocking},
};
use crate::{
    checkpoints::Checkpoints,
    dispatch::{Quarantined, Trainers},
    metrics::Metrics,
    store::{CampaignRecord, Notice, Store, StoreError},
    synthetic::SyntheticAnnotator,
};
use murmuration_proto::{CampaignSpec, EmbedderSource, SIMULATOR_VERSION, v1};
use std::{
    collections::BTreeMap,
    sync::Arc,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tokio::{
    sync::{Mutex, watch},
    task::JoinHandle,
};
use tracing::Instrument as _;

/// A campaign as it stands: what is on disk, and what is happening.
#[derive(Debug, Clone)]
pub struct CampaignStatus {
    /// What is on disk.
    pub record: CampaignRecord,
    /// Whether this process works on it.
    pub active: bool,
    /// What it does, or would do next.
    pub stage: Stage,
    /// Of what its stage has in work (a generation, part of a dataset, stored pictures): how much has arrived.
    pub arrived: u32,
    /// Evaluations (or embeddings) a second over the last seconds.
    pub per_second: f64,
    /// How far the training has come, while there is one.
    pub training: Option<v1::TrainingProgress>,
    /// What it waits for before it goes on by itself, such as room on the disk.
    pub waiting: Option<String>,
    /// Workers connected to this coordinator.
    pub workers: usize,
    /// Trainers connected to this coordinator.
    pub trainers: usize,
    /// What somebody should know of it, oldest first: the latest.
    pub notices: Vec<Notice>,
}

/// Handle on the registry; cheap to clone.
#[derive(Debug, Clone)]
pub struct Campaigns {
    pub(super) means: Means,
    /// Campaigns that were started in this process, until somebody looks after they ended. Held while one is
    /// started or stopped, so that no campaign is ever searched twice at once.
    pub(super) at_work: Arc<Mutex<AtWorkById>>,
}

/// Those at work, and those that ended since somebody looked.
pub(super) type AtWorkById = BTreeMap<CampaignId, AtWork>;

#[derive(Debug)]
pub(super) struct AtWork {
    stop: watch::Sender<bool>,
    pub(super) progress: watch::Receiver<Progress>,
    task: JoinHandle<()>,
}

impl Campaigns {
    /// A registry over a store, with nothing at work.
    #[must_use]
    pub fn new(
        trainers: Trainers,
        checkpoints: Checkpoints,
        annotator: SyntheticAnnotator,
        metrics: Metrics,
    ) -> Self {
        let means = Means {
            store: annotator.store.clone(),
            dispatch: annotator.dispatch.clone(),
            trainers,
            checkpoints,
            annotator,
            metrics,
        };
        Self {
            means,
            at_work: Arc::default(),
        }
    }

    /// Stores a campaign and starts it.
    ///
    /// # Errors
    /// If it cannot be stored, or searches with a checkpoint that is not there or does not suit it.
    pub async fn create(&self, spec: CampaignSpec, weight: Weight) -> Result<CampaignStatus, CampaignError> {
        if let Some(&EmbedderSource::Published(checkpoint)) = spec.embedder() {
            self.means.checkpoints.embedder(checkpoint, spec.image()).await?;
        }
        let store = self.means.store.clone();
        let created_ms = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_millis() as u64);
        let record = blocking(move || {
            let id = store.create_campaign(&spec, weight, created_ms)?;
            store.campaign(id.as_str())
        })
        .await??;
        let id = record.id.clone();
        tracing::info!(campaign = %id, "created");
        self.start(&mut *self.at_work.lock().await, record)?;
        self.status(id.as_str()).await
    }

    /// Continues every campaign that was running when its coordinator ended.
    ///
    /// # Errors
    /// If the store cannot be read. A campaign that cannot be continued is logged and left as it is.
    pub async fn resume_interrupted(&self) -> Result<(), CampaignError> {
        let store = self.means.store.clone();
        let records = blocking(move || store.campaigns()).await??;
        let mut at_work = self.at_work.lock().await;
        for record in records
            .into_iter()
            .filter(|record| record.state == CampaignState::Running)
        {
            let id = record.id.clone();
            match self.start(&mut at_work, record) {
                Ok(()) => tracing::info!(campaign = %id, "resumed"),
                Err(error) => tracing::error!(campaign = %id, %error, "cannot be resumed"),
            }
        }
        Ok(())
    }

    /// Whenever workers are found wrong, has those completed campaigns go on that rest on their word; those at work look
    /// themselves. Ends with the dispatcher.
    pub async fn watch_quarantine(self) {
        let mut quarantined = self.means.dispatch.quarantined();
        loop {
            let wrong = quarantined.borrow_and_update().clone();
            if !wrong.is_empty()
                && let Err(error) = self.reopen(wrong).await
            {
                tracing::error!(%error, "completed campaigns cannot be checked for what a wrong worker did");
            }
            if quarantined.changed().await.is_err() {
                return;
            }
        }
    }

    async fn reopen(&self, wrong: Vec<Quarantined>) -> Result<(), CampaignError> {
        let store = self.means.store.clone();
        let mut at_work = self.at_work.lock().await;
        let concerned = blocking(move || {
            store.quarantine(&wrong)?;
            let mut concerned = Vec::new();
            for record in store.campaigns()? {
                if record.state == CampaignState::Completed && !store.suspects(&record.id)?.is_empty() {
                    concerned.push(record);
                }
            }
            Ok::<_, StoreError>(concerned)
        })
        .await??;
        for record in concerned {
            tracing::warn!(campaign = %record.id, "rests on what a wrong worker did: checked again");
            let run = |store: &Store, id: &CampaignId| store.set_state(id, CampaignState::Running, "");
            self.decide(&mut at_work, record, run).await?;
        }
        Ok(())
    }

    /// Every campaign, oldest first.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn list(&self) -> Result<Vec<CampaignStatus>, CampaignError> {
        let store = self.means.store.clone();
        let at_work: BTreeMap<_, _> = self
            .at_work
            .lock()
            .await
            .iter()
            .map(|(id, work)| (id.clone(), work.snapshot()))
            .collect();
        let read = move || {
            let noted = |record: CampaignRecord| Ok((store.notices(&record.id)?, record));
            store
                .campaigns()?
                .into_iter()
                .map(noted)
                .collect::<Result<Vec<_>, StoreError>>()
        };
        let records = blocking(read).await??;
        Ok(records
            .into_iter()
            .map(|(notices, record)| self.merged(at_work.get(&record.id).cloned(), record, notices))
            .collect())
    }

    /// One campaign; `latest` is the newest.
    ///
    /// # Errors
    /// If there is none of that id or the store cannot be read.
    pub async fn status(&self, id: &str) -> Result<CampaignStatus, CampaignError> {
        let id = self.record(id).await?.id;
        let snapshot = self.at_work.lock().await.get(&id).map(AtWork::snapshot);
        let store = self.means.store.clone();
        let (record, notices) = blocking(move || {
            let record = store.campaign(id.as_str())?;
            let notices = store.notices(&record.id)?;
            Ok::<_, StoreError>((record, notices))
        })
        .await??;
        Ok(self.merged(snapshot, record, notices))
    }

    /// Waits until a campaign's status may have changed, at most a second.
    pub async fn changed(&self, id: &CampaignId) {
        let progress = self
            .at_work
            .lock()
            .await
            .get(id)
            .map(|work| work.progress.clone());
        let change = async {
            match progress {
                Some(mut progress) if progress.has_changed().is_ok() => {
                    // An error means that the search has ended, which is a change.
                    let _ = progress.changed().await;
                }
                _ => std::future::pending().await,
            }
        };
        let _ = tokio::time::timeout(Duration::from_secs(1), change).await;
    }

    /// Stops everything at work without changing what the store says of it: it resumes with the next coordinator.
    pub async fn stop(&self) {
        let mut at_work = self.at_work.lock().await;
        while let Some((_, work)) = at_work.pop_first() {
            work.end().await;
        }
    }

    pub(super) async fn record(&self, id: &str) -> Result<CampaignRecord, CampaignError> {
        let (store, id) = (self.means.store.clone(), id.to_owned());
        Ok(blocking(move || store.campaign(&id)).await??)
    }

    pub(super) fn start(
        &self,
        at_work: &mut AtWorkById,
        record: CampaignRecord,
    ) -> Result<(), CampaignError> {
        if record.simulator_version != SIMULATOR_VERSION {
            return Err(CampaignError::OtherSimulator {
                id: record.id,
                theirs: record.simulator_version,
            });
        }
        let (stop, stopped) = watch::channel(false);
        let (sender, progress) = watch::channel(Progress::default());
        let live = Live::new(sender, stopped);
        // Of nobody's request: it goes on after the one that started it, and says itself whose it is.
        let span = tracing::info_span!(parent: None, "campaign", id = %record.id);
        let task = run::run(self.means.clone(), record.id.clone(), live).instrument(span);
        let task = tokio::spawn(task);
        // Of those that have ended nothing is left to tell, but where the store could not take it.
        at_work.retain(|_, work| work.is_busy() || work.progress.borrow().failed.is_some());
        at_work.insert(record.id, AtWork { stop, progress, task });
        Ok(())
    }

    /// The snapshot must have been taken before the record was read: then a search that had ended by the time
    /// of the snapshot has its last word in the record.
    fn merged(
        &self,
        snapshot: Option<Snapshot>,
        mut record: CampaignRecord,
        notices: Vec<Notice>,
    ) -> CampaignStatus {
        let Snapshot { active, progress } = snapshot.unwrap_or_default();
        if let Some(error) = progress.failed {
            record.state = CampaignState::Failed;
            record.error = error;
        }
        CampaignStatus {
            active,
            stage: Stage::of(&record),
            arrived: if active { progress.arrived } else { 0 },
            per_second: if active { progress.per_second } else { 0.0 },
            training: progress.training.filter(|_| active),
            waiting: progress.waiting.filter(|_| active),
            workers: *self.means.dispatch.workers().borrow(),
            trainers: *self.means.trainers.connected().borrow(),
            notices,
            record,
        }
    }
}

/// A search at work, at one instant.
#[derive(Debug, Clone, Default)]
struct Snapshot {
    active: bool,
    progress: Progress,
}

impl AtWork {
    fn snapshot(&self) -> Snapshot {
        Snapshot {
            active: self.is_busy(),
            progress: self.progress.borrow().clone(),
        }
    }

    /// Whether it has not ended.
    pub(super) fn is_busy(&self) -> bool {
        !self.task.is_finished()
    }

    /// Stops the search between two commits and waits until it has stopped.
    pub(super) async fn end(self) {
        self.stop.send_replace(true);
        // A search that panicked has ended too.
        let _ = self.task.await;
    }
}
