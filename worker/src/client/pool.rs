//! The evaluation threads: leases in, outcomes out, any order.

use super::{
    FIRST_CREDITS, MOST_CREDITS, WORK_IN_HAND,
    lease::{Lease, Outcome, Work},
};
use crate::{evaluate::Evaluator, replay::replay, simulate::Start};
use murmuration_proto::{ImageFormat, Invalid, World, v1};
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

/// Threads that evaluate; they end when this is dropped.
pub(super) struct Pool {
    leases: blocking::Sender<Lease>,
    finished: mpsc::UnboundedReceiver<Finished>,
    draining: Arc<AtomicBool>,
    threads: usize,
    outstanding: usize,
    /// Mean time of one evaluation, over the recent past.
    cost: Option<Duration>,
}

struct Finished {
    id: v1::LeaseId,
    outcome: Outcome,
    evaluations: usize,
    took: Duration,
}

impl Pool {
    pub(super) fn start(threads: NonZeroUsize) -> io::Result<Self> {
        let (leases, queue) = blocking::channel();
        // Bounded by the credits given, which the coordinator cannot exceed by more than it is served.
        let (outcomes, finished) = mpsc::unbounded_channel();
        let queue = Arc::new(Mutex::new(queue));
        let draining = Arc::new(AtomicBool::new(false));
        for number in 0..threads.get() {
            let (queue, outcomes, draining) = (queue.clone(), outcomes.clone(), draining.clone());
            thread::Builder::new()
                .name(format!("evaluate-{number}"))
                .spawn(move || evaluate_until_closed(&queue, &outcomes, &draining))?;
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

    /// Evaluations that it could take on now.
    pub(super) fn room(&self) -> usize {
        let each = self.cost.map_or(FIRST_CREDITS, |cost| {
            let fitting = WORK_IN_HAND.as_nanos() / cost.as_nanos().max(1);
            usize::try_from(fitting)
                .unwrap_or(MOST_CREDITS)
                .clamp(2, MOST_CREDITS)
        });
        (each * self.threads).saturating_sub(self.outstanding)
    }

    /// Evaluations taken and not finished.
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
            evaluations,
            took,
        } = self.finished.recv().await?;
        self.outstanding = self.outstanding.saturating_sub(evaluations);
        if matches!(outcome, Outcome::Evaluations(_)) {
            let cost = took / evaluations.max(1) as u32;
            self.cost = Some(self.cost.map_or(cost, |before| (before * 3 + cost) / 4));
        }
        Some((id, outcome))
    }

    /// From now on queued leases come back undone.
    pub(super) fn begin_nothing_more(&self) {
        self.draining.store(true, Ordering::Relaxed);
    }
}

fn evaluate_until_closed(
    queue: &Mutex<blocking::Receiver<Lease>>,
    outcomes: &mpsc::UnboundedSender<Finished>,
    draining: &AtomicBool,
) {
    let mut evaluator = None;
    loop {
        let next = queue.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(Lease { id, work }) = next else { return };
        let evaluations = work.len();
        let begun = Instant::now();
        let outcome = if draining.load(Ordering::Relaxed) {
            let class = v1::FailureClass::Retryable;
            Outcome::Failure {
                class,
                message: "the worker is leaving".to_owned(),
            }
        } else {
            outcome(&mut evaluator, work)
        };
        let finished = Finished {
            id,
            outcome,
            evaluations,
            took: begun.elapsed(),
        };
        if outcomes.send(finished).is_err() {
            return;
        }
    }
}

/// An evaluator and what it was made for.
type Kept = Option<(World, ImageFormat, Evaluator)>;

fn outcome(kept: &mut Kept, work: Work) -> Outcome {
    let done = match work {
        Work::Evaluations { world, image, tasks } => evaluator_for(kept, world, image)
            .and_then(|evaluator| {
                let evaluate = |(controller, seed): &_| evaluator.evaluate(controller, &Start::seeded(*seed));
                tasks.iter().map(evaluate).collect()
            })
            .map(Outcome::Evaluations),
        Work::Replay {
            world,
            controller,
            seed,
            stride,
        } => replay(&controller, &world, &Start::seeded(seed), stride).map(Outcome::Replay),
    };
    done.unwrap_or_else(|error| Outcome::fatal(error.to_string()))
}

/// The evaluator of the batch before, if it is for the same world and format; else a new one.
fn evaluator_for(kept: &mut Kept, world: World, image: ImageFormat) -> Result<&mut Evaluator, Invalid> {
    let fitting = kept
        .take()
        .filter(|(of, format, _)| *of == world && *format == image);
    let entry = match fitting {
        Some(fitting) => fitting,
        None => (world, image, Evaluator::new(&world, &image)?),
    };
    Ok(&mut kept.insert(entry).2)
}
