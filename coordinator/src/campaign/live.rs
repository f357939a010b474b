//! What a campaign at work tells its watchers, and hears from whoever stops it.

use crate::dispatch::Headway;
use murmuration_proto::v1;
use std::{
    collections::VecDeque,
    sync::Arc,
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// How often watchers hear of a campaign's evaluations.
pub(super) const COUNTING_INTERVAL: Duration = Duration::from_millis(100);
/// Span that evaluations a second are averaged over.
const RATE_SPAN: Duration = Duration::from_secs(5);

/// What a campaign at work tells its watchers.
#[derive(Debug, Clone, Default)]
pub(super) struct Progress {
    /// Of what is in work (a generation, part of a dataset, stored pictures): how much has arrived.
    pub(super) arrived: u32,
    pub(super) per_second: f64,
    pub(super) training: Option<v1::TrainingProgress>,
    /// What it waits for before it goes on by itself.
    pub(super) waiting: Option<String>,
    /// Why it failed, also where the store could not record that.
    pub(super) failed: Option<String>,
}

/// A campaign's end of the line.
#[derive(Debug)]
pub(super) struct Live {
    progress: watch::Sender<Progress>,
    stopped: watch::Receiver<bool>,
    /// What of this stage is on disk, as far as it was done by this process.
    committed: u64,
    /// What of this stage was done by when, over the last [`RATE_SPAN`].
    history: VecDeque<(Instant, u64)>,
}

impl Live {
    pub(super) fn new(progress: watch::Sender<Progress>, stopped: watch::Receiver<bool>) -> Self {
        Self {
            progress,
            stopped,
            committed: 0,
            history: VecDeque::new(),
        }
    }

    /// Another stage begins.
    pub(super) fn begin(&mut self) {
        self.committed = 0;
        self.history.clear();
        self.progress.send_modify(|progress| {
            *progress = Progress {
                failed: progress.failed.take(),
                ..Progress::default()
            };
        });
    }

    /// A further `count` of what this stage does are on disk.
    pub(super) fn committed(&mut self, count: u64) {
        self.committed += count;
        self.progress.send_modify(|progress| progress.arrived = 0);
    }

    /// What the campaign waits for, if it does.
    pub(super) fn waiting(&self, what: Option<String>) {
        self.progress.send_if_modified(|progress| {
            let changes = progress.waiting != what;
            progress.waiting = what;
            changes
        });
    }

    /// The campaign has failed.
    pub(super) fn failed(&self, why: &str) {
        self.progress
            .send_modify(|progress| progress.failed = Some(why.to_owned()));
    }

    /// How far the training has come.
    pub(super) fn training(&self, training: Option<v1::TrainingProgress>) {
        self.progress.send_modify(|progress| progress.training = training);
    }

    /// Resolves when the campaign is to stop.
    pub(super) async fn stopped(&self) {
        // Whoever could have said stop is gone: stop.
        let _ = self.stopped.clone().wait_for(|&stopped| stopped).await;
    }

    /// Awaits what `begin` starts, telling meanwhile how far it is and what holds it up. `None` if the campaign is to stop; only
    /// where it waits for workers or trainers does it, so that no commit is ever left in the air.
    pub(super) async fn until_stopped<F: Future>(
        &mut self,
        begin: impl FnOnce(Arc<Headway>) -> F,
    ) -> Option<F::Output> {
        let headway = Arc::<Headway>::default();
        let mut stopped = self.stopped.clone();
        let work = begin(headway.clone());
        tokio::pin!(work);
        let mut tick = tokio::time::interval(COUNTING_INTERVAL);
        loop {
            tokio::select! {
                biased;
                _ = stopped.wait_for(|&stopped| stopped) => return None,
                output = &mut work => {
                    self.waiting(None);
                    return Some(output);
                }
                _ = tick.tick() => {
                    self.count(headway.done(), Instant::now());
                    self.waiting(headway.trouble());
                }
            }
        }
    }

    fn count(&mut self, arrived: u32, now: Instant) {
        let total = self.committed + u64::from(arrived);
        self.history.push_back((now, total));
        while self.history.len() > 2
            && self
                .history
                .front()
                .is_some_and(|(then, _)| now - *then > RATE_SPAN)
        {
            self.history.pop_front();
        }
        let per_second = self.history.front().map_or(0.0, |&(then, before)| {
            let seconds = (now - then).as_secs_f64();
            if seconds > 0.0 {
                (total - before) as f64 / seconds
            } else {
                0.0
            }
        });
        self.progress.send_modify(|progress| {
            progress.arrived = arrived;
            progress.per_second = per_second;
        });
    }
}
