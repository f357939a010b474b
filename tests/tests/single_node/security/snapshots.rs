//! Tests snapshots of trainings. Only a trainer can store a snapshot, only of a training that it leases, and only up to the
//! largest size that this training can have.

use murmuration_proto::{
    TRAINER_VERSION,
    v1::{
        self, coordinator_message::Message as Answer, trainer_service_client::TrainerServiceClient,
        training_part::Part, worker_message::Message,
    },
};
use murmuration_swarm::{CampaignSpec, CheckpointDigest};
use murmuration_tests::{Cluster, FakeWorker, Murmuration, small_latent_spec};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status, Streaming, transport::Channel};

/// A connection of a trainer that does not train.
struct Trainer {
    client: TrainerServiceClient<Channel>,
    outbox: mpsc::Sender<v1::WorkerMessage>,
    inbox: Streaming<v1::CoordinatorMessage>,
    epoch: u64,
}

impl Trainer {
    async fn connect(url: &str) -> Self {
        Self::connect_with(url, 1).await.unwrap()
    }

    async fn connect_with(url: &str, capacity: u32) -> Result<Self, Status> {
        let mut client = TrainerServiceClient::connect(url.to_owned()).await.unwrap();
        let (outbox, messages) = mpsc::channel(4);
        let hello = Message::Hello(v1::Hello {
            name: "trainer".to_owned(),
            capacity,
            trainer_version: TRAINER_VERSION.to_owned(),
            ..v1::Hello::default()
        });
        let message = Some(hello);
        outbox.send(v1::WorkerMessage { message }).await.unwrap();
        let mut inbox = client.train(ReceiverStream::new(messages)).await?.into_inner();
        let first = inbox.message().await.unwrap().unwrap().message;
        let Some(Answer::Welcome(welcome)) = first else {
            panic!("not a welcome: {first:?}")
        };
        Ok(Self {
            client,
            outbox,
            inbox,
            epoch: welcome.epoch,
        })
    }

    async fn send(&self, message: Message) {
        let message = Some(message);
        // Sending fails if the coordinator has ended the stream; the receiver gets the reason.
        let _ = self.outbox.send(v1::WorkerMessage { message }).await;
    }

    async fn put_aside(&self, lease: v1::LeaseId, bytes: usize, last: bool) {
        self.send(snapshot(lease, bytes, last)).await;
    }

    /// Leases the next training.
    async fn lease(&mut self) -> v1::LeaseId {
        self.send(Message::Credits(v1::Credits { evaluations: 1 })).await;
        let mut beat = tokio::time::interval(Duration::from_millis(50));
        loop {
            tokio::select! {
                message = self.inbox.message() => match message.unwrap().unwrap().message {
                    Some(Answer::Lease(lease)) => return lease.id.unwrap(),
                    other => panic!("not a lease: {other:?}"),
                },
                _ = beat.tick() => self.send(Message::Heartbeat(v1::Heartbeat {})).await,
            }
        }
    }

    /// The error with which the coordinator ends the stream.
    async fn dismissed(&mut self) -> Status {
        loop {
            if let Err(status) = self.inbox.message().await {
                return status;
            }
        }
    }

    /// Number of bytes of the snapshot that the coordinator stores for the training of a lease.
    async fn kept(&mut self, lease: v1::LeaseId) -> Result<usize, Status> {
        let request = v1::FetchTrainingRequest { lease: Some(lease) };
        let mut parts = self.client.fetch_training(request).await?.into_inner();
        let mut kept = 0;
        while let Some(part) = parts.message().await? {
            if let Some(Part::Saved(bytes)) = part.part {
                kept += bytes.len();
            }
        }
        Ok(kept)
    }
}

fn snapshot(lease: v1::LeaseId, bytes: usize, last: bool) -> Message {
    Message::Snapshot(v1::TrainingSnapshot {
        lease: Some(lease),
        epoch: 1,
        data: vec![7; bytes],
        last,
    })
}

