//! All campaigns of the store, and the runs of campaigns in this process.

use super::{
    CampaignError,
    context::StageContext,
    metrics::CampaignMetrics,
    preconditions::check_simulator,
    registry::{AtWork, Deciding, Registry, Snapshot},
    run,
    run_handle::{Progress, RunHandle, held_up_by},
};
use crate::synthetic::SyntheticAnnotator;
use murmuration_dispatch::{ConnectedMachine, Evaluated, EvaluationJob, JobError, Load, Trainers};
use murmuration_model::{
    CampaignHead, CampaignId, CampaignRecord, CampaignState, NewCampaign, Quarantined, Stage, TimeLeft,
    WorkLeft,
};
use murmuration_proto::v1;
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{Notice, Started, Store, StoreError, checkpoints::Checkpoints};
use murmuration_swarm::{Controller, EmbedderSource, Evaluation, Feedback, World};
use std::{
    sync::Arc,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tokio::sync::watch;
use tracing::Instrument as _;

/// The status of a campaign: its state on disk, and the progress of its run.
#[derive(Debug, Clone)]
pub struct CampaignStatus {
    pub record: CampaignRecord,
    /// Whether this process works on the campaign.
    pub active: bool,
    /// The current stage; if the campaign does not run, the stage that it would resume with.
    pub stage: Stage,
    /// Number of results that have arrived for the stage's current job (a generation, part of a dataset, or stored pictures).
    pub arrived: u32,
    /// Evaluations (or embeddings) per second, averaged over the last few seconds.
    pub per_second: f64,
    /// Progress of the current training; `None` outside a training.
    pub training: Option<v1::TrainingProgress>,
    /// The missing resource that the campaign waits for, such as disk space or a worker.
    pub waiting: Option<String>,
    pub workers: usize,
    pub trainers: usize,
    /// The latest notices, oldest first.
    pub notices: Vec<Notice>,
}

impl CampaignStatus {
    /// Progress of the current stage; `None` before a trainer has reported its epochs.
    pub fn progress(&self) -> Option<v1::StageProgress> {
        let (record, arrived) = (&self.record, u64::from(self.arrived));
        let (spec, archived) = (&record.spec, record.individuals());
        let (done, total, unit) = match (self.stage, spec.embedder()) {
            (Stage::Dataset, Some(EmbedderSource::Trained { dataset, .. })) => {
                (record.dataset_done() + arrived, dataset.pictures(), "picture")
            }
            (Stage::Pretrain | Stage::FineTune, _) => {
                let training = self.training?;
                (training.epoch, training.epochs, "epoch")
            }
            (Stage::Embed, _) => (record.embedder.embedded() + arrived, archived, "picture"),
            (Stage::Label, _) => {
                let wanted = spec.feedback().map_or(0, Feedback::labels);
                (arrived, wanted.into(), "label")
            }
            (Stage::Evolve, _) => (archived + arrived, record.evaluations(), "evaluation"),
            (Stage::Taxonomy | Stage::Dataset, _) => (archived, record.evaluations(), "evaluation"),
        };
        let done = done.min(total);
        Some(v1::StageProgress {
            done,
            total,
            unit: unit.to_owned(),
            seconds_left: match self.training {
                _ if !self.active => None,
                Some(training) => training.seconds_left,
                None => (self.per_second > 0.0).then(|| (total - done) as f64 / self.per_second),
            },
        })
    }

    /// How long the whole campaign still takes; `None` if unknown.
    pub fn time_left(&self) -> Option<TimeLeft> {
        let record = &self.record;
        let left = WorkLeft {
            spec: &record.spec,
            stage: self.stage,
            generations_done: record.generations_done,
            arrived: self.arrived,
            rounds_done: record.rounds.done,
            is_learning: record.rounds.current_cutoff.is_some(),
            per_second: self.per_second,
            stage_seconds: self.progress().and_then(|progress| progress.seconds_left),
        };
        left.whole().filter(|_| self.active)
    }
}

/// Pause after which a quarantine that could not be stored is stored again: the disk may be full.
const CHECKED_AGAIN_AFTER: Duration = Duration::from_secs(10);

/// A campaign in a list that is not yet split into pages.
#[derive(Debug, Clone)]
pub struct ListedCampaign {
    pub head: CampaignHead,
    /// Whether this process works on the campaign.
    pub active: bool,
    /// Whether the campaign waits for a resource. It continues by itself once it has the resource.
    pub waiting: bool,
}

/// Every campaign of a store; cheap to clone.
#[derive(Debug, Clone)]
pub struct Campaigns {
    pub(super) context: StageContext,
    interrupt: Interrupt,
}

impl Campaigns {
    /// Starts without runs. Raising `interrupt` ends the campaigns' computations early.
    pub fn new(
        trainers: Trainers,
        checkpoints: Checkpoints,
        annotator: SyntheticAnnotator,
        metrics: CampaignMetrics,
        interrupt: Interrupt,
    ) -> Self {
        let context = StageContext {
            store: annotator.store.clone(),
            dispatch: annotator.dispatch.clone(),
            trainers,
            checkpoints,
            annotator,
            metrics,
            registry: Registry::default(),
        };
        Self { context, interrupt }
    }

    /// Stores a campaign and starts it. A repeated request changes nothing: the existing campaign continues.
    ///
    /// # Errors
    /// If the campaign cannot be stored, or its published checkpoint is missing or unsuitable.
    pub async fn create(&self, new: NewCampaign) -> Result<CampaignStatus, CampaignError> {
        if let Some(&EmbedderSource::Published(checkpoint)) = new.spec.embedder() {
            self.context
                .checkpoints
                .embedder(checkpoint, new.spec.image())
                .await?;
        }
        let created_ms = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_millis() as u64);
        let campaigns = self.clone();
        // This runs in a separate task, so that a stored campaign starts even if the client has disconnected.
        let creating = async move {
            let store = &campaigns.context.store;
            let started = store.run(move |store| store.start_campaign(&new, created_ms));
            let Started { id, is_new } = match started.await {
                // A stored decision is carried out even if the mirror lacks it.
                Err(error) if error.is_stored() => {
                    campaigns.resume_interrupted().await?;
                    return Err(error.into());
                }
                started => started?,
            };
            if is_new {
                tracing::info!(campaign = %id, "created");
            }
            // The campaign may have been cancelled by now.
            campaigns
                .go_on(&campaigns.context.registry.deciding(&id).await)
                .await?;
            campaigns.status(id.as_str()).await
        };
        let created = tokio::spawn(creating.in_current_span()).await;
        created.map_err(|_| CampaignError::Broken)?
    }

    /// Continues every campaign that was running when its coordinator ended, unless a person has since paused or cancelled it.
    ///
    /// # Errors
    /// If the store cannot be read. A campaign that cannot be continued is logged and left unchanged.
    pub async fn resume_interrupted(&self) -> Result<(), CampaignError> {
        let records = self.context.store.run(Store::campaigns).await?;
        let running = records
            .into_iter()
            .filter(|record| record.state == CampaignState::Running);
        for CampaignRecord { id, .. } in running {
            // A person may have decided about the campaign since the records were read.
            match self.go_on(&self.context.registry.deciding(&id).await).await {
                Ok(true) => tracing::info!(campaign = %id, "resumed"),
                Ok(false) => {}
                Err(error) => tracing::error!(campaign = %id, %error, "cannot be resumed"),
            }
        }
        Ok(())
    }

    /// Records quarantined workers and trainers, and reopens completed campaigns that contain their results. Running campaigns
    /// check their own results. A machine that was wrong as a trainer is quarantined as a worker too, and the other way round.
    /// This function ends when the dispatcher ends.
    pub async fn watch_quarantine(self) {
        let mut workers = self.context.dispatch.quarantined();
        let mut trainers = self.context.trainers.quarantined();
        loop {
            let mut wrong = workers.borrow_and_update().clone();
            wrong.extend(trainers.borrow_and_update().iter().cloned());
            let checked = match wrong.is_empty() {
                true => Ok(()),
                false => {
                    // The dispatchers come first: what the store knows, and no dispatcher, would not be computed again.
                    self.context.dispatch.mistrust(wrong.clone()).await;
                    self.context.trainers.dispatch().mistrust(wrong.clone()).await;
                    self.reopen(wrong).await
                }
            };
            if let Err(error) = &checked {
                tracing::error!(%error, "completed campaigns cannot be checked for results of wrong workers");
            }
            let changed = tokio::select! {
                changed = workers.changed() => changed,
                changed = trainers.changed() => changed,
                () = tokio::time::sleep(CHECKED_AGAIN_AFTER), if checked.is_err() => Ok(()),
            };
            if changed.is_err() {
                return;
            }
        }
    }

    async fn reopen(&self, wrong: Vec<Quarantined>) -> Result<(), CampaignError> {
        let concerned = move |store: &Store| -> Result<_, StoreError> {
            // The quarantine is stored before the campaigns are checked: a campaign that completes later checks its own results.
            store.quarantine(&wrong)?;
            let mut concerned = Vec::new();
            for record in store.campaigns()? {
                if record.state == CampaignState::Completed && !store.suspects(&record.id)?.is_empty() {
                    concerned.push(record);
                }
            }
            Ok(concerned)
        };
        let mut refused = None;
        for record in self.context.store.run(concerned).await? {
            tracing::warn!(campaign = %record.id, "uses results of a wrong worker: checked again");
            match self.check_again(&record).await {
                Ok(()) => {}
                Err(CampaignError::Store(error)) => refused = Some(error),
                Err(error) => tracing::error!(campaign = %record.id, %error, "cannot be checked again"),
            }
        }
        refused.map_or(Ok(()), |error| Err(error.into()))
    }

    async fn check_again(&self, record: &CampaignRecord) -> Result<(), CampaignError> {
        check_simulator(record)?;
        let deciding = self.context.registry.deciding(&record.id).await;
        let id = record.id.clone();
        // A stored change is carried out even if the mirror lacks it.
        let (reopened, unmirrored) = match self.context.store.run(move |store| store.reopen(&id)).await {
            Err(error) if error.is_stored() => (true, Some(error)),
            reopened => (reopened?, None),
        };
        if reopened {
            self.context.registry.stop(&deciding);
            self.go_on(&deciding).await?;
        }
        unmirrored.map_or(Ok(()), |error| Err(error.into()))
    }

    /// For each campaign, oldest first, the fields that a search of the list uses.
    pub async fn heads(&self) -> Result<Vec<ListedCampaign>, CampaignError> {
        let at_work = self.context.registry.snapshots();
        let heads = self.context.store.run(Store::campaign_heads).await?;
        let listed = |mut head: CampaignHead| {
            let Snapshot { active, progress } = at_work.get(&head.id).cloned().unwrap_or_default();
            if progress.failed.is_some() && head.state == CampaignState::Running {
                head.state = CampaignState::Failed;
            }
            let waiting = active && held_up_by(progress.disk, progress.waiting).is_some();
            ListedCampaign {
                head,
                active,
                waiting,
            }
        };
        Ok(heads.into_iter().map(listed).collect())
    }

    /// The status of each campaign in `ids`, in that order. Campaigns that no longer exist are skipped.
    pub async fn statuses(&self, ids: Vec<CampaignId>) -> Result<Vec<CampaignStatus>, CampaignError> {
        let at_work = self.context.registry.snapshots();
        let read = move |store: &Store| -> Result<Vec<_>, StoreError> {
            let mut read = Vec::with_capacity(ids.len());
            for id in ids {
                match store.campaign(id.as_str()) {
                    Ok(record) => read.push((store.notices(&id)?, record)),
                    Err(StoreError::NoCampaign(_)) => {}
                    Err(error) => return Err(error),
                }
            }
            Ok(read)
        };
        let records = self.context.store.run(read).await?;
        let merged = records.into_iter().map(|(notices, record)| {
            let snapshot = at_work.get(&record.id).cloned().unwrap_or_default();
            self.merged(snapshot, record, notices)
        });
        Ok(merged.collect())
    }

    /// One campaign; `latest` is the newest campaign without a study.
    ///
    /// # Errors
    /// If there is no such campaign or the store cannot be read.
    pub async fn status(&self, id: &str) -> Result<CampaignStatus, CampaignError> {
        let id = self.record(id).await?.id;
        let snapshot = self.context.registry.snapshot(&id);
        let read = move |store: &Store| -> Result<_, StoreError> {
            let record = store.campaign(id.as_str())?;
            let notices = store.notices(&record.id)?;
            Ok((record, notices))
        };
        let (record, notices) = self.context.store.run(read).await?;
        Ok(self.merged(snapshot, record, notices))
    }

    /// The statuses of the campaigns that this process works on.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn at_work(&self) -> Result<Vec<CampaignStatus>, CampaignError> {
        let at_work = self.context.registry.snapshots().into_iter();
        let active = at_work.filter(|(_, snapshot)| snapshot.active);
        self.statuses(active.map(|(id, _)| id).collect()).await
    }

    /// How busy the dispatcher of workers is.
    pub async fn load(&self) -> Load {
        self.context.dispatch.load().await
    }

    /// The workers and trainers that are connected to this coordinator, each by name.
    pub async fn machines(&self) -> (Vec<ConnectedMachine>, Vec<ConnectedMachine>) {
        tokio::join!(
            self.context.dispatch.connected(),
            self.context.trainers.machines()
        )
    }

    /// Waits until a campaign's status may have changed, for at most a second.
    pub async fn changed(&self, id: &CampaignId) {
        let progress = self.context.registry.progress(id);
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

    /// Stops every run and leaves the campaigns' states in the store unchanged, so that they resume with the next coordinator.
    pub async fn stop(&self) {
        self.context.registry.end().await;
    }

    pub(super) async fn record(&self, id: &str) -> Result<CampaignRecord, CampaignError> {
        let id = id.to_owned();
        Ok(self.context.store.run(move |store| store.campaign(&id)).await?)
    }

    /// Begins a run of a campaign after its former run has ended.
    pub(super) fn start(&self, deciding: &Deciding, record: &CampaignRecord) -> Result<(), CampaignError> {
        check_simulator(record)?;
        let (stop, stopped) = watch::channel(false);
        let (sender, progress) = watch::channel(Progress::default());
        let interrupt = self.interrupt.child();
        let handle = RunHandle::new(
            sender,
            stopped,
            self.context.dispatch.workers(),
            interrupt.clone(),
        );
        let run = record.run_id();
        let context = self.context.during(run.clone());
        // The span has no parent: the run outlives the request that started it, and names its campaign itself.
        let span = tracing::info_span!(parent: None, "campaign", id = %record.id);
        self.context.registry.start(deciding, |former| {
            let work = async move {
                if let Some(former) = former {
                    // A run that panicked has ended too.
                    let _ = former.await;
                }
                run::run(context, run, handle).await;
            };
            AtWork {
                stop,
                interrupt,
                progress,
                task: tokio::spawn(work.instrument(span)),
            }
        });
        Ok(())
    }

    /// Evaluates a controller on a worker in a given world, with a campaign's picture format and embedder, while a client waits.
    /// Nothing is stored.
    ///
    /// # Errors
    /// If no worker is connected for a while, the evaluation fails, or the campaign's checkpoint cannot be read.
    pub async fn evaluate_elsewhere(
        &self,
        record: &CampaignRecord,
        controller: Controller,
        seed: u64,
        world: World,
    ) -> Result<Evaluation, CampaignError> {
        let job = EvaluationJob {
            model: controller.model().clone(),
            world,
            submitter: None,
            ..EvaluationJob::of(
                record,
                self.context.embedder(record).await?,
                vec![(controller, seed)],
            )
        };
        let dispatch = &self.context.dispatch;
        let evaluated = dispatch.while_staffed(dispatch.evaluate(job, Arc::default()));
        match evaluated.await??.pop() {
            Some(Evaluated::Done { trials, .. }) => {
                let trial = trials.into_iter().next().ok_or(CampaignError::Broken)?;
                Ok(trial.decompressed().map_err(StoreError::Compression)?)
            }
            Some(Evaluated::Poisoned(reason)) => Err(JobError::Poisoned(reason).into()),
            None => Err(CampaignError::Broken),
        }
    }

    /// The snapshot must be older than the record. If the run had ended when the snapshot was taken, the record then contains the
    /// run's final state.
    fn merged(
        &self,
        Snapshot { active, progress }: Snapshot,
        mut record: CampaignRecord,
        notices: Vec<Notice>,
    ) -> CampaignStatus {
        // The store could not write that the campaign failed. If the record is no longer `Running`, a later decision changed its
        // state.
        if let Some(error) = progress.failed
            && record.state == CampaignState::Running
        {
            record.state = CampaignState::Failed;
            record.error = error;
        }
        CampaignStatus {
            active,
            stage: Stage::of(&record),
            arrived: if active { progress.arrived } else { 0 },
            per_second: if active { progress.per_second } else { 0.0 },
            training: progress.training.filter(|_| active),
            waiting: held_up_by(progress.disk, progress.waiting).filter(|_| active),
            workers: *self.context.dispatch.workers().borrow(),
            trainers: *self.context.trainers.connected().borrow(),
            notices,
            record,
        }
    }
}
