//! The streams of workers and trainers. Each stream is validated and forwarded to a dispatcher.

use super::{lease_id, snapshots::Snapshots, status::blamed};
use crate::status::OrStatus as _;
use murmuration_access::origin;
use murmuration_dispatch::{Dispatch, JoinRequest, OUTBOX, TrainingLease, WorkerId, WorkerReport};
use murmuration_model::Origin;
use murmuration_proto::{PROTOCOL_VERSION, SIMULATOR_VERSION, v1};
use murmuration_store::{Store, StoreError};
use murmuration_swarm::{CheckpointDigest, Invalid, Lineage, Text, text};
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio_stream::{StreamExt as _, wrappers::ReceiverStream};
use tonic::{Request, Response, Status, Streaming};
use tracing::Instrument as _;

/// Time limit for the Hello on a new connection.
const HELLO_LIMIT: Duration = Duration::from_secs(5);
const MAX_NAME_CHARS: usize = 128;
const MAX_CAPACITY: u32 = 4096;
const MAX_CREDITS: u32 = 65_536;

/// Implements `murmuration.v1.WorkerService`.
#[derive(Debug, Clone)]
pub struct WorkerApi {
    /// The dispatcher that leases work to workers.
    pub dispatch: Dispatch,
}

#[tonic::async_trait]
impl v1::worker_service_server::WorkerService for WorkerApi {
    type WorkStream = ReceiverStream<Result<v1::CoordinatorMessage, Status>>;

    async fn work(
        &self,
        request: Request<Streaming<v1::WorkerMessage>>,
    ) -> Result<Response<Self::WorkStream>, Status> {
        serve(&self.dispatch, request, Peer::Worker, check_simulator).await
    }
}

/// The client at the other end of a stream.
#[derive(Debug)]
pub(super) enum Peer {
    Worker,
    /// A trainer, with the store in which it publishes checkpoints.
    Trainer(Store),
}

/// Checks that the peer's version suits this coordinator.
type CheckVersion = fn(&v1::Hello) -> Result<(), Status>;

/// Welcomes the peer, and forwards its messages until its stream ends.
pub(super) async fn serve(
    dispatch: &Dispatch,
    request: Request<Streaming<v1::WorkerMessage>>,
    peer: Peer,
    check: CheckVersion,
) -> Result<Response<ReceiverStream<Result<v1::CoordinatorMessage, Status>>>, Status> {
    let from = machine_of(&request)?;
    let mut inbox = request.into_inner();
    let hello = hello(&mut inbox, check).await?;
    let (outbox, stream) = mpsc::channel(OUTBOX);
    let (present, dismissed) = oneshot::channel();
    let join_request = JoinRequest {
        name: hello.name,
        origin: from,
        instance: (hello.instance != 0).then_some(hello.instance),
        kind: hello.embedding_kind.into(),
        capacity: hello.capacity as usize,
        outbox: outbox.clone(),
        present,
    };
    let worker = dispatch.join(join_request).await.or_status()?;
    let dispatch = dispatch.clone();
    let stream_ends = async move {
        let passed_on = tokio::select! {
            passed_on = pass_on(&dispatch, worker, peer, &mut inbox) => passed_on,
            // Further messages of a dismissed worker must not stay in memory.
            _ = dismissed => return,
        };
        if let Err(status) = passed_on {
            tracing::debug!(?worker, %status, "worker stream broke");
            // The worker may have disconnected.
            let _ = outbox.try_send(Err(status));
        }
        dispatch.report(worker, WorkerReport::Gone).await;
    };
    tokio::spawn(stream_ends.in_current_span());
    Ok(Response::new(ReceiverStream::new(stream)))
}

pub(super) fn machine_of<T>(request: &Request<T>) -> Result<Origin, Status> {
    origin(request.extensions()).ok_or_else(|| Status::internal("this connection has no address"))
}

