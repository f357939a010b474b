//! The dispatcher: one task that owns the lease table and talks to every worker.
//!
//! Campaigns hand it jobs and wait for their results; the worker service hands it what workers say. It keeps
//! no results once a job is over and writes nothing to disk.

mod job;
mod service;
mod trainers;

pub use job::{Embedder, EmbeddingJob, EvaluationJob, JobError, Lesson, ReplayJob, TrainingJob};
pub use trainers::Trainers;

use crate::{
    leases::{LeaseNumber, WorkerId},
    store::SavedTraining,
};
use job::{Output, Work};
use murmuration_proto::{Evaluation, Replay, v1};
use service::Service;
use std::{
    sync::{Arc, atomic::AtomicU32},
    time::Duration,
};
use tokio::sync::{mpsc, oneshot, watch};
use tonic::Status;

/// How the dispatcher treats its workers.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// How often a worker must send something.
    pub heartbeat_interval: Duration,
    /// How long a worker may be silent before it counts as lost.
    pub silence_limit: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            heartbeat_interval: Duration::from_secs(1),
            silence_limit: Duration::from_secs(5),
        }
    }
}

/// Messages to a worker that may wait to be sent; one that reads none of so many is taken for lost.
pub const OUTBOX: usize = 1024;

/// Where a worker's messages go. An error ends its stream.
pub type Outbox = mpsc::Sender<Result<v1::CoordinatorMessage, Status>>;

/// A handle on the dispatcher; cheap to clone. The dispatcher ends when the last one is dropped.
#[derive(Debug, Clone)]
pub struct Dispatch {
    commands: mpsc::Sender<Command>,
    workers: watch::Receiver<usize>,
}

/// What a worker says once it has been welcomed, validated.
#[derive(Debug)]
pub enum WorkerReport {
    /// Ready for so many further evaluations.
    Credits(usize),
    /// The outcome of a lease.
    Result {
        /// The coordinator's epoch that the lease was given in.
        epoch: u64,
        /// Its number.
        lease: LeaseNumber,
        /// What came of it.
        outcome: v1::batch_result::Outcome,
    },
    /// How far the training of a lease has come.
    Training {
        /// The coordinator's epoch that the lease was given in.
        epoch: u64,
        /// Its number.
        lease: LeaseNumber,
        /// How far.
        progress: v1::TrainingProgress,
    },
    /// The training of a lease, put aside.
    Saved {
        /// The coordinator's epoch that the lease was given in.
        epoch: u64,
        /// Its number.
        lease: LeaseNumber,
        /// The training.
        training: SavedTraining,
    },
    /// Alive.
    Heartbeat,
    /// Takes no more leases.
    Drain,
    /// Its stream has ended.
    Gone,
}

#[derive(Debug)]
enum Command {
    Work(Request),
    Stop,
}

#[derive(Debug)]
enum Request {
    Submit {
        work: Work,
        done: Arc<AtomicU32>,
        reply: oneshot::Sender<Result<Vec<Output>, JobError>>,
    },
    Join {
        name: String,
        capacity: usize,
        outbox: Outbox,
        reply: oneshot::Sender<WorkerId>,
    },
    Report {
        worker: WorkerId,
        report: WorkerReport,
    },
}

impl Dispatch {
    /// Starts a dispatcher on the current runtime.
    #[must_use]
    pub fn start(options: Options) -> Self {
        let (commands, inbox) = mpsc::channel(1024);
        let (count, workers) = watch::channel(0);
        tokio::spawn(Service::new(options, count).run(inbox));
        Self { commands, workers }
    }

    /// Has the workers evaluate a job; `done` counts the evaluations that have arrived. Results are in the
    /// order of the tasks. Dropping the future withdraws the job.
    ///
    /// # Errors
    /// See [`JobError`].
    pub async fn evaluate(
        &self,
        job: EvaluationJob,
        done: Arc<AtomicU32>,
    ) -> Result<Vec<Evaluation>, JobError> {
        let outputs = self.submit(Work::Evaluations(job), done).await?;
        Ok(outputs.into_iter().filter_map(Output::into_evaluation).collect())
    }

    /// Has the workers embed stored pictures; `done` counts those that have arrived. Embeddings are in the order of the
    /// pictures. Dropping the future withdraws the job.
    ///
    /// # Errors
    /// See [`JobError`].
    pub async fn embed(&self, job: EmbeddingJob, done: Arc<AtomicU32>) -> Result<Vec<Vec<f32>>, JobError> {
        let outputs = self.submit(Work::Embeddings(job), done).await?;
        Ok(outputs.into_iter().filter_map(Output::into_embedding).collect())
    }

    /// Has a worker simulate one individual again, to be watched.
    ///
    /// # Errors
    /// See [`JobError`].
    pub async fn replay(&self, job: ReplayJob) -> Result<Replay, JobError> {
        let outputs = self.submit(Work::Replay(job), Arc::default()).await?;
        outputs
            .into_iter()
            .find_map(Output::into_replay)
            .ok_or(JobError::ShuttingDown)
    }

    /// Ends every worker's stream and every job.
    pub async fn stop(&self) {
        // One that has ended needs no telling.
        let _ = self.commands.send(Command::Stop).await;
    }

    /// Number of workers that take work, now and whenever it changes.
    #[must_use]
    pub fn workers(&self) -> watch::Receiver<usize> {
        self.workers.clone()
    }

    /// Takes in a worker that runs `capacity` evaluations at once. `None` if the dispatcher has ended.
    pub(crate) async fn join(&self, name: String, capacity: usize, outbox: Outbox) -> Option<WorkerId> {
        let (reply, answer) = oneshot::channel();
        self.commands
            .send(Command::Work(Request::Join {
                name,
                capacity,
                outbox,
                reply,
            }))
            .await
            .ok()?;
        answer.await.ok()
    }

    /// Passes on what a worker says.
    pub(crate) async fn report(&self, worker: WorkerId, report: WorkerReport) {
        // A dispatcher that has ended needs no reports.
        let _ = self
            .commands
            .send(Command::Work(Request::Report { worker, report }))
            .await;
    }

    async fn submit(&self, work: Work, done: Arc<AtomicU32>) -> Result<Vec<Output>, JobError> {
        let (reply, answer) = oneshot::channel();
        let command = Command::Work(Request::Submit { work, done, reply });
        self.commands
            .send(command)
            .await
            .map_err(|_| JobError::ShuttingDown)?;
        answer.await.map_err(|_| JobError::ShuttingDown)?
    }
}
