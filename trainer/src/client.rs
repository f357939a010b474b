//! The network side of a trainer: leases one training at a time, reports after each epoch, and publishes the checkpoint.
//!
//! A trainer is stateless: the coordinator keeps the last snapshot of a training. The next trainer continues from this snapshot
//! and reaches the same checkpoint.

mod dataset;
mod event;
mod job;
mod task;
mod training_run;

use event::{Event, Undone};
use job::Running;
use murmuration_link::{Address, Broken, Calls, Health, Leaving, Link, Peer, Role, Target, keep, stopped};
use murmuration_proto::{
    PART_BYTES,
    v1::{self, batch_result::Outcome, coordinator_message, worker_message},
};
use std::{net::IpAddr, pin::Pin, sync::Arc};
use task::Task;
use tokio::sync::{Mutex, watch};

pub use murmuration_link::LinkError as TrainerError;

/// The settings of a trainer.
#[derive(Debug, Clone)]
pub struct Options {
    /// The coordinator, and credentials for it.
    pub coordinator: Target,
    /// Name of the trainer, shown to people.
    pub name: String,
    /// Local address that the trainer connects from; `None` lets the system choose an address.
    pub local_address: Option<IpAddr>,
    /// Receives whether the trainer is connected.
    pub health: Health,
    /// Conditions under which the process leaves by itself.
    pub leaving: Leaving,
}

/// A running trainer. A boxed future is compiled once in this crate, and not again in each program that awaits it.
pub type Training = Pin<Box<dyn Future<Output = Result<(), TrainerError>> + Send>>;

/// Trains in rayon's global pool until `stop` becomes true. After that, the trainer finishes the epoch, returns the training as a
/// snapshot, and disconnects.
///
/// # Errors
/// If the URL is not valid, or the coordinator refuses this trainer. After a temporary error, the trainer tries again, without
/// end.
pub fn run(options: Options, stop: watch::Receiver<bool>) -> Training {
    Box::pin(train(options, stop))
}

async fn train(options: Options, stop: watch::Receiver<bool>) -> Result<(), TrainerError> {
    let address = Address::new(options.coordinator, Role::Trainer, &options.name)?
        .connecting_from(options.local_address)
        .leaving(options.leaving.clone());
    let mut trainer = Trainer {
        calls: address.calls(),
        turn: Arc::default(),
    };
    keep(&address, &options.health, &mut trainer, stop).await
}

struct Trainer {
    calls: Calls,
    /// Lock of the training that computes. An abandoned training computes until its epoch is over, and the next training waits
    /// for the lock.
    turn: Arc<Mutex<()>>,
}

impl Peer for Trainer {
    async fn session(&mut self, mut link: Link, mut stop: watch::Receiver<bool>) -> Result<(), Broken> {
        ask(&link).await?;
        let mut running: Option<Running> = None;
        let mut leaving = false;
        loop {
            if leaving && running.is_none() {
                link.close().await;
                return Ok(());
            }
            tokio::select! {
                message = link.receive() => match message? {
                    coordinator_message::Message::Lease(lease) if running.is_none() => {
                        running = self.take(lease, &link, &stop).await?;
                    }
                    coordinator_message::Message::Lease(lease) => {
                        let busy = Undone::retryable("this trainer has a training already");
                        answer(&link, lease.id, busy.into()).await?;
                    }
                    coordinator_message::Message::Withdrawal(withdrawal) => {
                        if let Some(dropped) = running.take_if(|running| withdrawal.lease == Some(running.lease)) {
                            tracing::info!(lease = %dropped.lease, "withdrawn");
                            drop(dropped);
                            ask(&link).await?;
                        }
                    }
                    coordinator_message::Message::Welcome(_) => {}
                },
                event = next(&mut running) => {
                    let lease = running.as_ref().map(|running| running.lease);
                    match event {
                        Event::Progress(progress) => {
                            let report = v1::TrainingReport { lease, progress: Some(progress) };
                            link.send(worker_message::Message::Training(report)).await?;
                        }
                        Event::Snapshot { epoch, bytes } => put_aside(&link, lease, epoch, &bytes).await?,
                        Event::Done(outcome) => {
                            running = None;
                            answer(&link, lease, outcome).await?;
                            if !leaving {
                                ask(&link).await?;
                            }
                        }
                    }
                },
                () = stopped(&mut stop), if !leaving => {
                    leaving = true;
                    link.send(worker_message::Message::Drain(v1::Drain {})).await?;
                }
            }
        }
    }
}

impl Trainer {
    /// Begins the training of a lease, or reports that the training cannot begin.
    async fn take(
        &self,
        lease: v1::Lease,
        link: &Link,
        stop: &watch::Receiver<bool>,
    ) -> Result<Option<Running>, Broken> {
        let id = lease.id.unwrap_or_default();
        match Task::try_from(lease) {
            Ok(task) => {
                tracing::info!(campaign = task.campaign, lease = %id, "training");
                let (calls, turn) = (self.calls.clone(), self.turn.clone());
                Ok(Some(Running::start(id, task, calls, turn, stop.clone())))
            }
            Err(undone) => {
                answer(link, Some(id), undone.into()).await?;
                ask(link).await?;
                Ok(None)
            }
        }
    }
}

/// The next event of the training; waits for ever if there is no training.
async fn next(running: &mut Option<Running>) -> Event {
    match running {
        Some(running) => running.next().await,
        None => std::future::pending().await,
    }
}

async fn ask(link: &Link) -> Result<(), Broken> {
    let credits = v1::Credits { evaluations: 1 };
    link.send(worker_message::Message::Credits(credits)).await
}

async fn answer(link: &Link, lease: Option<v1::LeaseId>, outcome: Outcome) -> Result<(), Broken> {
    if let Outcome::Failure(failure) = &outcome {
        tracing::warn!("not trained: {}", failure.message);
    }
    let result = v1::BatchResult {
        lease,
        outcome: Some(outcome),
        credits: 0,
    };
    link.send(worker_message::Message::Result(result)).await
}

async fn put_aside(link: &Link, lease: Option<v1::LeaseId>, epoch: u64, bytes: &[u8]) -> Result<(), Broken> {
    let parts = bytes.chunks(PART_BYTES);
    let count = parts.len();
    for (number, data) in parts.enumerate() {
        let part = v1::TrainingSnapshot {
            lease,
            epoch,
            data: data.to_vec(),
            last: number + 1 == count,
        };
        link.send(worker_message::Message::Snapshot(part)).await?;
    }
    Ok(())
}
