//! The evaluation threads: leases in, outcomes out, in any order.

use super::{
    checkpoints::Checkpoints,
    executor::Executor,
    lease::{Lease, Outcome},
};
use murmuration_link::follow;
use murmuration_proto::v1;
use std::{
    io,
    num::NonZeroUsize,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc as blocking,
    },
    thread,
    time::{Duration, Instant},
};
use tokio::sync::mpsc;

/// The work that one thread should have queued: enough until the next lease arrives.
const WORK_IN_HAND: Duration = Duration::from_millis(100);
/// Number of evaluations that one thread accepts: at first, and at most.
const FIRST_CREDITS: usize = 4;
const MOST_CREDITS: usize = 64;

/// The evaluation threads. They end when the pool is dropped.
pub(super) struct Pool {
    leases: blocking::Sender<Lease>,
    finished: mpsc::UnboundedReceiver<Finished>,
    draining: Arc<AtomicBool>,
    threads: usize,
    outstanding: usize,
    /// Mean time of recent evaluations.
    cost: Option<Duration>,
}

struct Finished {
    id: v1::LeaseId,
    outcome: Outcome,
    /// Number of credits that it used.
    credits: usize,
    took: Duration,
}

impl Pool {
    pub(super) fn start(threads: NonZeroUsize, checkpoints: Checkpoints) -> io::Result<Self> {
        let (leases, queue) = blocking::channel();
        // Bounded by the credits given, which the coordinator cannot exceed by more than it is served.
        let (outcomes, finished) = mpsc::unbounded_channel();
        let queue = Arc::new(Mutex::new(queue));
        let checkpoints = Arc::new(checkpoints);
        let draining = Arc::new(AtomicBool::new(false));
        for number in 0..threads.get() {
            let (queue, outcomes, draining) = (queue.clone(), outcomes.clone(), draining.clone());
            thread::Builder::new().name(format!("evaluate-{number}")).spawn({
                let executor = Executor::new(checkpoints.clone());
                move || work_until_closed(&queue, &outcomes, &draining, executor)
            })?;
        }
        Ok(Self {
            leases,
            finished,
            draining,
            threads: threads.get(),
            outstanding: 0,
            cost: None,
        })
    }

    /// Number of evaluations that it can accept now. A picture to embed counts as one, although it takes far less.
    pub(super) fn room(&self) -> usize {
        let each = self.cost.map_or(FIRST_CREDITS, |cost| {
            let fitting = WORK_IN_HAND.as_nanos() / cost.as_nanos().max(1);
            usize::try_from(fitting)
                .unwrap_or(MOST_CREDITS)
                .clamp(2, MOST_CREDITS)
        });
        (each * self.threads).saturating_sub(self.outstanding)
    }

    /// Number of unfinished evaluations.
    pub(super) const fn outstanding(&self) -> usize {
        self.outstanding
    }

    /// Queues a lease.
    pub(super) fn take(&mut self, lease: Lease) {
        self.outstanding += lease.work.len();
        // The threads live as long as the pool.
        let _ = self.leases.send(lease);
    }

    /// The next outcome; waits while there is none.
    pub(super) async fn finished(&mut self) -> Option<(v1::LeaseId, Outcome)> {
        let Finished {
            id,
            outcome,
            credits,
            took,
        } = self.finished.recv().await?;
        self.outstanding = self.outstanding.saturating_sub(credits);
        // Embeddings are far cheaper: counting them would suggest room for many more evaluations.
        if matches!(outcome, Outcome::Evaluations(_)) {
            let cost = took / credits.max(1) as u32;
            self.cost = Some(self.cost.map_or(cost, |before| (before * 3 + cost) / 4));
        }
        Some((id, outcome))
    }

    /// From now on queued leases are returned undone.
    pub(super) fn begin_nothing_more(&self) {
        self.draining.store(true, Ordering::Relaxed);
    }
}

fn work_until_closed(
    queue: &Mutex<blocking::Receiver<Lease>>,
    outcomes: &mpsc::UnboundedSender<Finished>,
    draining: &AtomicBool,
    mut executor: Executor,
) {
    loop {
        let next = queue.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(lease) = next else { return };
        let (id, credits) = (lease.id, lease.work.len());
        let span = tracing::info_span!("lease", %id, campaign = lease.campaign);
        follow(&span, &lease.trace_parent);
        let _in_lease = span.entered();
        let begun = Instant::now();
        let outcome = if draining.load(Ordering::Relaxed) {
            Outcome::retryable("the worker is leaving".to_owned())
        } else {
            executor.outcome(lease)
        };
        let took = begun.elapsed();
        tracing::debug!(tasks = credits, ?took, "over");
        let finished = Finished {
            id,
            outcome,
            credits,
            took,
        };
        if outcomes.send(finished).is_err() {
            return;
        }
    }
}
