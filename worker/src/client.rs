//! The network side of a worker: receives leases from a coordinator, lets threads evaluate and embed, and sends results.
//!
//! A worker is stateless: if it is lost, the coordinator gives its leases to another worker.

mod checkpoints;
mod executor;
mod lease;
mod pool;
#[cfg(test)]
mod tests;

use checkpoints::Checkpoints;
use lease::{Lease, Outcome};
use murmuration_embed::{Device, Runtime, RuntimeError};
use murmuration_link::{
    Address, Broken, Health, Leaving, Link, LinkError, Peer, Role, Target, keep, stopped,
};
use murmuration_proto::v1::{self, coordinator_message, worker_message};
use murmuration_swarm::EmbeddingKind;
use pool::Pool;
use std::{net::IpAddr, num::NonZeroUsize, path::PathBuf, pin::Pin};
use tokio::sync::watch;

/// The settings of a worker.
#[derive(Debug, Clone)]
pub struct Options {
    /// The coordinator, and credentials for it.
    pub coordinator: Target,
    /// Display name.
    pub name: String,
    /// Address of this machine to connect from; `None` leaves the choice to the system.
    pub local_address: Option<IpAddr>,
    /// Reports whether the worker is connected.
    pub health: Health,
    /// Conditions under which the process leaves by itself.
    pub leaving: Leaving,
    /// Number of simultaneous evaluations, one per thread; at most 4,096.
    pub threads: NonZeroUsize,
    /// Folder for up to 1 GiB of checkpoints, created at its first use. Several workers can share a folder.
    pub cache: PathBuf,
    /// Device on which this worker embeds.
    pub embed_on: Device,
}

/// Why a worker gave up. After a temporary error, the worker tries again without limit.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The worker cannot work for this coordinator.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A thread could not be started.
    #[error("cannot start an evaluation thread: {0}")]
    Thread(#[from] std::io::Error),
    /// This machine cannot embed on the device that was asked for.
    #[error("--embed-on: {0}")]
    Device(RuntimeError),
}

/// A running worker. The future is boxed, so that only this crate compiles it, and not each program that awaits it.
pub type Working = Pin<Box<dyn Future<Output = Result<(), WorkerError>> + Send>>;

/// Runs a worker until `stop` becomes true. The worker then returns leases that it has not begun, finishes the rest, and leaves.
///
/// # Errors
/// See [`WorkerError`].
pub fn run(options: Options, stop: watch::Receiver<bool>) -> Working {
    Box::pin(work(options, stop))
}

async fn work(options: Options, stop: watch::Receiver<bool>) -> Result<(), WorkerError> {
    let capacity = options.threads.get() as u32;
    let kind = match Runtime::load().and_then(|runtime| runtime.on(options.embed_on)) {
        Ok(runtime) => runtime.kind(),
        Err(error) if options.embed_on != Device::default() => return Err(WorkerError::Device(error)),
        Err(error) => {
            tracing::warn!(name = options.name, %error, "this worker simulates, and does not embed");
            EmbeddingKind::UNKNOWN
        }
    };
    let address = Address::new(
        options.coordinator,
        Role::Worker { capacity, kind },
        &options.name,
    )?
    .connecting_from(options.local_address)
    .leaving(options.leaving.clone());
    let checkpoints = Checkpoints::new(address.calls(), options.cache, options.embed_on);
    let mut worker = Worker {
        pool: Pool::start(options.threads, checkpoints)?,
    };
    Ok(keep(&address, &options.health, &mut worker, stop).await?)
}

/// Most evaluations that a message may ask for.
const MOST_ASKED: u32 = 65_536;

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
            let wanted = self.ask(&mut promised);
            if wanted > 0 {
                let credits = v1::Credits { evaluations: wanted };
                link.send(worker_message::Message::Credits(credits)).await?;
            }
            tokio::select! {
                message = link.receive() => {
                    if let coordinator_message::Message::Lease(message) = message? {
                        promised = promised.saturating_sub(self.take(message, &link).await?);
                    }
                }
                Some((id, outcome)) = self.pool.finished() => {
                    let wanted = self.ask(&mut promised);
                    link.send(outcome.message(id, wanted)).await?;
                }
                () = stopped(&mut stop) => {}
            }
        }
    }
}

impl Worker {
    /// Number of evaluations to ask for, beside those that were `promised` to the coordinator and have not come.
    fn ask(&mut self, promised: &mut usize) -> u32 {
        let wanted = self
            .pool
            .room()
            .saturating_sub(*promised)
            .min(MOST_ASKED as usize);
        if wanted > 0 {
            *promised += wanted;
            self.pool.asked();
        }
        wanted as u32
    }

    /// Passes a lease to the threads, and returns the number of credits that the lease used.
    async fn take(&mut self, message: v1::Lease, link: &Link) -> Result<usize, Broken> {
        let id = message.id.unwrap_or_default();
        let credits = match &message.work {
            Some(v1::lease::Work::Evaluations(batch)) => batch.tasks.len(),
            Some(v1::lease::Work::Embeddings(batch)) => batch.images.len() / batch.starts.max(1) as usize,
            Some(v1::lease::Work::Replay(_) | v1::lease::Work::Training(_)) => 1,
            None => 0,
        };
        match Lease::try_from(message) {
            Ok(lease) => self.pool.take(lease),
            Err(invalid) => {
                link.send(Outcome::fatal(invalid.to_string()).message(id, 0))
                    .await?
            }
        }
        Ok(credits)
    }

    /// Returns leases that have not begun, finishes the other leases, and ends the stream.
    async fn drain(&mut self, mut link: Link) -> Result<(), Broken> {
        link.send(worker_message::Message::Drain(v1::Drain {})).await?;
        self.pool.begin_nothing_more();
        while self.pool.outstanding() > 0 {
            tokio::select! {
                Some((id, outcome)) = self.pool.finished() => link.send(outcome.message(id, 0)).await?,
                // Leases granted meanwhile go to another worker once the stream has ended.
                message = link.receive() => drop(message?),
            }
        }
        link.close().await;
        Ok(())
    }
}
