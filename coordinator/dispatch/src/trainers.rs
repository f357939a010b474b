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
    /// Starts the dispatcher on the current runtime. It refuses the machines in `wrong`, which were quarantined before.
    #[must_use]
    pub fn start(options: Options, metrics: DispatchMetrics, wrong: Vec<Quarantined>) -> Self {
        Self(Dispatch::start(options, metrics, wrong))
    }

    /// Trains an embedder on a trainer, which publishes it; `job_progress` receives the progress. Dropping the future withdraws the
    /// job.
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

    /// Number of trainers that take work, now and whenever it changes.
    #[must_use]
    pub fn connected(&self) -> watch::Receiver<usize> {
        self.0.workers()
    }

    /// Quarantined machines, oldest first, now and whenever one is added.
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
