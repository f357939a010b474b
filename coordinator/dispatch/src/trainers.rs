//! A dispatcher of its own for trainers: what they lease takes minutes and belongs to one of them at a time.

use super::{ConnectedMachine, Dispatch, JobError, JobProgress, Options, TrainingJob};
use crate::DispatchMetrics;
use murmuration_model::Quarantined;
use murmuration_proto::CheckpointDigest;
use std::sync::Arc;
use tokio::sync::watch;

/// A handle on the dispatcher of trainings; cheap to clone.
#[derive(Debug, Clone)]
pub struct Trainers(Dispatch);

impl Trainers {
    /// Starts it on the current runtime. It does not listen to machines that were found wrong before.
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

    /// Machines that were found wrong, oldest first, now and whenever there is another.
    #[must_use]
    pub fn quarantined(&self) -> watch::Receiver<Vec<Quarantined>> {
        self.0.quarantined()
    }

    /// Ends every trainer's stream and every training; those go on with the next coordinator.
    pub async fn stop(&self) {
        self.0.stop().await;
    }

    /// Every trainer that is connected, by name.
    pub async fn machines(&self) -> Vec<ConnectedMachine> {
        self.dispatch().connected().await
    }

    /// The dispatcher of the trainers' streams.
    pub const fn dispatch(&self) -> &Dispatch {
        &self.0
    }
}
