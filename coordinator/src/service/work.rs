//! The streams of workers and trainers: one each, validated and handed to a dispatcher.

use crate::{
    dispatch::{Dispatch, Newcomer, NotWelcome, OUTBOX, WorkerReport},
    leases::{Instance, LeaseNumber, WorkerId},
    store::SavedTraining,
};
use murmuration_proto::{Invalid, SIMULATOR_VERSION, v1};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_stream::{StreamExt as _, wrappers::ReceiverStream};
use tonic::{Request, Response, Status, Streaming};
use tracing::Instrument as _;

/// Time that a new connection has to say Hello.
const HELLO_LIMIT: Duration = Duration::from_secs(5);
const MAX_NAME_BYTES: usize = 128;
const MAX_CAPACITY: u32 = 4096;
const MAX_CREDITS: u32 = 65_536;
/// Largest training that is put aside: the weights of the largest network, the optimiser's two moments of each, and the
/// best weights.
const MAX_SNAPSHOT_BYTES: usize = 300 << 20;

/// Implements `murmuration.v1.WorkerService`.
#[derive(Debug, Clone)]
pub struct WorkerApi {
    /// Who leases work out.
    pub dispatch: Dispatch,
}

#[tonic::async_trait]
impl v1::worker_service_server::WorkerService for WorkerApi {
    type WorkStream = ReceiverStream<Result<v1::CoordinatorMessage, Status>>;

    async fn work(
        &self,
        request: Request<Streaming<v1::WorkerMessage>>,
    ) -> Result<Response<Self::WorkStream>, Status> {
        serve(&self.dispatch, request.into_inner(), check_simulator).await
    }
}

/// Whether a new connection is of a version that this coordinator can work with.
pub(super) type CheckVersion = fn(&v1::Hello) -> Result<(), Status>;

/// Welcomes whoever is at the other end, and passes on what it says for as long as its stream lasts.
pub(super) async fn serve(
    dispatch: &Dispatch,
    mut inbox: Streaming<v1::WorkerMessage>,
    check: CheckVersion,
) -> Result<Response<ReceiverStream<Result<v1::CoordinatorMessage, Status>>>, Status> {
    let hello = hello(&mut inbox, check).await?;
    let (outbox, stream) = mpsc::channel(OUTBOX);
    let newcomer = Newcomer {
        name: hello.name,
        instance: (hello.instance != 0).then_some(Instance(hello.instance)),
        kind: hello.embedding_kind.into(),
        capacity: hello.capacity as usize,
        outbox: outbox.clone(),
    };
    let worker = dispatch.join(newcomer).await?;
    let dispatch = dispatch.clone();
    let stream_ends = async move {
        if let Err(status) = pass_on(&dispatch, worker, &mut inbox).await {
            tracing::debug!(?worker, %status, "worker stream broke");
            // The worker may be gone already.
            let _ = outbox.try_send(Err(status));
        }
        dispatch.report(worker, WorkerReport::Gone).await;
    };
    tokio::spawn(stream_ends.in_current_span());
    Ok(Response::new(ReceiverStream::new(stream)))
}

impl From<NotWelcome> for Status {
    fn from(reason: NotWelcome) -> Self {
        match reason {
            NotWelcome::ShuttingDown => Self::unavailable(reason.to_string()),
            NotWelcome::Quarantined => Self::failed_precondition(reason.to_string()),
        }
    }
}

async fn hello(inbox: &mut Streaming<v1::WorkerMessage>, check: CheckVersion) -> Result<v1::Hello, Status> {
    let first = tokio::time::timeout(HELLO_LIMIT, inbox.message())
        .await
        .map_err(|_| Status::deadline_exceeded("no Hello within 5 seconds"))??;
    let Some(v1::worker_message::Message::Hello(hello)) = first.and_then(|first| first.message) else {
        return Err(Status::failed_precondition("the first message must be Hello"));
    };
    check(&hello)?;
    if hello.name.len() > MAX_NAME_BYTES {
        let value = format!("{} bytes", hello.name.len());
        return Err(Invalid::new("hello.name", value, format!("at most {MAX_NAME_BYTES} bytes")).into());
    }
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
    if hello.simulator_version == SIMULATOR_VERSION {
        return Ok(());
    }
    Err(Status::failed_precondition(format!(
        "this coordinator needs workers with simulator version {SIMULATOR_VERSION}, worker \"{}\" has version {}: run \
         the murmuration-worker that came with the coordinator",
        hello.name.escape_debug(),
        hello.simulator_version.escape_debug(),
    )))
}

