//! The worker's network face: takes leases from a coordinator, has threads evaluate them, sends results.
//!
//! Stateless: whatever it holds can be lost, the coordinator gives it to another.

mod lease;
mod pool;

use lease::{Lease, Outcome};
use murmuration_proto::{
    SIMULATOR_VERSION, Stream as RandomStream,
    v1::{self, coordinator_message, worker_message, worker_service_client::WorkerServiceClient},
};
use pool::Pool;
use std::{num::NonZeroUsize, time::Duration};
use tokio::sync::{mpsc, watch};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status, Streaming, transport::Endpoint};

/// Work that one thread should have in hand: what it evaluates while the next lease travels.
const WORK_IN_HAND: Duration = Duration::from_millis(100);
/// Evaluations that one thread takes on at once: at first, and at most.
const FIRST_CREDITS: usize = 4;
const MOST_CREDITS: usize = 64;
/// Wait before connecting again: doubles from the first to the last, with jitter.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LAST_PAUSE: Duration = Duration::from_secs(5);
/// Largest lease taken: a batch is small, a specification too.
const MAX_LEASE: usize = 4 << 20;

/// What a worker needs to know.
#[derive(Debug, Clone)]
pub struct Options {
    /// URL of the coordinator, `http://HOST:PORT`.
    pub coordinator: String,
    /// Its name, for people.
    pub name: String,
    /// Evaluations at once, one a thread; at most 4,096.
    pub threads: NonZeroUsize,
}

/// Why a worker gave up. Anything that may pass is tried again for ever.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// The URL is not one.
    #[error("\"{0}\" is not a coordinator's URL (such as http://127.0.0.1:7700)")]
    Url(String),
    /// The coordinator does not take this worker.
    #[error("the coordinator refused this worker: {0}")]
    Refused(String),
    /// A thread could not be started.
    #[error("cannot start an evaluation thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// Works until `stop` becomes true: then it gives back what it has not begun, finishes the rest, and leaves.
///
/// # Errors
/// See [`WorkerError`].
pub async fn run(options: Options, mut stop: watch::Receiver<bool>) -> Result<(), WorkerError> {
    let endpoint = Endpoint::from_shared(options.coordinator.clone())
        .map_err(|_| WorkerError::Url(options.coordinator.clone()))?
        .connect_timeout(Duration::from_secs(5))
        .tcp_nodelay(true)
        .http2_keep_alive_interval(Duration::from_secs(2))
        .keep_alive_timeout(Duration::from_secs(3))
        .keep_alive_while_idle(true);
    let mut worker = Worker {
        pool: Pool::start(options.threads)?,
        options,
    };
    let mut pause = Backoff::new();
    loop {
        let error = match worker.session(&endpoint, &mut pause, stop.clone()).await {
            Ok(()) => return Ok(()),
            Err(Broken::Refused(status)) => return Err(WorkerError::Refused(status.message().to_owned())),
            Err(broken) => broken,
        };
        tracing::info!(worker = worker.options.name, %error, "not connected, will try again");
        tokio::select! {
            () = tokio::time::sleep(pause.next()) => {}
            () = stopped(&mut stop) => return Ok(()),
        }
    }
}

/// Waits until `stop` is true.
async fn stopped(stop: &mut watch::Receiver<bool>) {
    // Whoever could have said stop is gone: stop.
    let _ = stop.wait_for(|&stop| stop).await;
}

struct Worker {
    options: Options,
    pool: Pool,
}