async fn hello(inbox: &mut Streaming<v1::WorkerMessage>, check: CheckVersion) -> Result<v1::Hello, Status> {
    let first = tokio::time::timeout(HELLO_LIMIT, inbox.message())
        .await
        .map_err(|_| Status::deadline_exceeded("no Hello within 5 seconds"))??;
    let Some(v1::worker_message::Message::Hello(hello)) = first.and_then(|first| first.message) else {
        return Err(Status::failed_precondition("the first message must be Hello"));
    };
    let name = text::name("hello.name", &hello.name, MAX_NAME_CHARS)?;
    let hello = v1::Hello { name, ..hello };
    check(&hello)?;
    if !(1..=MAX_CAPACITY).contains(&hello.capacity) {
        return Err(Invalid::new(
            "hello.capacity",
            hello.capacity,
            format!("from 1 to {MAX_CAPACITY}"),
        )
        .into());
    }
    Ok(hello)
}

fn check_simulator(hello: &v1::Hello) -> Result<(), Status> {
    let (kind, needed, has) = if hello.simulator_version != SIMULATOR_VERSION {
        let has = Text::line(&hello.simulator_version).to_string();
        ("simulator", SIMULATOR_VERSION.to_owned(), has)
    } else if hello.protocol_version != PROTOCOL_VERSION {
        let has = hello.protocol_version.to_string();
        ("protocol", PROTOCOL_VERSION.to_string(), has)
    } else {
        return Ok(());
    };
    Err(Status::failed_precondition(format!(
        "this coordinator needs workers with {kind} version {needed}, worker \"{}\" has version {has}: run the \
         murmuration-worker that came with the coordinator",
        hello.name,
    )))
}

/// Forwards the messages of a worker or trainer until its stream ends.
async fn pass_on(
    dispatch: &Dispatch,
    worker: WorkerId,
    peer: Peer,
    inbox: &mut Streaming<v1::WorkerMessage>,
) -> Result<(), Status> {
    use v1::worker_message::Message;
    let mut snapshots = Snapshots::of(dispatch.clone(), worker);
    while let Some(message) = inbox.next().await {
        let message = message.map_err(blamed)?.message;
        let more = more_credits(message.as_ref())?;
        let report = match (message, &peer) {
            (Some(Message::Snapshot(_) | Message::Training(_)), Peer::Worker) => {
                let allowed = "a message of a worker: only trainers save and report trainings";
                return Err(Invalid::new("message", "about a training", allowed).into());
            }
            (Some(Message::Snapshot(part)), Peer::Trainer(_)) => snapshots.add(part).await?,
            (message, Peer::Trainer(store)) => published(report(message)?, dispatch, worker, store).await?,
            (message, Peer::Worker) => report(message)?,
        };
        dispatch.report(worker, report).await;
        if let Some(credits) = more {
            dispatch.report(worker, credits).await;
        }
    }
    Ok(())
}

/// The credits that come with a result.
fn more_credits(message: Option<&v1::worker_message::Message>) -> Result<Option<WorkerReport>, Invalid> {
    match message {
        Some(v1::worker_message::Message::Result(result)) if result.credits > 0 => {
            credits("result.credits", result.credits).map(Some)
        }
        _ => Ok(None),
    }
}

fn credits(field: &str, evaluations: u32) -> Result<WorkerReport, Invalid> {
    match evaluations {
        1..=MAX_CREDITS => Ok(WorkerReport::Credits(evaluations as usize)),
        _ => Err(Invalid::new(
            field,
            evaluations,
            format!("from 1 to {MAX_CREDITS}"),
        )),
    }
}

