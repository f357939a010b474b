//! One lease's training, from its task to the published checkpoint.

use super::{course::Course, dataset, task::Task};
use murmuration_embed::Runtime;
use murmuration_link::{Coordinator, attempts, follow, for_lease, may_pass_elsewhere, stopped};
use murmuration_proto::{
    CheckpointDigest,
    v1::{self, batch_result::Outcome, checkpoint_service_client::CheckpointServiceClient},
};
use std::{fmt, sync::Arc};
use tokio::{
    sync::{Mutex, mpsc, watch},
    task::{JoinError, JoinSet, spawn_blocking},
};
use tonic::Status;
use tracing::{Instrument as _, Span};

/// Events that may wait to be sent: a training that is ahead of the network waits.
const EVENTS: usize = 4;

/// What a training has to say.
#[derive(Debug)]
pub(super) enum Event {
    /// How far it has come.
    Progress(v1::TrainingProgress),
    /// It was put aside after so many epochs, as these bytes.
    Snapshot { epoch: u64, bytes: Vec<u8> },
    /// It is over.
    Done(Outcome),
}

/// Why a training was not done.
#[derive(Debug)]
pub(super) struct Undone {
    class: v1::FailureClass,
    message: String,
}

impl Undone {
    /// It would fail anywhere, as far as this trainer can tell: the coordinator asks another.
    pub(super) fn fatal(message: impl fmt::Display) -> Self {
        Self {
            class: v1::FailureClass::Fatal,
            message: message.to_string(),
        }
    }

    /// Another trainer, or a later attempt, may do it.
    pub(super) fn retryable(message: impl fmt::Display) -> Self {
        Self {
            class: v1::FailureClass::Retryable,
            message: message.to_string(),
        }
    }

    /// A call failed for good; or the coordinator was away for too long, or did not let this trainer in.
    pub(super) fn call(what: &str, status: &Status) -> Self {
        let message = format!("{what}: {}", status.message());
        match may_pass_elsewhere(status) {
            true => Self::retryable(message),
            false => Self::fatal(message),
        }
    }
}

impl fmt::Display for Undone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<JoinError> for Undone {
    fn from(error: JoinError) -> Self {
        Self::fatal(format!("the training broke: {error}"))
    }
}

impl From<Undone> for Outcome {
    fn from(Undone { class, message }: Undone) -> Self {
        Self::Failure(v1::Failure {
            class: class.into(),
            message,
        })
    }
}

/// A training under way. It ends where this is dropped, a computing epoch first running to its end.
pub(super) struct Running {
    pub(super) lease: v1::LeaseId,
    events: mpsc::Receiver<Event>,
    /// Ends with this.
    _job: JoinSet<()>,
}

impl Running {
    /// Begins as soon as it is its turn.
    pub(super) fn start(
        lease: v1::LeaseId,
        task: Task,
        coordinator: Coordinator,
        turn: Arc<Mutex<()>>,
        stop: watch::Receiver<bool>,
    ) -> Self {
        let (sender, events) = mpsc::channel(EVENTS);
        let mut job = JoinSet::new();
        let span = tracing::info_span!("lease", id = %lease, campaign = task.campaign);
        follow(&span, &task.trace_parent);
        let training = async move {
            let outcome = match train(task, coordinator, turn, stop, sender.clone()).await {
                Ok(digest) => Outcome::Checkpoint(digest.to_string()),
                Err(undone) => undone.into(),
            };
            // Nobody may want to know any more.
            let _ = sender.send(Event::Done(outcome)).await;
        };
        job.spawn(training.instrument(span));
        Self {
            lease,
            events,
            _job: job,
        }
    }

    /// What it has to say next.
    pub(super) async fn next(&mut self) -> Event {
        let broke = || Event::Done(Undone::fatal("the training broke").into());
        self.events.recv().await.unwrap_or_else(broke)
    }
}

async fn train(
    task: Task,
    coordinator: Coordinator,
    turn: Arc<Mutex<()>>,
    mut stop: watch::Receiver<bool>,
    events: mpsc::Sender<Event>,
) -> Result<CheckpointDigest, Undone> {
    // First of all: nobody should train for long to learn that it cannot be checked. Another trainer may have the library.
    let runtime = spawn_blocking(Runtime::load).await?.map_err(Undone::retryable)?;
    let (lease, turn) = (task.lease, turn.lock_owned().await);
    let material = tokio::select! {
        fetched = dataset::fetch(&task, &coordinator) => fetched?,
        () = stopped(&mut stop) => return Err(Undone::retryable("the trainer is leaving")),
    };
    let course = Course {
        task,
        material,
        runtime,
        events,
        stop,
    };
    let span = Span::current();
    let publication = spawn_blocking(move || {
        let _in_lease = span.entered();
        let publication = course.run();
        drop(turn);
        publication
    });
    let publication = publication.await??;
    attempts(|| {
        let mut client = CheckpointServiceClient::new(coordinator.clone());
        let requests = for_lease(tokio_stream::iter(publication.requests()), lease);
        async move { client.publish_checkpoint(requests).await }
    })
    .await
    .map_err(|status| Undone::call("the checkpoint cannot be published", &status))?;
    let digest = publication.digest();
    tracing::info!(%digest, "published");
    Ok(digest)
}