/// Why a session ended early.
#[derive(Debug, thiserror::Error)]
enum Broken {
    #[error("no connection: {0}")]
    Connect(#[from] tonic::transport::Error),
    #[error("{}", .0.message())]
    Stream(#[from] Status),
    #[error("the coordinator closed the stream")]
    Closed,
    #[error("{}", .0.message())]
    Refused(Status),
}

type Outbox = mpsc::Sender<v1::WorkerMessage>;

impl Worker {
    /// One connection, from Hello to the end of the stream. `Ok` once it was asked to stop and has drained.
    async fn session(
        &mut self,
        endpoint: &Endpoint,
        pause: &mut Backoff,
        mut stop: watch::Receiver<bool>,
    ) -> Result<(), Broken> {
        let (outbox, mut inbox, heartbeat) = tokio::select! {
            connected = self.connect(endpoint) => connected?,
            () = stopped(&mut stop) => return Ok(()),
        };
        pause.reset();
        tracing::info!(
            worker = self.options.name,
            coordinator = self.options.coordinator,
            "connected"
        );
        let mut heartbeat = tokio::time::interval(heartbeat);
        let mut promised = 0;
        loop {
            let stopping = *stop.borrow();
            if stopping {
                return self.drain(&outbox).await;
            }
            let wanted = self.pool.room().saturating_sub(promised);
            if wanted > 0 {
                promised += wanted;
                let credits = v1::Credits {
                    evaluations: wanted as u32,
                };
                send(&outbox, worker_message::Message::Credits(credits)).await?;
            }
            tokio::select! {
                message = inbox.message() => {
                    let Some(message) = message? else { return Err(Broken::Closed) };
                    if let Some(coordinator_message::Message::Lease(message)) = message.message {
                        promised = promised.saturating_sub(self.take(message, &outbox).await?);
                    }
                }
                Some((id, outcome)) = self.pool.finished() => send(&outbox, outcome.message(id)).await?,
                _ = heartbeat.tick() => send(&outbox, worker_message::Message::Heartbeat(v1::Heartbeat {})).await?,
                () = stopped(&mut stop) => {}
            }
        }
    }

    async fn connect(
        &self,
        endpoint: &Endpoint,
    ) -> Result<(Outbox, Streaming<v1::CoordinatorMessage>, Duration), Broken> {
        let mut client =
            WorkerServiceClient::new(endpoint.connect().await?).max_decoding_message_size(MAX_LEASE);
        let (outbox, messages) = mpsc::channel(64);
        let hello = v1::Hello {
            name: self.options.name.clone(),
            simulator_version: SIMULATOR_VERSION.to_owned(),
            capacity: self.options.threads.get() as u32,
        };
        send(&outbox, worker_message::Message::Hello(hello)).await?;
        let refused = |status: Status| match status.code() {
            Code::FailedPrecondition | Code::InvalidArgument => Broken::Refused(status),
            _ => Broken::Stream(status),
        };
        let mut inbox = client
            .work(ReceiverStream::new(messages))
            .await
            .map_err(refused)?
            .into_inner();
        match inbox.message().await?.and_then(|first| first.message) {
            Some(coordinator_message::Message::Welcome(welcome)) => {
                let interval = Duration::from_millis(welcome.heartbeat_interval_ms.max(10).into());
                Ok((outbox, inbox, interval))
            }
            _ => Err(Broken::Closed),
        }
    }

    /// Hands a lease to the threads; how many evaluations it holds.
    async fn take(&mut self, message: v1::Lease, outbox: &Outbox) -> Result<usize, Broken> {
        let id = message.id.unwrap_or_default();
        let cost = match &message.work {
            Some(v1::lease::Work::Evaluations(batch)) => batch.tasks.len(),
            Some(v1::lease::Work::Replay(_)) => 1,
            None => 0,
        };
        match Lease::try_from(message) {
            Ok(lease) => self.pool.take(lease),
            Err(invalid) => send(outbox, Outcome::fatal(invalid.to_string()).message(id)).await?,
        }
        Ok(cost)
    }

    /// Gives back what has not begun, finishes what has, and ends the stream.
    async fn drain(&mut self, outbox: &Outbox) -> Result<(), Broken> {
        send(outbox, worker_message::Message::Drain(v1::Drain {})).await?;
        self.pool.begin_nothing_more();
        while self.pool.outstanding() > 0 {
            tokio::select! {
                Some((id, outcome)) = self.pool.finished() => send(outbox, outcome.message(id)).await?,
                () = tokio::time::sleep(Duration::from_secs(1)) => {
                    send(outbox, worker_message::Message::Heartbeat(v1::Heartbeat {})).await?;
                }
            }
        }
        Ok(())
    }
}

async fn send(outbox: &Outbox, message: worker_message::Message) -> Result<(), Broken> {
    outbox
        .send(v1::WorkerMessage {
            message: Some(message),
        })
        .await
        .map_err(|_| Broken::Closed)
}

/// Pauses between attempts: exponential, with jitter so that many workers do not come back in step.
struct Backoff {
    next: Duration,
    jitter: RandomStream,
}

impl Backoff {
    fn new() -> Self {
        // Not an evaluation: here two processes should differ.
        let seed = u64::from(std::process::id());
        Self {
            next: FIRST_PAUSE,
            jitter: RandomStream::derive(seed, murmuration_proto::Purpose::Jitter, 1),
        }
    }

    fn reset(&mut self) {
        self.next = FIRST_PAUSE;
    }

    fn next(&mut self) -> Duration {
        let pause = self.next.mul_f64(self.jitter.between(0.5, 1.0));
        self.next = (self.next * 2).min(LAST_PAUSE);
        pause
    }
}