/// Number of fetches on each of `CONNECTIONS` connections. Their product is larger than tokio's number of blocking threads.
const FETCHES: usize = 200;
const CONNECTIONS: usize = 3;

#[tokio::test(flavor = "multi_thread")]
async fn a_trainer_that_takes_no_pictures_keeps_no_threads() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    // The dataset has 10 MB of pictures, so that no buffer takes all of them.
    let spec = small_latent_spec("").to_toml();
    let spec = spec.replace("controllers = 100\n", "controllers = 4000\n");
    let spec = CampaignSpec::from_toml(&spec).unwrap();
    let campaign = cluster.create(&spec).await;
    let mut trainer = Trainer::connect(&cluster.url()).await;
    let lease = trainer.lease().await;
    let mut fetches = tokio::task::JoinSet::new();
    let mut clients = Vec::new();
    for _ in 0..CONNECTIONS {
        clients.push(TrainerServiceClient::connect(cluster.url()).await.unwrap());
    }
    for mut client in clients.iter().cycle().take(CONNECTIONS * FETCHES).cloned() {
        fetches.spawn(async move {
            let request = v1::FetchTrainingRequest { lease: Some(lease) };
            let parts = client.fetch_training(request).await;
            // The answer stays open for as long as the test lasts, and is never read.
            std::future::pending::<()>().await;
            drop(parts);
        });
    }
    for _ in 0..20 {
        trainer.send(Message::Heartbeat(v1::Heartbeat {})).await;
        let status = tokio::time::timeout(Duration::from_secs(10), cluster.status(&campaign));
        assert_eq!(status.await.unwrap().state(), v1::CampaignState::Running);
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    fetches.abort_all();
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trainer_trains_one_embedder_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_without_trainer(folder.path(), 0).await;
    for capacity in [0, 2, u32::MAX] {
        let Err(refused) = Trainer::connect_with(&cluster.url(), capacity).await else {
            panic!("a trainer of capacity {capacity} was let in")
        };
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused}");
        let expected = format!("hello.capacity = {capacity}: must be");
        assert!(refused.message().starts_with(&expected), "{refused}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trainer_that_names_what_it_never_published_is_quarantined_until_a_person_lifts_that() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    let campaign = cluster.create(&small_latent_spec("")).await;
    let mut trainer = Trainer::connect(&cluster.url()).await;
    let lease = trainer.lease().await;
    let never = CheckpointDigest::of(b"never published").to_string();
    let result = v1::BatchResult {
        lease: Some(lease),
        outcome: Some(v1::batch_result::Outcome::Checkpoint(never)),
        credits: 0,
    };
    trainer.send(Message::Result(result)).await;
    let dismissed = trainer.dismissed().await;
    assert!(dismissed.message().contains("unpublished"), "{dismissed}");
    assert_eq!(
        cluster.status(&campaign).await.state(),
        v1::CampaignState::Running
    );
    let is_listed = async {
        while Murmuration::over(folder.path())
            .run(&["quarantine"])
            .stdout
            .is_empty()
        {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(30), is_listed)
        .await
        .unwrap();
    cluster.stop().await;

    let cluster = Cluster::start_without_trainer(folder.path(), 0).await;
    let Err(refused) = Trainer::connect_with(&cluster.url(), 1).await else {
        panic!("a quarantined trainer was let in")
    };
    assert!(
        refused.message().contains("murmuration quarantine --lift"),
        "{refused}"
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trainer_that_names_a_checkpoint_of_another_training_is_quarantined_and_the_campaign_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    let imported = Murmuration::over(folder.path()).run(&["checkpoints", "import", model]);
    assert_eq!(imported.code, Some(0), "{}", imported.stderr);
    let other = imported.stdout.trim().to_owned();
    let campaign = cluster.create(&small_latent_spec("")).await;
    let mut trainer = Trainer::connect(&cluster.url()).await;
    let lease = trainer.lease().await;
    let result = v1::BatchResult {
        lease: Some(lease),
        outcome: Some(v1::batch_result::Outcome::Checkpoint(other)),
        credits: 0,
    };
    trainer.send(Message::Result(result)).await;
    let dismissed = trainer.dismissed().await;
    assert!(dismissed.message().contains("another training"), "{dismissed}");
    let status = cluster.status(&campaign).await;
    assert_eq!(status.state(), v1::CampaignState::Running);
    assert_eq!(status.checkpoint, "");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_snapshot_of_an_epoch_that_the_training_does_not_have_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    cluster.create(&small_latent_spec("")).await;
    for epoch in [0, 4, u64::MAX] {
        let mut trainer = Trainer::connect(&cluster.url()).await;
        let lease = trainer.lease().await;
        trainer
            .send(Message::Snapshot(v1::TrainingSnapshot {
                lease: Some(lease),
                epoch,
                data: Vec::new(),
                last: true,
            }))
            .await;
        let status = trainer.dismissed().await;
        let expected = format!("snapshot.epoch = {epoch}: must be from 1 to 3");
        assert!(status.message().starts_with(&expected), "{status}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_puts_no_training_aside() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let mut worker = FakeWorker::connect(&cluster.url()).await;
    let lease = v1::LeaseId { epoch: 1, number: 1 };
    worker.send(snapshot(lease, 1 << 20, false)).await;
    let status = worker.receive().await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    assert!(status.message().contains("only trainers"), "{status}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_that_was_not_leased_is_refused_at_its_first_part() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_without_trainer(folder.path(), 0).await;
    for other_epoch in [0, 1] {
        let mut trainer = Trainer::connect(&cluster.url()).await;
        let lease = v1::LeaseId {
            epoch: trainer.epoch - other_epoch,
            number: 1,
        };
        trainer.put_aside(lease, 1000, false).await;
        let status = trainer.dismissed().await;
        assert_eq!(status.code(), Code::InvalidArgument);
        assert!(status.message().starts_with("snapshot.lease = "), "{status}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_is_fetched_under_a_lease_that_the_trainer_holds_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    cluster.create(&small_latent_spec("")).await;
    let mut trainer = Trainer::connect(&cluster.url()).await;
    let lease = trainer.lease().await;
    assert_eq!(trainer.kept(lease).await.unwrap(), 0);
    let others = [
        v1::LeaseId {
            number: lease.number + 1,
            ..lease
        },
        v1::LeaseId {
            epoch: lease.epoch - 1,
            ..lease
        },
    ];
    for other in others {
        let refused = trainer.kept(other).await.unwrap_err();
        assert_eq!(refused.code(), Code::PermissionDenied, "{refused}");
    }
    // The coordinator also refuses a snapshot for a lease that the trainer returned.
    let failure = v1::Failure {
        class: v1::FailureClass::Retryable.into(),
        message: "not now".to_owned(),
    };
    let given_back = v1::BatchResult {
        lease: Some(lease),
        outcome: Some(v1::batch_result::Outcome::Failure(failure)),
        credits: 0,
    };
    trainer.send(Message::Result(given_back)).await;
    let denied = async {
        while trainer.kept(lease).await.is_ok() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(30), denied)
        .await
        .unwrap();
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_leased_training_is_kept_up_to_the_size_that_it_can_have() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    cluster.create(&small_latent_spec("")).await;
    let mut trainer = Trainer::connect(&cluster.url()).await;
    let lease = trainer.lease().await;
    trainer.put_aside(lease, 1000, false).await;
    trainer.put_aside(lease, 500, true).await;
    let kept = async {
        while trainer.kept(lease).await.unwrap() != 1500 {
            trainer.send(Message::Heartbeat(v1::Heartbeat {})).await;
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(60), kept).await.unwrap();
    // The network has some 25,000 weights, so two parts of this size exceed the largest possible snapshot.
    for _ in 0..2 {
        trainer.put_aside(lease, 1 << 20, false).await;
    }
    let status = trainer.dismissed().await;
    assert_eq!(status.code(), Code::InvalidArgument);
    assert!(
        status
            .message()
            .starts_with("snapshot.data = more: must be at most"),
        "{status}"
    );
    cluster.stop().await;
}
