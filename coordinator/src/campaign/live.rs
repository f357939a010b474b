//! What a search at work tells its watchers, and hears from whoever stops it.

use crate::dispatch::JobError;
use murmuration_proto::Evaluation;
use std::{
    collections::VecDeque,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// How often watchers hear of a campaign's evaluations.
const COUNTING_INTERVAL: Duration = Duration::from_millis(100);
/// Span that evaluations a second are averaged over.
const RATE_SPAN: Duration = Duration::from_secs(5);

/// What a search at work tells its watchers.
#[derive(Debug, Clone, Default)]
pub(super) struct Progress {
    pub(super) evaluated_in_generation: u32,
    pub(super) evaluations_per_second: f64,
    /// Why it failed, also where the store could not record that.
    pub(super) failed: Option<String>,
}

/// A search's end of the line.
#[derive(Debug)]
pub(super) struct Live {
    progress: watch::Sender<Progress>,
    stopped: watch::Receiver<bool>,
    population: u32,
    generations: u32,
    /// Evaluations of this process by time, over the last [`RATE_SPAN`].
    history: VecDeque<(Instant, u64)>,
}

impl Live {
    pub(super) fn new(
        progress: watch::Sender<Progress>,
        stopped: watch::Receiver<bool>,
        population: u32,
    ) -> Self {
        Self {
            progress,
            stopped,
            population,
            generations: 0,
            history: VecDeque::new(),
        }
    }

    /// A further generation is on disk.
    pub(super) fn committed(&mut self) {
        self.generations += 1;
        self.progress
            .send_modify(|progress| progress.evaluated_in_generation = 0);
    }

    /// The search has failed.
    pub(super) fn failed(&self, why: &str) {
        self.progress
            .send_modify(|progress| progress.failed = Some(why.to_owned()));
    }

    /// Awaits what `evaluate` starts, telling meanwhile what its counter shows. `None` if the search is to stop;
    /// this is the only place where it does, so that no commit is ever left in the air.
    pub(super) async fn until_stopped<F>(
        &mut self,
        evaluate: impl FnOnce(Arc<AtomicU32>) -> F,
    ) -> Option<Result<Vec<Evaluation>, JobError>>
    where
        F: Future<Output = Result<Vec<Evaluation>, JobError>>,
    {
        let done = Arc::new(AtomicU32::new(0));
        let mut stopped = self.stopped.clone();
        let evaluation = evaluate(done.clone());
        tokio::pin!(evaluation);
        let mut tick = tokio::time::interval(COUNTING_INTERVAL);
        loop {
            tokio::select! {
                biased;
                _ = stopped.wait_for(|&stopped| stopped) => return None,
                output = &mut evaluation => return Some(output),
                _ = tick.tick() => self.count(done.load(Ordering::Relaxed), Instant::now()),
            }
        }
    }

    fn count(&mut self, in_generation: u32, now: Instant) {
        let total = u64::from(self.generations) * u64::from(self.population) + u64::from(in_generation);
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
            progress.evaluated_in_generation = in_generation;
            progress.evaluations_per_second = per_second;
        });
    }
}
