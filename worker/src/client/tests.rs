//! Tests of leases that name a checkpoint. The model `tests/models/small.onnx` takes pictures of 12 x 8 pixels. These tests need
//! ONNX Runtime (`make runtime`).

use super::{
    checkpoints::Checkpoints,
    executor::Executor,
    lease::{Lease, Outcome, Work},
};
use murmuration_embed::Device;
use murmuration_link::{Address, Role, Target};
use murmuration_proto::v1::{
    self,
    checkpoint_service_server::{CheckpointService, CheckpointServiceServer},
};
use murmuration_swarm::{CheckpointDigest, Controller, EmbeddingKind, ImageFormat, Preset, Starts, World};
use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{Code, Request, Response, Status, transport::Server};

const SMALL: &[u8] = include_bytes!("../../../tests/models/small.onnx");

/// A fake coordinator that returns the same bytes or error for every digest, and counts requests.
#[derive(Clone)]
struct Fake {
    answer: Result<Vec<u8>, Code>,
    asked: Arc<AtomicUsize>,
}

type Chunks = tokio_stream::Iter<std::vec::IntoIter<Result<v1::CheckpointChunk, Status>>>;

#[tonic::async_trait]
impl CheckpointService for Fake {
    type FetchCheckpointStream = Chunks;

    async fn fetch_checkpoint(
        &self,
        _: Request<v1::FetchCheckpointRequest>,
    ) -> Result<Response<Chunks>, Status> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let bytes = self
            .answer
            .as_ref()
            .map_err(|&code| Status::new(code, "as asked"))?;
        let chunks = bytes
            .chunks(100)
            .map(|data| Ok(v1::CheckpointChunk { data: data.to_vec() }));
        Ok(Response::new(tokio_stream::iter(chunks.collect::<Vec<_>>())))
    }

    type ListCheckpointsStream =
        tokio_stream::Iter<std::vec::IntoIter<Result<v1::ListCheckpointsResponse, Status>>>;

    async fn list_checkpoints(
        &self,
        _: Request<v1::ListCheckpointsRequest>,
    ) -> Result<Response<Self::ListCheckpointsStream>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn get_checkpoint(
        &self,
        _: Request<v1::GetCheckpointRequest>,
    ) -> Result<Response<v1::Checkpoint>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn publish_checkpoint(
        &self,
        _: Request<tonic::Streaming<v1::PublishCheckpointRequest>>,
    ) -> Result<Response<v1::Checkpoint>, Status> {
        Err(Status::unimplemented("not for workers"))
    }
}

/// The executors of a worker's threads, and the coordinator that they fetch from.
struct Worker {
    checkpoints: Arc<Checkpoints>,
    asked: Arc<AtomicUsize>,
    _folder: TempDir,
}

impl Worker {
    async fn start(answer: Result<&[u8], Code>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let cache = folder.path().join("checkpoints");
        Self::start_in(folder, &cache, answer).await
    }

    async fn start_in(folder: TempDir, cache: &Path, answer: Result<&[u8], Code>) -> Self {
        let fake = Fake {
            answer: answer.map(<[u8]>::to_vec),
            asked: Arc::default(),
        };
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let asked = fake.asked.clone();
        let server = Server::builder().add_service(CheckpointServiceServer::new(fake));
        tokio::spawn(server.serve_with_incoming(TcpListenerStream::new(listener)));
        let role = Role::Worker {
            capacity: 1,
            kind: EmbeddingKind::UNKNOWN,
        };
        let address = Address::new(Target::open(&url), role, "tested").unwrap();
        Self {
            checkpoints: Arc::new(Checkpoints::new(address.calls(), cache.to_owned(), Device::Cpu)),
            asked,
            _folder: folder,
        }
    }

    /// The outcome of `work` on a new thread.
    async fn outcome(&self, work: Work) -> Outcome {
        let mut executor = Executor::new(self.checkpoints.clone());
        let lease = Lease {
            id: v1::LeaseId::default(),
            campaign: "small-1".to_owned(),
            trace_parent: String::new(),
            work,
        };
        tokio::task::spawn_blocking(move || executor.outcome(lease))
            .await
            .unwrap()
    }

