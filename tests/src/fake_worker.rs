//! A worker that breaks the rules of the protocol.

use murmuration_link::{Coordinator, Credentials};
use murmuration_proto::{
    PROTOCOL_VERSION, SIMULATOR_VERSION,
    v1::{
        self, coordinator_message::Message as Answer, worker_message::Message,
        worker_service_client::WorkerServiceClient,
    },
};
use murmuration_swarm::Compressor;
use std::{
    net::Ipv4Addr,
    sync::atomic::{AtomicU16, Ordering},
    time::Duration,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming, service::interceptor::InterceptedService, transport::Endpoint};

/// A connection of a worker whose messages the test writes.
#[derive(Debug)]
pub struct FakeWorker {
    outbox: mpsc::Sender<v1::WorkerMessage>,
    inbox: Streaming<v1::CoordinatorMessage>,
}

impl FakeWorker {
    /// Connects from a machine of its own and sends `hello`, which need not be valid.
    ///
    /// # Errors
    /// The coordinator's refusal.
    pub async fn say_hello(url: &str, hello: Message) -> Result<Self, Status> {
        static MACHINES: AtomicU16 = AtomicU16::new(1);
        let [high, low] = MACHINES.fetch_add(1, Ordering::Relaxed).to_be_bytes();
        Self::say_hello_from(url, Ipv4Addr::new(127, 1, high, low), hello).await
    }

    async fn say_hello_from(url: &str, address: Ipv4Addr, hello: Message) -> Result<Self, Status> {
        // To Linux, every address of 127.0.0.0/8 is this machine; to the coordinator, each of these addresses is another machine.
        let endpoint = Endpoint::from_shared(url.to_owned()).unwrap();
        let channel = endpoint
            .local_address(Some(address.into()))
            .connect()
            .await
            .unwrap();
        let channel = InterceptedService::new(channel, Credentials::default().bearer());
        Self::say_hello_over(channel, hello).await
    }

    async fn say_hello_over(channel: Coordinator, hello: Message) -> Result<Self, Status> {
        let mut client = WorkerServiceClient::new(channel);
        let (outbox, messages) = mpsc::channel(64);
        outbox
            .send(v1::WorkerMessage { message: Some(hello) })
            .await
            .unwrap();
        let inbox = client.work(ReceiverStream::new(messages)).await?.into_inner();
        let mut worker = Self { outbox, inbox };
        match worker.receive().await? {
            Some(Answer::Welcome(_)) => Ok(worker),
            other => panic!("not a welcome: {other:?}"),
        }
    }

    /// Connects like an honest worker, from a machine of its own.
    pub async fn connect(url: &str) -> Self {
        Self::say_hello(url, Self::hello(SIMULATOR_VERSION))
            .await
            .unwrap()
    }

    /// Connects like an honest worker's process with the number `instance`, from the machine 127.0.0.`machine`.
    ///
    /// # Errors
    /// The coordinator's refusal.
    pub async fn connect_as(url: &str, machine: u8, instance: u64) -> Result<Self, Status> {
        Self::say_hello_from(url, Ipv4Addr::new(127, 0, 0, machine), hello_as(instance)).await
    }

    /// Connects like an honest worker's process over a connection that may have credentials.
    ///
    /// # Errors
    /// The coordinator's refusal.
    pub async fn connect_over(channel: Coordinator, instance: u64) -> Result<Self, Status> {
        Self::say_hello_over(channel, hello_as(instance)).await
    }

    /// The `Hello` message of a worker with this simulator version.
    #[must_use]
    pub fn hello(simulator_version: &str) -> Message {
        Message::Hello(v1::Hello {
            name: "impostor".to_owned(),
            simulator_version: simulator_version.to_owned(),
            capacity: 1,
            trainer_version: String::new(),
            instance: 0,
            // The fake worker claims that it can embed.
            embedding_kind: 1,
            protocol_version: PROTOCOL_VERSION,
        })
    }

    pub async fn send(&self, message: Message) {
        let message = v1::WorkerMessage {
            message: Some(message),
        };
        // Sending fails if the coordinator has ended the stream; the receiver gets the reason.
        let _ = self.outbox.send(message).await;
    }

    /// The next message, `None` at the end of the stream.
    ///
    /// # Errors
    /// The status that the coordinator ended the stream with.
    pub async fn receive(&mut self) -> Result<Option<Answer>, Status> {
        Ok(self.inbox.message().await?.and_then(|message| message.message))
    }

