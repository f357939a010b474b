//! A separate dispatcher for trainers: a training takes minutes, and one trainer at a time holds its lease.

use super::{ConnectedMachine, Dispatch, JobError, JobProgress, Options, TrainingJob};
use crate::DispatchMetrics;
use murmuration_model::Quarantined;
use murmuration_swarm::CheckpointDigest;
use std::sync::Arc;
use tokio::sync::watch;

/// A handle on the dispatcher of trainings; cheap to clone.
#[derive(Debug, Clone)]
pub struct Trainers(Dispatch);

impl Trainers {
    /// Starts the dispatcher on the current runtime. The dispatcher refuses the machines in `wrong`, which were quarantined
    /// earlier.
    #[must_use]
    pub fn start(options: Options, metrics: DispatchMetrics, wrong: Vec<Quarantined>) -> Self {
        Self(Dispatch::start(options, metrics, wrong))
    }

    /// Trains an embedder on a trainer, which publishes the embedder; `job_progress` receives the progress. Dropping the future
    /// withdraws the job.
    ///
    /// # Errors
    /// See [`JobError`].
    pub async fn train(
        &self,
        job: TrainingJob,
        job_progress: Arc<JobProgress>,
    ) -> Result<CheckpointDigest, JobError> {
        self.0.submit_one(job, job_progress).await
    }

    /// Receiver of the number of trainers that take work: the current number, and each change.
    #[must_use]
    pub fn connected(&self) -> watch::Receiver<usize> {
        self.0.workers()
    }

    /// Receiver of the quarantined machines, oldest first: the current list, and each addition.
    #[must_use]
    pub fn quarantined(&self) -> watch::Receiver<Vec<Quarantined>> {
        self.0.quarantined()
    }

    /// Ends every trainer's stream and every training; the trainings continue with the next coordinator.
    pub async fn stop(&self) {
        self.0.stop().await;
    }

    /// All connected trainers, by name.
    pub async fn machines(&self) -> Vec<ConnectedMachine> {
        self.dispatch().connected().await
    }

    /// The dispatcher of the trainers' streams.
    pub const fn dispatch(&self) -> &Dispatch {
        &self.0
    }
}