    fn asked(&self) -> usize {
        self.asked.load(Ordering::Relaxed)
    }
}

fn pictures(checkpoint: CheckpointDigest) -> Work {
    Work::Embeddings {
        starts: Starts::ONE,
        checkpoint,
        images: (0..40).map(|grey| vec![grey; 96]).collect(),
    }
}

#[track_caller]
fn check_failure(outcome: &Outcome, class: v1::FailureClass, expected: &str) {
    match outcome {
        Outcome::Failure { class: got, message } if *got == class && message.contains(expected) => {}
        other => panic!("not {class:?} with {expected:?}: {other:?}"),
    }
}

#[tokio::test]
async fn pictures_are_embedded_by_a_checkpoint_that_all_threads_fetch_once() {
    let worker = Worker::start(Ok(SMALL)).await;
    for _ in 0..2 {
        match worker.outcome(pictures(CheckpointDigest::of(SMALL))).await {
            Outcome::Embeddings(embeddings) => {
                assert_eq!(embeddings.len(), 40);
                assert!(embeddings.iter().all(|embedding| embedding.len() == 3));
                assert_ne!(embeddings[0], embeddings[39]);
            }
            other => panic!("not embeddings: {other:?}"),
        }
    }
    assert_eq!(worker.asked(), 1);
}

#[tokio::test]
async fn a_checkpoint_of_pictures_of_another_size_fails_for_good() {
    let worker = Worker::start(Ok(SMALL)).await;
    let world = World::try_from(v1::World {
        horizon: Some(10),
        ..v1::World::default()
    });
    let world = world.unwrap();
    let work = Work::Evaluations {
        starts: Starts::ONE,
        image: ImageFormat::default(),
        world,
        tasks: vec![(
            Controller::new(Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5]).unwrap(),
            1,
        )],
        checkpoint: Some(CheckpointDigest::of(SMALL)),
        judges: false,
    };
    let outcome = worker.outcome(work).await;
    check_failure(
        &outcome,
        v1::FailureClass::Fatal,
        "image 0 has 2500 pixels: this embedder takes 12 x 8",
    );
}

#[tokio::test]
async fn a_coordinator_that_is_away_may_come_back() {
    let worker = Worker::start(Err(Code::Unavailable)).await;
    let outcome = worker.outcome(pictures(CheckpointDigest::of(SMALL))).await;
    check_failure(
        &outcome,
        v1::FailureClass::Retryable,
        "cannot be fetched: as asked",
    );
    assert_eq!(worker.asked(), 3);
}

#[tokio::test]
async fn what_is_wrong_with_this_machine_may_be_right_with_another() {
    let retryable = v1::FailureClass::Retryable;
    for code in [Code::PermissionDenied, Code::Unauthenticated] {
        let worker = Worker::start(Err(code)).await;
        let outcome = worker.outcome(pictures(CheckpointDigest::of(SMALL))).await;
        check_failure(&outcome, retryable, "cannot be fetched: as asked");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a file");
    std::fs::write(&file, "").unwrap();
    let worker = Worker::start_in(folder, &file.join("cache"), Ok(SMALL)).await;
    let outcome = worker.outcome(pictures(CheckpointDigest::of(SMALL))).await;
    check_failure(&outcome, retryable, "checkpoint cache ");
}

#[tokio::test]
async fn what_is_no_checkpoint_fails_for_good() {
    let fatal = v1::FailureClass::Fatal;
    let worker = Worker::start(Err(Code::NotFound)).await;
    let outcome = worker.outcome(pictures(CheckpointDigest::of(SMALL))).await;
    check_failure(&outcome, fatal, "cannot be fetched: as asked");
    assert_eq!(worker.asked(), 1);

    let worker = Worker::start(Ok(b"no model")).await;
    let outcome = worker.outcome(pictures(CheckpointDigest::of(SMALL))).await;
    check_failure(&outcome, fatal, "received bytes with the digest");
    let outcome = worker.outcome(pictures(CheckpointDigest::of(b"no model"))).await;
    check_failure(&outcome, fatal, "not an ONNX model");
}
