//! One connection, from the Hello message to the end of the stream.

use crate::{Address, CredentialsError, Role, leaving::Activity, root_cause};
use murmuration_proto::v1::{
    self, coordinator_message, trainer_service_client::TrainerServiceClient, worker_message,
    worker_service_client::WorkerServiceClient,
};
use murmuration_swarm::Text;
use std::{error::Error as _, time::Duration};
use tokio::{
    sync::mpsc,
    time::{Interval, MissedTickBehavior, timeout},
};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status, Streaming, service::interceptor::InterceptedService};

/// Maximum number of bytes of a received message. Leases contain specifications and pictures.
const MAX_MESSAGE: usize = 64 << 20;
/// Maximum number of messages that wait to be sent.
const OUTBOX: usize = 64;
/// Time for the coordinator to read the last messages.
const LAST_WORDS: Duration = Duration::from_secs(5);

/// A connection on which the coordinator has sent its Welcome message.
#[derive(Debug)]
pub struct Link {
    outbox: mpsc::Sender<v1::WorkerMessage>,
    inbox: Streaming<v1::CoordinatorMessage>,
    heartbeat: Interval,
    activity: Activity,
}

/// Why a connection ended early.
#[derive(Debug, thiserror::Error)]
pub enum Broken {
    /// The access file of the coordinator, or a credential, cannot be used now.
    #[error(transparent)]
    Target(#[from] CredentialsError),
    /// The connection could not be made.
    #[error("no connection: {}", root_cause(.0))]
    Connect(#[from] tonic::transport::Error),
    #[error("{}", words(.0))]
    Stream(#[from] Status),
    /// The coordinator ended the connection.
    #[error("the coordinator closed the stream")]
    Closed,
    /// The coordinator refuses this peer permanently.
    #[error("{}", .0.message())]
    Refused(Status),
}

impl Link {
    /// Connects, sends a Hello message, and waits for the Welcome message.
    pub(crate) async fn connect(address: &Address) -> Result<Self, Broken> {
        let (endpoint, bearer) = address.find()?;
        address.direct_calls(&endpoint, bearer.clone());
        let channel = InterceptedService::new(endpoint.connect().await?, bearer);
        let (outbox, messages) = mpsc::channel(OUTBOX);
        let hello = worker_message::Message::Hello(address.role.hello(&address.name, address.instance));
        send(&outbox, hello).await?;
        let messages = ReceiverStream::new(messages);
        let answer = match address.role {
            Role::Worker { .. } => {
                let client = WorkerServiceClient::new(channel);
                client.max_decoding_message_size(MAX_MESSAGE).work(messages).await
            }
            Role::Trainer => TrainerServiceClient::new(channel).train(messages).await,
        };
        let refused = |status: Status| match status.code() {
            Code::FailedPrecondition
            | Code::InvalidArgument
            | Code::Unauthenticated
            | Code::PermissionDenied => Broken::Refused(status),
            _ => Broken::Stream(status),
        };
        let mut inbox = answer.map_err(refused)?.into_inner();
        match inbox
            .message()
            .await
            .map_err(refused)?
            .and_then(|first| first.message)
        {
            Some(coordinator_message::Message::Welcome(welcome)) => {
                let interval = Duration::from_millis(welcome.heartbeat_interval_ms.max(10).into());
                let mut heartbeat = tokio::time::interval(interval);
                heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
                Ok(Self {
                    outbox,
                    inbox,
                    heartbeat,
                    activity: address.leaving.activity.clone(),
                })
            }
            _ => Err(Broken::Closed),
        }
    }

    /// Waits for the next message, and meanwhile sends heartbeats. Dropping the future loses no message.
    ///
    /// # Errors
    /// Fails if the stream is broken or has ended.
    pub async fn receive(&mut self) -> Result<coordinator_message::Message, Broken> {
        loop {
            tokio::select! {
                message = self.inbox.message() => {
                    let message = message?.ok_or(Broken::Closed)?;
                    // Messages of unknown kinds, from later versions, are ignored.
                    if let Some(message) = message.message {
                        self.activity.received(&message);
                        return Ok(message);
                    }
                }
                _ = self.heartbeat.tick() => {
                    send(&self.outbox, worker_message::Message::Heartbeat(v1::Heartbeat {})).await?;
                }
            }
        }
    }

    /// Sends a message; waits while too many messages are queued.
    ///
    /// # Errors
    /// Fails if the stream has ended.
    pub async fn send(&self, message: worker_message::Message) -> Result<(), Broken> {
        self.activity.sent(&message);
        send(&self.outbox, message).await
    }

    /// Ends the stream once the coordinator has read all messages, or after five seconds.
    pub async fn close(self) {
        let Self {
            outbox, mut inbox, ..
        } = self;
        drop(outbox);
        let ended = async { while let Ok(Some(_)) = inbox.message().await {} };
        // The connection ends here even after a timeout.
        let _ = timeout(LAST_WORDS, ended).await;
    }
}

/// The coordinator's error, or the reason why the coordinator could not be reached, if known.
fn words(status: &Status) -> String {
    match status.source() {
        Some(source) => root_cause(source),
        None => Text::line(status.message()).into(),
    }
}

async fn send(
    outbox: &mpsc::Sender<v1::WorkerMessage>,
    message: worker_message::Message,
) -> Result<(), Broken> {
    let message = v1::WorkerMessage {
        message: Some(message),
    };
    outbox.send(message).await.map_err(|_| Broken::Closed)
}
