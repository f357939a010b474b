//! A fake coordinator for trainers. Tests control every message.

use murmuration_link::{Health, Target};
use murmuration_proto::{
    PART_BYTES,
    v1::{
        self, batch_result::Outcome, checkpoint_service_server as checkpoints, coordinator_message,
        trainer_service_server as training, training_part::Part, worker_message::Message,
    },
};
use murmuration_swarm::CheckpointDigest;
use murmuration_trainer::client::{self, Options, TrainerError};
use std::sync::{Arc, Mutex};
use tokio::{
    net::TcpListener,
    sync::{mpsc, watch},
    task::JoinHandle,
};
use tokio_stream::wrappers::{ReceiverStream, TcpListenerStream};
use tonic::{Request, Response, Status, Streaming, transport::Server};

/// The coordinator, and a trainer that connects to it.
pub struct Fake {
    sessions: mpsc::Receiver<Session>,
    state: Arc<State>,
    stop: watch::Sender<bool>,
    trainer: JoinHandle<Result<(), TrainerError>>,
}

/// The answers of the services, and the requests that they received.
#[derive(Default)]
struct State {
    refuses: bool,
    pictures: Vec<u8>,
    features: Vec<f64>,
    saved: Mutex<Vec<u8>>,
    published: Mutex<Vec<(v1::Checkpoint, Vec<u8>)>>,
}

/// One connection of the trainer. Dropping a `Session` cuts the connection.
pub struct Session {
    inbox: Streaming<v1::WorkerMessage>,
    outbox: mpsc::Sender<Result<v1::CoordinatorMessage, Status>>,
}

impl Fake {
    /// A coordinator with these pictures and the features of their behaviours.
    pub async fn start(pictures: Vec<u8>, features: Vec<f64>) -> Self {
        Self::with(State {
            pictures,
            features,
            ..State::default()
        })
        .await
    }

    /// A coordinator that refuses trainers.
    pub async fn refusing() -> Self {
        Self::with(State {
            refuses: true,
            ..State::default()
        })
        .await
    }

    async fn with(state: State) -> Self {
        let state = Arc::new(state);
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let coordinator = format!("http://{}", listener.local_addr().unwrap());
        let (accepted, sessions) = mpsc::channel(8);
        let api = Api {
            state: state.clone(),
            accepted,
        };
        let server = Server::builder()
            .add_service(training::TrainerServiceServer::new(api.clone()))
            .add_service(checkpoints::CheckpointServiceServer::new(api))
            .serve_with_incoming(TcpListenerStream::new(listener));
        tokio::spawn(server);
        let (stop, stopped) = watch::channel(false);
        let options = Options {
            coordinator: Target::open(&coordinator),
            name: "trainer".to_owned(),
            local_address: None,
            health: Health::new(),
            leaving: murmuration_link::Leaving::default(),
        };
        let trainer = tokio::spawn(client::run(options, stopped));
        Self {
            sessions,
            state,
            stop,
            trainer,
        }
    }

    /// Welcomes the trainer's next connection.
    pub async fn welcome(&mut self) -> Session {
        let session = self.sessions.recv().await.unwrap();
        let welcome = v1::Welcome {
            epoch: 1,
            heartbeat_interval_ms: 20,
            silence_limit_ms: 1000,
        };
        session.say(coordinator_message::Message::Welcome(welcome)).await;
        session
    }

    /// Sets the snapshot for the next lease.
    pub fn keep(&self, saved: Vec<u8>) {
        *self.state.saved.lock().unwrap() = saved;
    }

    /// The checkpoint published last.
    pub fn published(&self) -> (v1::Checkpoint, Vec<u8>) {
        self.state.published.lock().unwrap().last().unwrap().clone()
    }

    /// Whether no checkpoint was published.
    pub fn has_none(&self) -> bool {
        self.state.published.lock().unwrap().is_empty()
    }

    /// Asks the trainer to leave.
    pub fn stop(&self) {
        self.stop.send_replace(true);
    }

    /// The result of the trainer.
    pub async fn end(self) -> Result<(), TrainerError> {
        self.trainer.await.unwrap()
    }
}

impl Session {
    /// The next message that is not a heartbeat.
    pub async fn hear(&mut self) -> Message {
        loop {
            let message = self.inbox.message().await.unwrap().unwrap().message.unwrap();
            if !matches!(message, Message::Heartbeat(_)) {
                return message;
            }
        }
    }

    /// Waits for a credit, then leases `task` under this number.
    pub async fn lease(&mut self, number: u64, task: v1::TrainingTask) {
        assert_eq!(
            self.hear().await,
            Message::Credits(v1::Credits { evaluations: 1 })
        );
        self.lease_for_credit(number, task).await;
    }

    /// Leases `task`, for a credit received earlier.
    pub async fn lease_for_credit(&self, number: u64, task: v1::TrainingTask) {
        let lease = v1::Lease {
            id: Some(lease_id(number)),
            campaign: "campaign-1".to_owned(),
            trace_parent: String::new(),
            work: Some(v1::lease::Work::Training(task)),
        };
        self.say(coordinator_message::Message::Lease(lease)).await;
    }

    pub async fn withdraw(&self, number: u64) {
        let lease = Some(lease_id(number));
        self.say(coordinator_message::Message::Withdrawal(v1::Withdrawal { lease }))
            .await;
    }

    /// The next report of a lease, ignoring snapshots.
    pub async fn report(&mut self, number: u64) -> v1::TrainingProgress {
        loop {
            match self.hear().await {
                Message::Training(report) => {
                    assert_eq!(report.lease, Some(lease_id(number)));
                    return report.progress.unwrap();
                }
                Message::Snapshot(_) => {}
                other => panic!("not a report: {other:?}"),
            }
        }
    }

