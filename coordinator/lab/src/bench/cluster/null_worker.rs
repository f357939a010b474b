//! A worker whose evaluations cost nothing, to measure the coordinator alone.

use super::{CliError, thread_cpu};
use murmuration_coordinator::server::LocalWay;
use murmuration_link::{Address, Broken, Health, Link, LinkError, Peer, Role, keep, stopped};
use murmuration_proto::v1::{self, batch_result, coordinator_message, lease, worker_message};
use murmuration_swarm::{EmbeddingKind, ImageFormat, Purpose, RandomStream};
use rand::RngExt as _;
use std::{
    thread::{self, JoinHandle},
    time::Duration,
};
use tokio::{runtime, sync::watch};

/// Evaluations that it accepts at once.
const CREDITS: u32 = 1024;
/// One pixel in this many is grey in its pictures, about as many as in the picture of a swarm.
const GREY: usize = 20;

/// The worker, in a thread of its own.
pub(super) struct NullWorker {
    stop: watch::Sender<bool>,
    thread: JoinHandle<Result<Duration, CliError>>,
}

impl NullWorker {
    /// Starts a worker for campaigns with pictures in `format`.
    pub(super) fn start(way: &LocalWay, format: &ImageFormat) -> Result<Self, CliError> {
        let role = Role::Worker {
            capacity: 1,
            kind: EmbeddingKind::UNKNOWN,
        };
        let address = Address::new(&way.url, &way.credentials, role, "null").map_err(failed)?;
        let image = (0..format.bytes()).map(|pixel| if pixel % GREY == 0 { 128 } else { 0 });
        let mut answers = Answers {
            image: image.collect(),
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

    /// Ends it. Returns the CPU time of its thread.
    pub(super) fn end(self) -> Result<Duration, CliError> {
        self.stop.send_replace(true);
        let early = || CliError::Failed("the null worker ended early".to_owned());
        self.thread.join().map_err(|_| early())?
    }
}

fn failed(error: LinkError) -> CliError {
    CliError::Failed(error.to_string())
}

/// Its answers: one picture, and random features, so that novelty is measured on distinct behaviours.
struct Answers {
    image: Vec<u8>,
    stream: RandomStream,
}

impl Answers {
    /// Features within the range of a swarm in the paper's world.
    fn evaluation(&mut self) -> v1::Evaluation {
        let bits: u64 = self.stream.random();
        let feature = |place: u32| f64::from((bits >> (12 * place)) as u16 & 0xfff) / f64::from(1 << 15);
        v1::Evaluation {
            features: (0..5).map(feature).collect(),
            image: self.image.clone(),
            ..v1::Evaluation::default()
        }
    }

    fn answer(&mut self, lease: v1::Lease) -> (v1::BatchResult, u32) {
        let tasks = match lease.work {
            Some(lease::Work::Evaluations(batch)) => batch.tasks.len(),
            _ => 0,
        };
        let evaluations = (0..tasks).map(|_| self.evaluation()).collect();
        let result = v1::BatchResult {
            lease: lease.id,
            outcome: Some(batch_result::Outcome::Evaluations(v1::Evaluations {
                evaluations,
            })),
        };
        (result, tasks as u32)
    }
}

impl Peer for Answers {
    async fn session(&mut self, mut link: Link, mut stop: watch::Receiver<bool>) -> Result<(), Broken> {
        let mut wanted = CREDITS;
        loop {
            if wanted > 0 {
                let credits = v1::Credits { evaluations: wanted };
                link.send(worker_message::Message::Credits(credits)).await?;
            }
            wanted = tokio::select! {
                message = link.receive() => match message? {
                    coordinator_message::Message::Lease(lease) => {
                        let (result, tasks) = self.answer(lease);
                        link.send(worker_message::Message::Result(result)).await?;
                        tasks
                    }
                    _ => 0,
                },
                () = stopped(&mut stop) => {
                    link.close().await;
                    return Ok(());
                }
            };
        }
    }
}