/// Returns the report. If its checkpoint was never published or belongs to another training, its digest is replaced by invalid
/// text, so that the dispatcher treats it like any impossible result.
async fn published(
    report: WorkerReport,
    dispatch: &Dispatch,
    worker: WorkerId,
    store: &Store,
) -> Result<WorkerReport, Status> {
    use v1::batch_result::Outcome;
    let WorkerReport::Result {
        epoch,
        lease,
        outcome: Outcome::Checkpoint(digest),
    } = report
    else {
        return Ok(report);
    };
    let outcome = match digest.parse::<CheckpointDigest>() {
        Ok(named) => {
            let found = store.run(move |store| store.checkpoint(named)).await;
            match found {
                Err(StoreError::NoCheckpoint(_)) => Outcome::Checkpoint(format!("unpublished {digest}")),
                found => {
                    let lineage = found.or_status()?.lineage;
                    let lease = dispatch.training_lease(worker, epoch, lease).await;
                    Outcome::Checkpoint(if is_of(&lineage, &lease) {
                        digest
                    } else {
                        format!("of another training: {digest}")
                    })
                }
            }
        }
        // The dispatcher rejects an invalid digest.
        Err(_) => Outcome::Checkpoint(digest),
    };
    Ok(WorkerReport::Result {
        epoch,
        lease,
        outcome,
    })
}

/// Whether a checkpoint can be the result of the training under a lease. If the lease is not held, the dispatcher rejects the
/// result.
fn is_of(lineage: &Lineage, lease: &TrainingLease) -> bool {
    let TrainingLease::Held(training) = lease else {
        return true;
    };
    lineage.parent == training.parent && lineage.configuration == training.configuration.to_toml()
}

/// The report in a message other than a snapshot.
fn report(message: Option<v1::worker_message::Message>) -> Result<WorkerReport, Invalid> {
    use v1::worker_message::Message;
    match message {
        Some(Message::Credits(message)) => credits("credits.evaluations", message.evaluations),
        Some(Message::Result(result)) => {
            let (epoch, lease) = lease_id(result.lease, "result.lease")?;
            let outcome = result
                .outcome
                .ok_or_else(|| Invalid::missing("result.outcome", "an outcome"))?;
            Ok(WorkerReport::Result {
                epoch,
                lease,
                outcome: cleaned(outcome),
            })
        }
        Some(Message::Training(report)) => {
            let (epoch, lease) = lease_id(report.lease, "training.lease")?;
            Ok(WorkerReport::Training {
                epoch,
                lease,
                progress: believable(report.progress.unwrap_or_default()),
            })
        }
        Some(Message::Heartbeat(_)) => Ok(WorkerReport::Heartbeat),
        Some(Message::Drain(_)) => Ok(WorkerReport::Drain),
        Some(Message::Hello(_)) => Err(Invalid::new("message", "a second Hello", "anything else")),
        Some(Message::Snapshot(_)) | None => Err(Invalid::missing("message", "one of WorkerMessage's kinds")),
    }
}

/// Shortens and cleans a failure's message, which is stored, logged and displayed.
fn cleaned(outcome: v1::batch_result::Outcome) -> v1::batch_result::Outcome {
    match outcome {
        v1::batch_result::Outcome::Failure(failure) => v1::batch_result::Outcome::Failure(v1::Failure {
            message: Text::line(&failure.message).into(),
            ..failure
        }),
        outcome => outcome,
    }
}

/// Removes impossible figures from progress, because it is displayed: a loss that is not finite, or a figure that no training
/// has.
fn believable(progress: v1::TrainingProgress) -> v1::TrainingProgress {
    let within = |value: Option<f64>, most: f64| value.filter(|value| (0.0..=most).contains(value));
    let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
    v1::TrainingProgress {
        epoch: progress.epoch,
        epochs: progress.epochs,
        loss: finite(progress.loss),
        learning_rate: within(progress.learning_rate, 1e3),
        triplets_per_second: within(progress.triplets_per_second, 1e15),
        seconds_left: within(progress.seconds_left, 1e10),
        triplet_accuracy: within(progress.triplet_accuracy, 1.0),
        spread: finite(progress.spread),
        rank: finite(progress.rank),
    }
}
