//! The evaluation threads: they take leases and return outcomes, in any order.

use super::{
    checkpoints::Checkpoints,
    executor::Executor,
    lease::{Lease, Outcome},
};
use murmuration_link::follow;
use murmuration_proto::v1;
use std::{
    collections::VecDeque,
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

/// Maximum work that one thread should have queued: enough until the next lease arrives from a distant coordinator.
const MOST_WORK_IN_HAND: Duration = Duration::from_millis(100);
/// Queued work, as a multiple of the time until a lease arrives. A thread has a lease in work and a waiting lease, each with a
/// reserve of the same length.
const LATENCIES_IN_HAND: u32 = 4;
/// Minimum number of queued evaluations: two full vectors of swarms. One vector is simulated while the next vector is sent, which
/// is worth a slightly later end of a job.
const TWO_VECTORS: usize = 16;
/// Number of evaluations that one thread accepts: initially, and at most.
const FIRST_CREDITS: usize = 4;
const MOST_CREDITS: usize = 64;

/// The evaluation threads, which end when the pool is dropped.
pub(super) struct Pool {
    leases: blocking::Sender<Lease>,
    finished: mpsc::UnboundedReceiver<Finished>,
    draining: Arc<AtomicBool>,
    threads: usize,
    outstanding: usize,
    /// Mean time of recent evaluations.
    cost: Option<Duration>,
    latency: Latency,
}

struct Finished {
    id: v1::LeaseId,
    outcome: Outcome,
    /// Number of credits that the lease used.
    credits: usize,
    took: Duration,
}

impl Pool {
    pub(super) fn start(threads: NonZeroUsize, checkpoints: Checkpoints) -> io::Result<Self> {
        let (leases, queue) = blocking::channel();
        // The credits granted to the coordinator bound the number of outcomes in this channel.
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
            latency: Latency::default(),
        })
    }

    /// Number of evaluations that the pool can accept now. A picture to embed counts as one evaluation, although it takes far
    /// less time.
    pub(super) fn room(&self) -> usize {
        let each = self.cost.map_or(FIRST_CREDITS, |cost| {
            let latency = self.latency.usual().unwrap_or(MOST_WORK_IN_HAND);
            credits_for(cost, latency)
        });
        (each * self.threads).saturating_sub(self.outstanding)
    }

    pub(super) fn asked(&mut self) {
        self.latency.asked.get_or_insert_with(Instant::now);
    }

    /// Number of unfinished evaluations.
    pub(super) const fn outstanding(&self) -> usize {
        self.outstanding
    }

    pub(super) fn take(&mut self, lease: Lease) {
        self.latency.answered(Instant::now());
        self.outstanding += lease.work.len();
        // The threads receive leases as long as the pool exists.
        let _ = self.leases.send(lease);
    }

    /// The next outcome. Waits until a thread has an outcome.
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

    /// From this call on, the threads return queued leases undone.
    pub(super) fn begin_nothing_more(&self) {
        self.draining.store(true, Ordering::Relaxed);
    }
}

/// Number of evaluations that one thread should have queued, if each takes `cost` and a lease arrives `latency` after its
/// request.
fn credits_for(cost: Duration, latency: Duration) -> usize {
    let fitting = |span: Duration| {
        let fitting = span.as_nanos() / cost.as_nanos().max(1);
        usize::try_from(fitting).unwrap_or(MOST_CREDITS)
    };
    let most = fitting(MOST_WORK_IN_HAND);
    let enough = fitting(latency.saturating_mul(LATENCIES_IN_HAND));
    enough.max(TWO_VECTORS).min(most).clamp(2, MOST_CREDITS)
}

/// How long leases take to arrive.
#[derive(Debug, Default)]
struct Latency {
    /// Time of the first request that no lease has answered yet.
    asked: Option<Instant>,
    recent: VecDeque<Duration>,
}

impl Latency {
    const REMEMBERED: usize = 32;

    /// Records that a lease arrived.
    fn answered(&mut self, now: Instant) {
        let Some(asked) = self.asked.take() else {
            return;
        };
        if self.recent.len() == Self::REMEMBERED {
            self.recent.pop_front();
        }
        self.recent.push_back(now.saturating_duration_since(asked));
    }

    /// The lower quartile of the recent times, because a lease may have waited for work, or may have been sent before the
    /// request.
    fn usual(&self) -> Option<Duration> {
        let mut recent: Vec<_> = self.recent.iter().copied().collect();
        recent.sort_unstable();
        recent.get(recent.len() / 4).copied()
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

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn a_thread_has_in_hand_what_it_does_until_the_next_lease_arrives() {
        // Cheap evaluations near the coordinator: two vectors of swarms, so that other workers get the other evaluations.
        assert_eq!(
            credits_for(Duration::from_micros(500), Duration::from_micros(300)),
            16
        );
        // The same evaluations far from the coordinator.
        assert_eq!(credits_for(Duration::from_micros(500), ms(5)), 40);
        assert_eq!(credits_for(Duration::from_micros(500), ms(60)), MOST_CREDITS);
        // Long evaluations: at most a tenth of a second of work, but at least one evaluation in work and one waiting.
        assert_eq!(credits_for(ms(20), Duration::from_micros(300)), 5);
        assert_eq!(credits_for(ms(2_000), ms(60)), 2);
        assert_eq!(credits_for(Duration::ZERO, ms(1)), MOST_CREDITS);
    }

    #[test]
    fn a_lease_that_waited_for_work_says_nothing_of_how_long_leases_take() {
        let begun = Instant::now();
        let mut latency = Latency::default();
        for (asked, answered) in [
            (0, 900),
            (1_000, 1_002),
            (1_100, 1_700),
            (2_000, 2_003),
            (2_100, 2_900),
        ] {
            latency.asked = Some(begun + ms(asked));
            latency.answered(begun + ms(answered));
            // Only the first lease answers the request.
            latency.answered(begun + ms(answered));
        }
        assert_eq!(latency.usual(), Some(ms(3)));
        assert_eq!(latency.recent.len(), 5);
        for _ in 0..Latency::REMEMBERED {
            latency.asked = Some(begun);
            latency.answered(begun + ms(7));
        }
        assert_eq!(latency.usual(), Some(ms(7)), "what was long ago is forgotten");
    }
}