    /// The next complete snapshot of a lease and its epoch, ignoring reports.
    pub async fn snapshot(&mut self, number: u64) -> (u64, Vec<u8>) {
        let mut bytes = Vec::new();
        loop {
            match self.hear().await {
                Message::Snapshot(part) => {
                    assert_eq!(part.lease, Some(lease_id(number)));
                    bytes.extend(part.data);
                    if part.last {
                        return (part.epoch, bytes);
                    }
                }
                Message::Training(_) | Message::Drain(_) => {}
                other => panic!("not a snapshot: {other:?}"),
            }
        }
    }

    /// The outcome of a lease, and the number of reports and snapshots before it.
    pub async fn result(&mut self, number: u64) -> (Outcome, usize, usize) {
        let (mut reports, mut snapshots) = (0, 0);
        loop {
            match self.hear().await {
                Message::Training(_) => reports += 1,
                Message::Snapshot(_) => snapshots += 1,
                Message::Drain(_) => {}
                Message::Result(result) => {
                    assert_eq!(result.lease, Some(lease_id(number)));
                    return (result.outcome.unwrap(), reports, snapshots);
                }
                other => panic!("not a result: {other:?}"),
            }
        }
    }

    async fn say(&self, message: coordinator_message::Message) {
        let message = v1::CoordinatorMessage {
            message: Some(message),
        };
        self.outbox.send(Ok(message)).await.unwrap();
    }
}

const fn lease_id(number: u64) -> v1::LeaseId {
    v1::LeaseId { epoch: 1, number }
}

#[derive(Clone)]
struct Api {
    state: Arc<State>,
    accepted: mpsc::Sender<Session>,
}

type Parts<T> = tokio_stream::Iter<std::vec::IntoIter<Result<T, Status>>>;

#[tonic::async_trait]
impl training::TrainerService for Api {
    type TrainStream = ReceiverStream<Result<v1::CoordinatorMessage, Status>>;

    async fn train(
        &self,
        request: Request<Streaming<v1::WorkerMessage>>,
    ) -> Result<Response<Self::TrainStream>, Status> {
        let mut inbox = request.into_inner();
        let first = inbox.message().await?.unwrap().message;
        let Some(Message::Hello(hello)) = first else {
            panic!("not a Hello: {first:?}")
        };
        assert_eq!(hello.trainer_version, murmuration_proto::TRAINER_VERSION);
        assert_eq!((hello.name.as_str(), hello.capacity), ("trainer", 1));
        if self.state.refuses {
            return Err(Status::failed_precondition("run another version"));
        }
        let (outbox, messages) = mpsc::channel(8);
        assert!(self.accepted.send(Session { inbox, outbox }).await.is_ok());
        Ok(Response::new(ReceiverStream::new(messages)))
    }

    type FetchTrainingStream = Parts<v1::TrainingPart>;

    async fn fetch_training(
        &self,
        request: Request<v1::FetchTrainingRequest>,
    ) -> Result<Response<Self::FetchTrainingStream>, Status> {
        assert_eq!(request.into_inner().lease.unwrap().epoch, 1);
        let saved = self.state.saved.lock().unwrap();
        // Small parts, so that the pictures need several messages.
        let pictures = self
            .state
            .pictures
            .chunks(1000)
            .map(|part| Part::Pictures(part.to_vec()));
        let saved = saved.chunks(1000).map(|part| Part::Saved(part.to_vec()));
        let features = self.state.features.chunks(15).map(|part| {
            let features = part.to_vec();
            Part::Features(v1::FeaturesPart { features })
        });
        let parts: Vec<_> = pictures
            .chain(features)
            .chain(saved)
            .map(|part| Ok(v1::TrainingPart { part: Some(part) }))
            .collect();
        Ok(Response::new(tokio_stream::iter(parts)))
    }
}

#[tonic::async_trait]
impl checkpoints::CheckpointService for Api {
    async fn publish_checkpoint(
        &self,
        request: Request<Streaming<v1::PublishCheckpointRequest>>,
    ) -> Result<Response<v1::Checkpoint>, Status> {
        use v1::publish_checkpoint_request::Part;
        let mut parts = request.into_inner();
        let first = parts.message().await?.unwrap().part;
        let Some(Part::Description(description)) = first else {
            panic!("not a description: {first:?}")
        };
        let mut bytes = Vec::new();
        while let Some(message) = parts.message().await? {
            let Some(Part::Chunk(chunk)) = message.part else {
                panic!("a second description")
            };
            assert!(chunk.data.len() <= PART_BYTES);
            bytes.extend(chunk.data);
        }
        assert_eq!(description.digest, CheckpointDigest::of(&bytes).to_string());
        assert_eq!(description.size, bytes.len() as u64);
        let published = (description.clone(), bytes);
        self.state.published.lock().unwrap().push(published);
        Ok(Response::new(description))
    }

    type ListCheckpointsStream = Parts<v1::ListCheckpointsResponse>;

    async fn list_checkpoints(
        &self,
        _: Request<v1::ListCheckpointsRequest>,
    ) -> Result<Response<Self::ListCheckpointsStream>, Status> {
        Err(Status::unimplemented("not for trainers"))
    }

    async fn get_checkpoint(
        &self,
        _: Request<v1::GetCheckpointRequest>,
    ) -> Result<Response<v1::Checkpoint>, Status> {
        Err(Status::unimplemented("not for trainers"))
    }

    type FetchCheckpointStream = Parts<v1::CheckpointChunk>;

    async fn fetch_checkpoint(
        &self,
        _: Request<v1::FetchCheckpointRequest>,
    ) -> Result<Response<Self::FetchCheckpointStream>, Status> {
        Err(Status::unimplemented("not for trainers"))
    }
}