/// Passes on what the worker says until its stream ends.
async fn pass_on(
    dispatch: &Dispatch,
    worker: WorkerId,
    inbox: &mut Streaming<v1::WorkerMessage>,
) -> Result<(), Status> {
    let mut snapshot = Vec::new();
    while let Some(message) = inbox.next().await {
        dispatch.report(worker, report(message?, &mut snapshot)?).await;
    }
    Ok(())
}

/// Adds a part of a snapshot: the whole, if it was the last, else a sign of life.
fn saved(whole: &mut Vec<u8>, part: v1::TrainingSnapshot) -> Result<WorkerReport, Invalid> {
    if whole.len() + part.data.len() > MAX_SNAPSHOT_BYTES {
        let allowed = format!("at most {MAX_SNAPSHOT_BYTES} bytes");
        return Err(Invalid::new("snapshot", "more", allowed));
    }
    whole.extend_from_slice(&part.data);
    if !part.last {
        return Ok(WorkerReport::Heartbeat);
    }
    let (epoch, lease) = lease_id(part.lease, "snapshot.lease")?;
    let training = SavedTraining {
        epoch: part.epoch,
        bytes: std::mem::take(whole),
    };
    Ok(WorkerReport::Saved {
        epoch,
        lease,
        training,
    })
}

fn lease_id(lease: Option<v1::LeaseId>, field: &str) -> Result<(u64, LeaseNumber), Invalid> {
    let lease = lease.ok_or_else(|| Invalid::new(field, "nothing", "a lease id"))?;
    Ok((lease.epoch, LeaseNumber(lease.number)))
}

/// What a message says; parts of a snapshot gather in `snapshot`.
fn report(message: v1::WorkerMessage, snapshot: &mut Vec<u8>) -> Result<WorkerReport, Invalid> {
    use v1::worker_message::Message;
    match message.message {
        Some(Message::Credits(credits)) if (1..=MAX_CREDITS).contains(&credits.evaluations) => {
            Ok(WorkerReport::Credits(credits.evaluations as usize))
        }
        Some(Message::Credits(credits)) => Err(Invalid::new(
            "credits.evaluations",
            credits.evaluations,
            format!("from 1 to {MAX_CREDITS}"),
        )),
        Some(Message::Result(result)) => {
            let (epoch, lease) = lease_id(result.lease, "result.lease")?;
            let outcome = result
                .outcome
                .ok_or_else(|| Invalid::new("result.outcome", "nothing", "an outcome"))?;
            Ok(WorkerReport::Result {
                epoch,
                lease,
                outcome,
            })
        }
        Some(Message::Training(report)) => {
            let (epoch, lease) = lease_id(report.lease, "training.lease")?;
            Ok(WorkerReport::Training {
                epoch,
                lease,
                progress: finite(report.progress.unwrap_or_default()),
            })
        }
        Some(Message::Snapshot(part)) => saved(snapshot, part),
        Some(Message::Heartbeat(_)) => Ok(WorkerReport::Heartbeat),
        Some(Message::Drain(_)) => Ok(WorkerReport::Drain),
        Some(Message::Hello(_)) => Err(Invalid::new("message", "a second Hello", "anything else")),
        None => Err(Invalid::new("message", "nothing", "one of WorkerMessage's kinds")),
    }
}

/// Progress is shown to people: a loss that is no number any more is shown as none.
fn finite(progress: v1::TrainingProgress) -> v1::TrainingProgress {
    let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
    v1::TrainingProgress {
        epoch: progress.epoch,
        epochs: progress.epochs,
        loss: finite(progress.loss),
        learning_rate: finite(progress.learning_rate),
        triplets_per_second: finite(progress.triplets_per_second),
        seconds_left: finite(progress.seconds_left),
        triplet_accuracy: finite(progress.triplet_accuracy),
        spread: finite(progress.spread),
        rank: finite(progress.rank),
    }
}
