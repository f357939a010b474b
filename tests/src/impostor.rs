//! A worker that does not keep to the rules.

use murmuration_proto::{
    SIMULATOR_VERSION,
    v1::{
        self, coordinator_message::Message as Answer, worker_message::Message,
        worker_service_client::WorkerServiceClient,
    },
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

/// A hand-made worker connection.
#[derive(Debug)]
pub struct Impostor {
    outbox: mpsc::Sender<v1::WorkerMessage>,
    inbox: Streaming<v1::CoordinatorMessage>,
}

impl Impostor {
    /// Connects and says `hello`, whatever that is.
    ///
    /// # Errors
    /// What the coordinator answers, if it refuses.
    pub async fn say_hello(url: &str, hello: Message) -> Result<Self, Status> {
        let mut client = WorkerServiceClient::connect(url.to_owned()).await.unwrap();
        let (outbox, messages) = mpsc::channel(64);
        outbox
            .send(v1::WorkerMessage { message: Some(hello) })
            .await
            .unwrap();
        let inbox = client.work(ReceiverStream::new(messages)).await?.into_inner();
        let mut impostor = Self { outbox, inbox };
        match impostor.receive().await? {
            Some(Answer::Welcome(_)) => Ok(impostor),
            other => panic!("not a welcome: {other:?}"),
        }
    }

    /// Connects like an honest worker.
    pub async fn connect(url: &str) -> Self {
        Self::say_hello(url, Self::hello(SIMULATOR_VERSION))
            .await
            .unwrap()
    }

    /// The Hello of a worker with this simulator version.
    #[must_use]
    pub fn hello(simulator_version: &str) -> Message {
        Message::Hello(v1::Hello {
            name: "impostor".to_owned(),
            simulator_version: simulator_version.to_owned(),
            capacity: 1,
            trainer_version: String::new(),
        })
    }

    /// Sends a message.
    pub async fn send(&self, message: Message) {
        self.outbox
            .send(v1::WorkerMessage {
                message: Some(message),
            })
            .await
            .unwrap();
    }

    /// The next message, `None` at the end of the stream.
    ///
    /// # Errors
    /// The status that the coordinator ended the stream with.
    pub async fn receive(&mut self) -> Result<Option<Answer>, Status> {
        Ok(self.inbox.message().await?.and_then(|message| message.message))
    }

    /// Asks for one batch of `evaluations` and waits for it.
    pub async fn lease(&mut self, evaluations: u32) -> (v1::LeaseId, v1::EvaluationBatch) {
        self.send(Message::Credits(v1::Credits { evaluations })).await;
        match self.receive().await.unwrap() {
            Some(Answer::Lease(v1::Lease {
                id: Some(id),
                work: Some(v1::lease::Work::Evaluations(batch)),
            })) => (id, batch),
            other => panic!("not a lease: {other:?}"),
        }
    }

    /// Answers a lease with `evaluation` for each of `tasks` tasks.
    pub async fn answer(&self, lease: v1::LeaseId, evaluation: v1::Evaluation, tasks: usize) {
        let evaluations = v1::Evaluations {
            evaluations: vec![evaluation; tasks],
        };
        let outcome = Some(v1::batch_result::Outcome::Evaluations(evaluations));
        self.send(Message::Result(v1::BatchResult {
            lease: Some(lease),
            outcome,
        }))
        .await;
    }
}