    /// Sends heartbeats and does no work until the coordinator ends the stream; returns the coordinator's error.
    pub async fn dismissed(mut self) -> Status {
        let mut beat = tokio::time::interval(Duration::from_millis(50));
        loop {
            tokio::select! {
                message = self.receive() => match message {
                    Ok(Some(_)) => {}
                    Ok(None) => panic!("it was dismissed without a word"),
                    Err(status) => return status,
                },
                _ = beat.tick() => self.send(Message::Heartbeat(v1::Heartbeat {})).await,
            }
        }
    }

    /// Requests one batch of at most `evaluations` evaluations, and waits for the batch.
    pub async fn lease(&mut self, evaluations: u32) -> (v1::LeaseId, v1::EvaluationBatch) {
        self.send(Message::Credits(v1::Credits { evaluations })).await;
        match self.receive().await.unwrap() {
            Some(Answer::Lease(v1::Lease {
                id: Some(id),
                work: Some(v1::lease::Work::Evaluations(batch)),
                ..
            })) => (id, batch),
            other => panic!("not a lease: {other:?}"),
        }
    }

    /// Answers every lease with `evaluation` until the coordinator ends the stream. Returns the number of evaluations and the
    /// coordinator's error.
    pub async fn answer_all(mut self, evaluation: &v1::Evaluation) -> (usize, Status) {
        let credits = |evaluations| Message::Credits(v1::Credits { evaluations });
        let mut answered = 0;
        self.send(credits(4)).await;
        loop {
            match self.receive().await {
                Ok(Some(Answer::Lease(v1::Lease {
                    id: Some(id),
                    work: Some(v1::lease::Work::Evaluations(batch)),
                    ..
                }))) => {
                    let tasks = batch.tasks.len();
                    self.answer(id, evaluation.clone(), tasks).await;
                    self.send(credits(tasks as u32)).await;
                    answered += tasks;
                }
                Ok(other) => panic!("not a lease: {other:?}"),
                Err(status) => return (answered, status),
            }
        }
    }

    /// Reports that the work of a lease failed.
    pub async fn fail(&self, lease: v1::LeaseId, class: v1::FailureClass, message: &str) {
        let failure = v1::Failure {
            class: class.into(),
            message: message.to_owned(),
        };
        self.send(Message::Result(v1::BatchResult {
            lease: Some(lease),
            outcome: Some(v1::batch_result::Outcome::Failure(failure)),
            credits: 0,
        }))
        .await;
    }

    /// Answers a lease with `evaluation` for each of `tasks` tasks.
    pub async fn answer(&self, lease: v1::LeaseId, evaluation: v1::Evaluation, tasks: usize) {
        self.answer_each(lease, vec![evaluation; tasks]).await;
    }

    /// Answers a lease with an evaluation for each of its tasks.
    pub async fn answer_each(&self, lease: v1::LeaseId, evaluations: Vec<v1::Evaluation>) {
        self.answer_with(lease, columns(&evaluations)).await;
    }

    /// Answers a lease with these columns.
    pub async fn answer_with(&self, lease: v1::LeaseId, evaluations: v1::Evaluations) {
        let outcome = Some(v1::batch_result::Outcome::Evaluations(evaluations));
        self.send(Message::Result(v1::BatchResult {
            lease: Some(lease),
            outcome,
            credits: 0,
        }))
        .await;
    }
}

/// The evaluations by column, however wrong they are.
fn columns(evaluations: &[v1::Evaluation]) -> v1::Evaluations {
    let mut compressor = Compressor::new().unwrap();
    let mut columns = v1::Evaluations::default();
    for evaluation in evaluations {
        let picture = compressor.compress(&evaluation.image).unwrap();
        columns.features.extend(&evaluation.features);
        columns.pictures.extend(picture.frame());
        columns.embeddings.extend(&evaluation.embedding);
        columns
            .verdicts
            .extend((evaluation.verdict != 0).then_some(evaluation.verdict));
    }
    columns
}

fn hello_as(instance: u64) -> Message {
    match FakeWorker::hello(SIMULATOR_VERSION) {
        Message::Hello(hello) => Message::Hello(v1::Hello { instance, ..hello }),
        other => other,
    }
}
