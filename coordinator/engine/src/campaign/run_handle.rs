//! Handle of a running campaign: reports its progress to watchers, and stops it.

use murmuration_dispatch::{JobProgress, NO_WORKER};
use murmuration_proto::v1;
use murmuration_search::interrupt::{Interrupt, Interrupted};
use std::{
    collections::VecDeque,
    sync::Arc,
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// Interval at which watchers get a campaign's counts.
pub(super) const COUNTING_INTERVAL: Duration = Duration::from_millis(100);
/// Period over which the evaluations per second are averaged.
const RATE_SPAN: Duration = Duration::from_secs(5);

/// Time without any connected machine before the absence is reported. A restart takes less time, and is not reported.
pub(super) const ABSENCE_LIMIT: Duration = Duration::from_secs(2);

/// Whether machines are connected to do a campaign's work.
#[derive(Debug, Clone)]
pub(super) struct Availability {
    /// Number of connected machines.
    connected: watch::Receiver<usize>,
    /// Message while no machine is connected.
    missing: &'static str,
    /// Time at which no machine was found connected; `None` while a machine is connected.
    since: Option<Instant>,
}

impl Availability {
    pub(super) const fn workers(connected: watch::Receiver<usize>) -> Self {
        Self::new(connected, NO_WORKER)
    }

    pub(super) const fn trainers(connected: watch::Receiver<usize>) -> Self {
        let missing = "no trainer is connected: start one with `murmuration-trainer --access FILE`";
        Self::new(connected, missing)
    }

    const fn new(connected: watch::Receiver<usize>, missing: &'static str) -> Self {
        Self {
            connected,
            missing,
            since: None,
        }
    }

    /// The message about missing machines, once no machine has been connected for [`ABSENCE_LIMIT`]. Call this repeatedly.
    pub(super) fn missing(&mut self, now: Instant) -> Option<String> {
        if *self.connected.borrow() > 0 {
            self.since = None;
            return None;
        }
        let since = *self.since.get_or_insert(now);
        (now - since >= ABSENCE_LIMIT).then(|| self.missing.to_owned())
    }
}

/// Why a job waits: missing workers, trainers or disk, and other trouble.
pub(super) fn held_up_by(missing: Option<String>, trouble: Option<String>) -> Option<String> {
    match (missing, trouble) {
        (Some(missing), Some(trouble)) => Some(format!("{missing} ({trouble})")),
        (missing, trouble) => missing.or(trouble),
    }
}

/// The progress of a campaign, for its watchers.
#[derive(Debug, Clone, Default)]
pub(super) struct Progress {
    /// Number of results that have arrived for the current job (a generation, part of a dataset, or stored pictures).
    pub(super) arrived: u32,
    pub(super) per_second: f64,
    pub(super) training: Option<v1::TrainingProgress>,
    /// The missing resource that the campaign waits for, except the disk.
    pub(super) waiting: Option<String>,
    /// Why the disk refused a write, while the write is retried.
    pub(super) disk: Option<String>,
    /// Why the campaign failed, even if the store could not record the failure.
    pub(super) failed: Option<String>,
}

/// The part of a [`RunHandle`] that a commit needs. Commits may run while the campaign continues.
#[derive(Debug, Clone)]
pub(super) struct CommitHandle {
    progress: watch::Sender<Progress>,
    stopped: watch::Receiver<bool>,
}

impl CommitHandle {
    /// Records why the disk refuses a write; `None` if the disk accepts writes.
    pub(super) fn refused(&self, why: Option<String>) {
        self.progress.send_if_modified(|progress| {
            let changes = progress.disk != why;
            progress.disk = why;
            changes
        });
    }

    /// Resolves when the campaign must stop.
    pub(super) async fn stopped(&self) {
        // A closed channel means stop, because its sender is gone.
        let _ = self.stopped.clone().wait_for(|&stopped| stopped).await;
    }
}

/// The run's end of the channels to its watchers: it reports progress, and receives the request to stop.
#[derive(Debug)]
pub(super) struct RunHandle {
    progress: watch::Sender<Progress>,
    stopped: watch::Receiver<bool>,
    /// The workers, which do all work except training.
    workers: Availability,
    /// Ends the campaign's computations when the campaign must stop.
    pub(super) interrupt: Interrupt,
    /// Number of results of this stage in this process, without the results of the current job.
    done: u64,
    /// Number of results of this stage at each time, over the last [`RATE_SPAN`].
    history: VecDeque<(Instant, u64)>,
}

impl RunHandle {
    pub(super) fn new(
        progress: watch::Sender<Progress>,
        stopped: watch::Receiver<bool>,
        workers: watch::Receiver<usize>,
        interrupt: Interrupt,
    ) -> Self {
        Self {
            progress,
            stopped,
            workers: Availability::workers(workers),
            interrupt,
            done: 0,
            history: VecDeque::new(),
        }
    }

    pub(super) fn begin(&mut self) {
        self.done = 0;
        self.history.clear();
        self.progress.send_modify(|progress| {
            *progress = Progress {
                failed: progress.failed.take(),
                ..Progress::default()
            };
        });
    }

    /// Adds the `count` results of a finished job to the results of this stage.
    pub(super) fn done(&mut self, count: u64) {
        self.done += count;
        self.progress.send_modify(|progress| progress.arrived = 0);
    }

    /// Records what the campaign waits for, if anything.
    pub(super) fn waiting(&self, what: Option<String>) {
        self.progress.send_if_modified(|progress| {
            let changes = progress.waiting != what;
            progress.waiting = what;
            changes
        });
    }

    pub(super) fn failed(&self, why: &str) {
        self.progress
            .send_modify(|progress| progress.failed = Some(why.to_owned()));
    }

    /// Records the progress of the training.
    pub(super) fn training(&self, training: Option<v1::TrainingProgress>) {
        self.progress.send_modify(|progress| progress.training = training);
    }

    pub(super) fn commit_handle(&self) -> CommitHandle {
        CommitHandle {
            progress: self.progress.clone(),
            stopped: self.stopped.clone(),
        }
    }

    /// Awaits the future that `begin` returns, and reports the job's progress and obstacles meanwhile.
    ///
    /// # Errors
    /// [`Interrupted`] if the campaign must stop. A campaign only stops while it waits for workers or trainers, so that no commit
    /// is left unfinished.
    pub(super) async fn until_stopped<F: Future>(
        &mut self,
        begin: impl FnOnce(Arc<JobProgress>) -> F,
    ) -> Result<F::Output, Interrupted> {
        let job_progress = Arc::<JobProgress>::default();
        let work = begin(job_progress.clone());
        self.until_done(&job_progress, work).await
    }

    /// Awaits something from elsewhere that the campaign needs, such as a checkpoint from a bucket that may not answer.
    ///
    /// # Errors
    /// [`Interrupted`] if the campaign must stop.
    pub(super) async fn unless_stopped<F: Future>(&self, work: F) -> Result<F::Output, Interrupted> {
        let handle = self.commit_handle();
        tokio::select! {
            biased;
            () = handle.stopped() => Err(Interrupted),
            done = work => Ok(done),
        }
    }

    /// Awaits a future, and reports this progress and its obstacles meanwhile.
    ///
    /// # Errors
    /// The error of [`RunHandle::until_stopped`].
    pub(super) async fn until_done<F: Future>(
        &mut self,
        job_progress: &JobProgress,
        work: F,
    ) -> Result<F::Output, Interrupted> {
        let mut stopped = self.stopped.clone();
        tokio::pin!(work);
        let mut tick = tokio::time::interval(COUNTING_INTERVAL);
        loop {
            tokio::select! {
                biased;
                _ = stopped.wait_for(|&stopped| stopped) => return Err(Interrupted),
                output = &mut work => {
                    self.waiting(None);
                    return Ok(output);
                }
                _ = tick.tick() => {
                    let now = Instant::now();
                    self.count(job_progress.done(), now);
                    let missing = self.workers.missing(now);
                    self.waiting(held_up_by(missing, job_progress.trouble()));
                }
            }
        }
    }

    fn count(&mut self, arrived: u32, now: Instant) {
        let total = self.done + u64::from(arrived);
        // The total falls when results of a wrong worker are discarded: the rate then starts again from the remaining results.
        self.history.retain(|&(_, before)| before <= total);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn that_nobody_is_there_is_said_after_a_while_and_until_somebody_comes() {
        let (count, connected) = watch::channel(0);
        let mut availability = Availability::trainers(connected);
        let begun = Instant::now();
        let mut after = |seconds: u64| availability.missing(begun + Duration::from_secs(seconds));
        assert_eq!((after(0), after(1)), (None, None));
        assert!(after(2).unwrap().contains("murmuration-trainer --access FILE"));
        count.send_replace(1);
        assert_eq!(after(3), None);
        // A worker that only restarts is not reported as missing.
        count.send_replace(0);
        assert_eq!((after(10), after(11)), (None, None));
        assert!(after(12).is_some());
    }

    #[test]
    fn the_rate_stays_a_rate_when_results_are_discarded() {
        let (progress, shown) = watch::channel(Progress::default());
        let (stopped, workers) = (watch::channel(false).1, watch::channel(1).1);
        let mut handle = RunHandle::new(progress, stopped, workers, Interrupt::default());
        let begun = Instant::now();
        let rates = [(0, 0), (1, 100), (2, 200), (3, 20), (4, 120)].map(|(second, arrived)| {
            handle.count(arrived, begun + Duration::from_secs(second));
            shown.borrow().per_second
        });
        // After 180 results were discarded, the next 100 took a second.
        assert_eq!(rates, [0.0, 100.0, 100.0, 20.0 / 3.0, 30.0]);
    }
}
