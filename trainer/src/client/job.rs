//! One lease's training, from its task to the published checkpoint.

use super::{
    dataset,
    event::{Event, Undone},
    task::Task,
    training_run::TrainingRun,
};
use murmuration_embed::Runtime;
use murmuration_link::{Calls, attempts, follow, for_lease, stopped};
use murmuration_proto::v1::{
    self, batch_result::Outcome, checkpoint_service_client::CheckpointServiceClient,
};
use murmuration_swarm::CheckpointDigest;
use std::sync::Arc;
use tokio::{
    sync::{Mutex, mpsc, watch},
    task::{JoinSet, spawn_blocking},
};
use tracing::{Instrument as _, Span};

/// Maximum number of events that wait to be sent. A training that is faster than the network waits.
const EVENTS: usize = 4;

/// A running training. Dropping a `Running` ends its training after the current epoch.
pub(super) struct Running {
    pub(super) lease: v1::LeaseId,
    events: mpsc::Receiver<Event>,
    _job: JoinSet<()>,
}

impl Running {
    /// Starts a training, which computes as soon as no other training computes.
    pub(super) fn start(
        lease: v1::LeaseId,
        task: Task,
        calls: Calls,
        turn: Arc<Mutex<()>>,
        stop: watch::Receiver<bool>,
    ) -> Self {
        let (sender, events) = mpsc::channel(EVENTS);
        let mut job = JoinSet::new();
        let span = tracing::info_span!("lease", id = %lease, campaign = task.campaign);
        follow(&span, &task.trace_parent);
        let training = async move {
            let outcome = match train(task, calls, turn, stop, sender.clone()).await {
                Ok(digest) => Outcome::Checkpoint(digest.to_string()),
                Err(undone) => undone.into(),
            };
            // An abandoned training has no receiver for its outcome.
            let _ = sender.send(Event::Done(outcome)).await;
        };
        job.spawn(training.instrument(span));
        Self {
            lease,
            events,
            _job: job,
        }
    }

    pub(super) async fn next(&mut self) -> Event {
        let broke = || Event::Done(Undone::fatal("the training broke").into());
        self.events.recv().await.unwrap_or_else(broke)
    }
}

async fn train(
    task: Task,
    calls: Calls,
    turn: Arc<Mutex<()>>,
    mut stop: watch::Receiver<bool>,
    events: mpsc::Sender<Event>,
) -> Result<CheckpointDigest, Undone> {
    // ONNX Runtime is loaded first: without it, the result of a long training could not be checked and would be lost. The error
    // is retryable, because another trainer may have the library.
    let runtime = spawn_blocking(Runtime::load).await?.map_err(Undone::retryable)?;
    let (lease, turn) = (task.lease, turn.lock_owned().await);
    let material = tokio::select! {
        fetched = dataset::fetch(&task, &calls) => fetched?,
        () = stopped(&mut stop) => return Err(Undone::retryable("the trainer is leaving")),
    };
    let course = TrainingRun {
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
        let requests = for_lease(tokio_stream::iter(publication.requests()), lease);
        let coordinator = calls.coordinator();
        async move {
            CheckpointServiceClient::new(coordinator?)
                .publish_checkpoint(requests)
                .await
        }
    })
    .await
    .map_err(|status| Undone::call("the checkpoint cannot be published", &status))?;
    let digest = publication.digest();
    tracing::info!(%digest, "published");
    Ok(digest)
}
