//! The worker's network face: takes leases from a coordinator, has threads evaluate and embed, sends results.
//!
//! Stateless: whatever it holds can be lost, the coordinator gives it to another.

mod checkpoints;
mod executor;
mod lease;
mod pool;
#[cfg(test)]
mod tests;

use checkpoints::Checkpoints;
use lease::{Lease, Outcome};
use murmuration_embed::Runtime;
use murmuration_link::{Address, Broken, Credentials, Health, Link, LinkError, Peer, Role, keep, stopped};
use murmuration_proto::{
    EmbeddingKind,
    v1::{self, coordinator_message, worker_message},
};
use pool::Pool;
use std::{net::IpAddr, num::NonZeroUsize, path::PathBuf};
use tokio::sync::watch;

/// What a worker needs to know.
#[derive(Debug, Clone)]
pub struct Options {
    /// URL of the coordinator, `http://HOST:PORT` or `https://HOST:PORT`.
    pub coordinator: String,
    /// What to show to it, and whom to take for it.
    pub credentials: Credentials,
    /// Its name, for people.
    pub name: String,
    /// Address of this machine to connect from; `None` leaves the choice to the system.
    pub local_address: Option<IpAddr>,
    /// Told whether it is connected.
    pub health: Health,
    /// Evaluations at once, one a thread; at most 4,096.
    pub threads: NonZeroUsize,
    /// Folder for checkpoints, up to 1 GiB of them, made when it is first needed. Workers may share one.
    pub cache: PathBuf,
}

/// Why a worker gave up. Anything that may pass is tried again for ever.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// It cannot work for this coordinator.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A thread could not be started.
    #[error("cannot start an evaluation thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// Works until `stop` becomes true: then it gives back what it has not begun, finishes the rest, and leaves.
///
/// # Errors
/// See [`WorkerError`].
pub async fn run(options: Options, stop: watch::Receiver<bool>) -> Result<(), WorkerError> {
    let capacity = options.threads.get() as u32;
    let kind = match Runtime::load() {
        Ok(runtime) => runtime.kind(),
        Err(error) => {
            tracing::warn!(name = options.name, %error, "this worker simulates, and does not embed");
            EmbeddingKind::UNKNOWN
        }
    };
    let address = Address::new(
        &options.coordinator,
        &options.credentials,
        Role::Worker { capacity, kind },
        &options.name,
    )?
    .connecting_from(options.local_address);
    let checkpoints = Checkpoints::new(address.channel(), options.cache);
    let mut worker = Worker {
        pool: Pool::start(options.threads, checkpoints)?,
    };
    Ok(keep(&address, &options.health, &mut worker, stop).await?)
}

struct Worker {
    pool: Pool,
}

impl Peer for Worker {
    async fn session(&mut self, mut link: Link, mut stop: watch::Receiver<bool>) -> Result<(), Broken> {
        let mut promised = 0;
        loop {
            let stopping = *stop.borrow();
            if stopping {
                return self.drain(link).await;
            }
            let wanted = self.pool.room().saturating_sub(promised);
            if wanted > 0 {
                promised += wanted;
                let credits = v1::Credits {
                    evaluations: wanted as u32,
                };
                link.send(worker_message::Message::Credits(credits)).await?;
            }
            tokio::select! {
                message = link.receive() => {
                    if let coordinator_message::Message::Lease(message) = message? {
                        promised = promised.saturating_sub(self.take(message, &link).await?);
                    }
                }
                Some((id, outcome)) = self.pool.finished() => link.send(outcome.message(id)).await?,
                () = stopped(&mut stop) => {}
            }
        }
    }
}

impl Worker {
    /// Hands a lease to the threads; how many credits it used.
    async fn take(&mut self, message: v1::Lease, link: &Link) -> Result<usize, Broken> {
        let id = message.id.unwrap_or_default();
        let credits = match &message.work {
            Some(v1::lease::Work::Evaluations(batch)) => batch.tasks.len(),
            Some(v1::lease::Work::Embeddings(batch)) => batch.images.len(),
            Some(v1::lease::Work::Replay(_) | v1::lease::Work::Training(_)) => 1,
            None => 0,
        };
        match Lease::try_from(message) {
            Ok(lease) => self.pool.take(lease),
            Err(invalid) => link.send(Outcome::fatal(invalid.to_string()).message(id)).await?,
        }
        Ok(credits)
    }

    /// Gives back what has not begun, finishes what has, and ends the stream.
    async fn drain(&mut self, mut link: Link) -> Result<(), Broken> {
        link.send(worker_message::Message::Drain(v1::Drain {})).await?;
        self.pool.begin_nothing_more();
        while self.pool.outstanding() > 0 {
            tokio::select! {
                Some((id, outcome)) = self.pool.finished() => link.send(outcome.message(id)).await?,
                // What was leased meanwhile goes to another once the stream has ended.
                message = link.receive() => drop(message?),
            }
        }
        link.close().await;
        Ok(())
    }
}
