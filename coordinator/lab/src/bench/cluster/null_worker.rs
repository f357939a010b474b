//! A worker whose evaluations cost nothing, to measure the coordinator alone.

use super::{CliError, thread_cpu};
use murmuration_coordinator::server::LocalWay;
use murmuration_link::{Address, Broken, Health, Link, LinkError, Peer, Role, keep, stopped};
use murmuration_proto::v1::{self, batch_result, coordinator_message, lease, worker_message};
use murmuration_sim::{evaluate::Evaluator, simulate::Start};
use murmuration_swarm::{CampaignSpec, Compressor, EmbeddingKind, Invalid, Purpose, RandomStream};
use rand::RngExt as _;
use std::{
    thread::{self, JoinHandle},
    time::Duration,
};
use tokio::{runtime, sync::watch};

/// Evaluations that the worker accepts at once.
const CREDITS: u32 = 1024;
/// Number of swarms whose pictures it sends, in turns.
const SWARMS: u64 = 256;

/// A worker in a thread of its own, whose evaluations cost nothing.
pub(super) struct NullWorker {
    stop: watch::Sender<bool>,
    thread: JoinHandle<Result<Duration, CliError>>,
}

impl NullWorker {
    /// Starts a worker for campaigns of this specification.
    pub(super) fn start(way: &LocalWay, spec: &CampaignSpec) -> Result<Self, CliError> {
        let role = Role::Worker {
            capacity: 1,
            kind: EmbeddingKind::UNKNOWN,
        };
        let address = Address::new(way.target(), role, "null").map_err(failed)?;
        let mut answers = Answers {
            pictures: pictures(spec).map_err(CliError::failed)?,
            sent: 0,
            stream: RandomStream::derive(1, Purpose::Propose, 0),
        };
        let cannot_start = |error| CliError::Failed(format!("threads cannot be started: {error}"));
        let runtime = runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(cannot_start)?;
        let (stop, stopped) = watch::channel(false);
        let work = move || {
            let health = Health::new();
            let worked = keep(&address, &health, &mut answers, stopped);
            runtime.block_on(worked).map_err(failed)?;
            Ok(thread_cpu())
        };
        let thread = thread::Builder::new().name("null-worker".to_owned()).spawn(work);
        Ok(Self {
            stop,
            thread: thread.map_err(cannot_start)?,
        })
    }

    /// Ends the worker. Returns the CPU time of the worker's thread.
    pub(super) fn end(self) -> Result<Duration, CliError> {
        self.stop.send_replace(true);
        let early = || CliError::Failed("the null worker ended early".to_owned());
        self.thread.join().map_err(|_| early())?
    }
}

fn failed(error: LinkError) -> CliError {
    CliError::Failed(error.to_string())
}

/// Compressed pictures of swarms with random controllers.
fn pictures(spec: &CampaignSpec) -> Result<Vec<Vec<u8>>, Invalid> {
    let no_memory = |error| Invalid::new("picture", error, "small enough to compress");
    let mut evaluator = Evaluator::new(spec.world(), spec.image())?;
    let mut compressor = Compressor::new().map_err(no_memory)?;
    let mut stream = RandomStream::derive(2, Purpose::Propose, 0);
    let picture = |seed| {
        let controller = spec.controllers().sample(&mut stream);
        let evaluation = evaluator.evaluate(&controller, &Start::seeded(seed))?;
        let image = compressor.compress(evaluation.image()).map_err(no_memory)?;
        Ok(image.frame().to_vec())
    };
    (0..SWARMS).map(picture).collect()
}

/// Answers of the worker: pictures of real swarms, and random features, so that novelty is measured on distinct behaviours.
struct Answers {
    pictures: Vec<Vec<u8>>,
    /// Number of pictures that were sent.
    sent: usize,
    stream: RandomStream,
}

impl Answers {
    /// Features within the range of a swarm in the paper's world.
    fn features(&mut self) -> [f64; 5] {
        let bits: u64 = self.stream.random();
        [0, 1, 2, 3, 4].map(|place| f64::from((bits >> (12 * place)) as u16 & 0xfff) / f64::from(1 << 15))
    }

    fn next_pictures(&mut self, count: usize) -> Vec<u8> {
        let first = self.sent;
        self.sent += count;
        let of = |sent: usize| self.pictures[sent % self.pictures.len()].as_slice();
        (first..self.sent).map(of).collect::<Vec<_>>().concat()
    }

    fn answer(&mut self, lease: v1::Lease) -> v1::BatchResult {
        let tasks = match lease.work {
            Some(lease::Work::Evaluations(batch)) => batch.tasks.len(),
            _ => 0,
        };
        let evaluations = v1::Evaluations {
            features: (0..tasks).flat_map(|_| self.features()).collect(),
            pictures: self.next_pictures(tasks),
            ..v1::Evaluations::default()
        };
        v1::BatchResult {
            lease: lease.id,
            outcome: Some(batch_result::Outcome::Evaluations(evaluations)),
            credits: tasks as u32,
        }
    }
}

impl Peer for Answers {
    async fn session(&mut self, mut link: Link, mut stop: watch::Receiver<bool>) -> Result<(), Broken> {
        let credits = v1::Credits { evaluations: CREDITS };
        link.send(worker_message::Message::Credits(credits)).await?;
        loop {
            tokio::select! {
                message = link.receive() => {
                    if let coordinator_message::Message::Lease(lease) = message? {
                        link.send(worker_message::Message::Result(self.answer(lease))).await?;
                    }
                }
                () = stopped(&mut stop) => {
                    link.close().await;
                    return Ok(());
                }
            }
        }
    }
}
