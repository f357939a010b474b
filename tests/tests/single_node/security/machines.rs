//! Tests the certificates of workers and trainers.

use crate::security::{Secrets, people::channel};
use murmuration_embed::Device;
use murmuration_link::{Credentials, Health, Target};
use murmuration_proto::v1::{
    self, checkpoint_service_client::CheckpointServiceClient, trainer_service_client::TrainerServiceClient,
};
use murmuration_swarm::Lineage;
use murmuration_tests::{Cluster, FakeWorker, small_spec};
use murmuration_worker::client as worker;
use std::{error::Error as _, num::NonZeroUsize};
use tokio::sync::watch;
use tonic::Code;

fn options(secrets: &Secrets, cluster: &Cluster, credentials: Credentials) -> worker::Options {
    worker::Options {
        coordinator: Target::Url {
            url: cluster.url(),
            credentials,
        },
        name: "tested".to_owned(),
        local_address: None,
        health: Health::new(),
        leaving: murmuration_link::Leaving::default(),
        threads: NonZeroUsize::MIN,
        cache: secrets.path("cache"),
        embed_on: Device::default(),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_with_a_certificate_works() {
    let secrets = Secrets::new();
    let mut cluster = secrets.cluster(0).await;
    let credentials = secrets.credentials(None, Some(&secrets.path("certs/worker")));
    let (stop, stopped) = watch::channel(false);
    let worker = tokio::spawn(worker::run(options(&secrets, &cluster, credentials), stopped));
    cluster.run(&small_spec("")).await;
    stop.send_replace(true);
    worker.await.unwrap().unwrap();
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_without_one_is_told_and_leaves() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    // A worker without a certificate is refused, even with an operator's token.
    for token in [None, Some(secrets.people.operator.as_str())] {
        let options = options(&secrets, &cluster, secrets.credentials(token, None));
        let (_stop, stopped) = watch::channel(false);
        let refused = worker::run(options, stopped).await.unwrap_err().to_string();
        assert!(refused.contains("--certificate"), "{refused}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_cannot_pose_as_a_trainer() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let worker = secrets.credentials(None, Some(&secrets.path("certs/worker")));
    let channel = channel(&cluster, &worker).await;
    let refused = TrainerServiceClient::new(channel.clone())
        .fetch_training(v1::FetchTrainingRequest::default())
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::PermissionDenied, "{refused}");
    assert!(refused.message().contains("not for a trainer"), "{refused}");
    let refused = CheckpointServiceClient::new(channel)
        .publish_checkpoint(tokio_stream::empty())
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::Unauthenticated, "{refused}");
    let trainer = secrets.credentials(None, Some(&secrets.path("certs/trainer")));
    let (_stop, stopped) = watch::channel(false);
    let refused = worker::run(options(&secrets, &cluster, trainer), stopped).await;
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("not for a worker"), "{refused}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_certificate_opens_no_connection() {
    let (secrets, foreign) = (Secrets::new(), Secrets::new());
    let cluster = secrets.cluster(0).await;
    let certificates = [
        // The first certificate is of another authority; the second is of our authority, but not for clients.
        foreign.path("certs/worker"),
        secrets.path("certs/server"),
    ];
    for certificate in certificates {
        let credentials = secrets.credentials(None, Some(&certificate));
        let endpoint = credentials.endpoint(&cluster.url()).unwrap();
        let mut client = TrainerServiceClient::new(endpoint.connect_lazy());
        let request = v1::FetchTrainingRequest::default();
        let status = client.fetch_training(request).await.unwrap_err();
        // The handshake failed: the request got no answer, not even a refusal.
        assert!(status.source().is_some(), "{status:?}");
    }
    // A client does not trust a coordinator of another authority either.
    let stranger = foreign.credentials(None, None).endpoint(&cluster.url()).unwrap();
    assert!(stranger.connect().await.is_err());
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trainer_publishes_only_what_it_leases() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let model = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx")).unwrap();
    let publish = async |credentials: &Credentials| {
        let channel = channel(&cluster, credentials).await;
        let parts = Lineage::default().publish_requests(&model);
        let mut client = CheckpointServiceClient::new(channel);
        client.publish_checkpoint(tokio_stream::iter(parts)).await
    };
    // Neither an unknown token nor a viewer's token makes a trainer an operator.
    let foreign = Secrets::new();
    for token in [
        None,
        Some(foreign.people.operator.as_str()),
        Some(secrets.people.viewer.as_str()),
    ] {
        let trainer = secrets.credentials(token, Some(&secrets.path("certs/trainer")));
        let refused = publish(&trainer).await.unwrap_err();
        assert_eq!(refused.code(), Code::PermissionDenied, "{refused}");
        assert!(refused.message().contains("does not hold the lease"), "{refused}");
    }
    // An operator can import a checkpoint that no trainer of this cluster has trained.
    let operator = secrets.credentials(Some(&secrets.people.operator), None);
    publish(&operator).await.unwrap();
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_machines_fetch_is_for_machines() {
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let trainer = secrets.credentials(None, Some(&secrets.path("certs/trainer")));
    let operator = secrets.credentials(Some(&secrets.people.operator), None);
    let nobody = secrets.credentials(None, None);
    let fetch = async |credentials: &Credentials| {
        let channel = channel(&cluster, credentials).await;
        let training = v1::FetchTrainingRequest {
            lease: Some(v1::LeaseId { epoch: 1, number: 1 }),
        };
        let checkpoint = v1::FetchCheckpointRequest {
            digest: "0".repeat(64),
        };
        let training = TrainerServiceClient::new(channel.clone())
            .fetch_training(training)
            .await;
        let checkpoint = CheckpointServiceClient::new(channel)
            .fetch_checkpoint(checkpoint)
            .await;
        (training.unwrap_err().code(), checkpoint.unwrap_err().code())
    };
    // For callers with permission, the error is that the lease is not theirs, or that the checkpoint does not exist.
    assert_eq!(fetch(&trainer).await, (Code::PermissionDenied, Code::NotFound));
    assert_eq!(fetch(&operator).await, (Code::PermissionDenied, Code::NotFound));
    assert_eq!(
        fetch(&nobody).await,
        (Code::PermissionDenied, Code::Unauthenticated)
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_certificate_is_a_machine() {
    let secrets = Secrets::new();
    let certs = secrets.text("certs");
    let made = ["certs", &certs, "--worker", "alpha", "--worker", "beta"];
    let made = secrets.murmuration().run(&made);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let mut cluster = secrets.cluster(0).await;
    cluster.create(&small_spec("")).await;
    let connect = async |name: &str, instance| {
        let shown = secrets.credentials(None, Some(&secrets.path(&format!("certs/{name}"))));
        FakeWorker::connect_over(channel(&cluster, &shown).await, instance).await
    };
    let mut liar = connect("alpha", 1).await.unwrap();
    let (lease, batch) = liar.lease(1).await;
    let impossible = v1::Evaluation::default();
    liar.answer(lease, impossible, batch.tasks.len()).await;
    assert_eq!(liar.dismissed().await.code(), Code::InvalidArgument);
    let again = connect("alpha", 2).await.unwrap_err();
    assert!(again.message().contains("quarantined"), "{again}");
    // A machine with another certificate can connect from the same address.
    connect("beta", 1).await.unwrap();
    cluster.stop().await;
}
