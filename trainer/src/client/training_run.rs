//! Runs the epochs of a training one after the other, on a thread that may block.

use super::{
    dataset::TrainingInputs,
    event::{Event, Undone},
    task::Task,
};
use crate::publication::Publication;
use murmuration_embed::Runtime;
use murmuration_proto::v1;
use murmuration_train::training::{Progress, Training, TrainingError};
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, watch};

/// Minimum time between two snapshots. Without this pause, small trainings would spend more time on sending snapshots than on
/// computing.
const SNAPSHOT_PAUSE: Duration = Duration::from_millis(500);

pub(super) struct TrainingRun {
    pub(super) task: Task,
    pub(super) material: TrainingInputs,
    pub(super) runtime: Runtime,
    /// Channel for the training's events; closed when the training is no longer wanted.
    pub(super) events: mpsc::Sender<Event>,
    pub(super) stop: watch::Receiver<bool>,
}

impl TrainingRun {
    /// Trains to the end, or until the training is stopped or unwanted.
    pub(super) fn run(mut self) -> Result<Publication, Undone> {
        let mut training = self.begin()?;
        let epochs = self.task.configuration.recipe().epochs();
        self.tell(Event::Progress(v1::TrainingProgress {
            epoch: training.epoch(),
            epochs,
            ..v1::TrainingProgress::default()
        }))?;
        let mut put_aside = (training.epoch(), None::<Instant>);
        while training.ending().is_none() {
            if *self.stop.borrow() {
                if training.epoch() > put_aside.0 {
                    self.tell(snapshot(&training))?;
                }
                return Err(Undone::retryable("the trainer is leaving"));
            }
            let begun = Instant::now();
            let Some(progress) = training.step() else { break };
            self.tell(Event::Progress(message(&progress, begun.elapsed())))?;
            if put_aside.1.is_none_or(|last| last.elapsed() >= SNAPSHOT_PAUSE) {
                self.tell(snapshot(&training))?;
                put_aside = (training.epoch(), Some(Instant::now()));
            }
        }
        tracing::info!(
            epochs = training.epoch(),
            ending = ?training.ending(),
            "trained"
        );
        let configuration = &self.task.configuration;
        Publication::of(&training, configuration, &self.material.pictures, &self.runtime)
            .map_err(Undone::fatal)
    }

    /// The training, continued from its snapshot if possible.
    fn begin(&mut self) -> Result<Training, Undone> {
        let saved = std::mem::take(&mut self.material.saved);
        if !saved.is_empty() {
            match self.fresh().and_then(|training| training.taken_up(&saved)) {
                Err(error @ (TrainingError::Damaged(_) | TrainingError::Other(_))) => {
                    tracing::warn!(%error, "training from the first epoch");
                }
                restored => return restored.map_err(Undone::fatal),
            }
        }
        self.fresh().map_err(Undone::fatal)
    }

    /// The training before its first epoch.
    fn fresh(&self) -> Result<Training, TrainingError> {
        let (configuration, pictures) = (&self.task.configuration, self.material.pictures.clone());
        match &self.material.fine_tuning {
            Some(fine_tuning) => Training::fine_tune(configuration, pictures, fine_tuning.clone()),
            None => Training::new(configuration, pictures),
        }
    }

    fn tell(&self, event: Event) -> Result<(), Undone> {
        self.events
            .blocking_send(event)
            .map_err(|_| Undone::retryable("the training was withdrawn"))
    }
}

fn snapshot(training: &Training) -> Event {
    Event::Snapshot {
        epoch: training.epoch(),
        bytes: training.save(),
    }
}

/// `took` is the time of the whole epoch, including the measurement of quality.
fn message(progress: &Progress, took: Duration) -> v1::TrainingProgress {
    let epochs_left = progress.epochs.saturating_sub(progress.epoch);
    v1::TrainingProgress {
        epoch: progress.epoch,
        epochs: progress.epochs,
        loss: Some(progress.loss),
        learning_rate: Some(progress.learning_rate),
        triplets_per_second: Some(progress.triplets_per_second()),
        seconds_left: Some(epochs_left as f64 * took.as_secs_f64()),
        triplet_accuracy: Some(progress.quality.triplet_accuracy),
        spread: Some(progress.quality.spread),
        rank: Some(progress.quality.rank),
    }
}
