//! The service for workers: one bidirectional stream each, handed to the dispatcher.

use crate::{
    dispatch::{Dispatch, OUTBOX, WorkerReport},
    leases::{LeaseNumber, WorkerId},
};
use murmuration_proto::{Invalid, SIMULATOR_VERSION, v1};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_stream::{StreamExt as _, wrappers::ReceiverStream};
use tonic::{Request, Response, Status, Streaming};

/// Time that a new connection has to say Hello.
const HELLO_LIMIT: Duration = Duration::from_secs(5);
const MAX_NAME_BYTES: usize = 128;
const MAX_CAPACITY: u32 = 4096;
const MAX_CREDITS: u32 = 65_536;

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
        let mut inbox = request.into_inner();
        let hello = hello(&mut inbox).await?;
        let (outbox, stream) = mpsc::channel(OUTBOX);
        let worker = self
            .dispatch
            .join(hello.name, hello.capacity as usize, outbox.clone())
            .await
            .ok_or_else(|| Status::unavailable("the coordinator is shutting down"))?;
        let dispatch = self.dispatch.clone();
        tokio::spawn(async move {
            if let Err(status) = pass_on(&dispatch, worker, &mut inbox).await {
                tracing::debug!(?worker, %status, "worker stream broke");
                // The worker may be gone already.
                let _ = outbox.try_send(Err(status));
            }
            dispatch.report(worker, WorkerReport::Gone).await;
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

async fn hello(inbox: &mut Streaming<v1::WorkerMessage>) -> Result<v1::Hello, Status> {
    let first = tokio::time::timeout(HELLO_LIMIT, inbox.message())
        .await
        .map_err(|_| Status::deadline_exceeded("no Hello within 5 seconds"))??;
    let Some(v1::worker_message::Message::Hello(hello)) = first.and_then(|first| first.message) else {
        return Err(Status::failed_precondition("the first message must be Hello"));
    };
    if hello.simulator_version != SIMULATOR_VERSION {
        return Err(Status::failed_precondition(format!(
            "this coordinator needs workers with simulator version {SIMULATOR_VERSION}, worker \"{}\" has version \
             {}: run the murmuration-worker that came with the coordinator",
            hello.name.escape_debug(),
            hello.simulator_version.escape_debug(),
        )));
    }
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

/// Passes on what the worker says until its stream ends.
async fn pass_on(
    dispatch: &Dispatch,
    worker: WorkerId,
    inbox: &mut Streaming<v1::WorkerMessage>,
) -> Result<(), Status> {
    while let Some(message) = inbox.next().await {
        dispatch.report(worker, report(message?)?).await;
    }
    Ok(())
}

fn report(message: v1::WorkerMessage) -> Result<WorkerReport, Invalid> {
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
            let lease = result
                .lease
                .ok_or_else(|| Invalid::new("result.lease", "nothing", "a lease id"))?;
            let outcome = result
                .outcome
                .ok_or_else(|| Invalid::new("result.outcome", "nothing", "an outcome"))?;
            Ok(WorkerReport::Result {
                epoch: lease.epoch,
                lease: LeaseNumber(lease.number),
                outcome,
            })
        }
        Some(Message::Heartbeat(_)) => Ok(WorkerReport::Heartbeat),
        Some(Message::Drain(_)) => Ok(WorkerReport::Drain),
        Some(Message::Hello(_)) => Err(Invalid::new("message", "a second Hello", "anything else")),
        None => Err(Invalid::new("message", "nothing", "one of WorkerMessage's kinds")),
    }
}
