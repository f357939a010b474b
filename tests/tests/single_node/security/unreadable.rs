//! Tests messages that cannot be decoded: the sender gets an error.

use murmuration_proto::{
    SIMULATOR_VERSION,
    codec::MAX_PARTS,
    v1::{self, worker_message::Message as Said},
};
use murmuration_tests::{Cluster, FakeWorker, quick_dispatch};
use prost::Message;
use std::time::Duration;
use tokio_stream::StreamExt as _;
use tonic::{Code, Request, Status, codegen::http::uri::PathAndQuery};

/// The final answer of a method whose client sends only these messages.
async fn sent<M: Message + Default + 'static>(
    cluster: &Cluster,
    method: &'static str,
    messages: Vec<M>,
) -> Status {
    let mut client = tonic::client::Grpc::new(cluster.channel().await);
    client.ready().await.unwrap();
    let codec = tonic_prost::ProstCodec::<M, v1::CoordinatorMessage>::default();
    let messages = tokio_stream::iter(messages).chain(tokio_stream::pending());
    let answer = client
        .streaming(Request::new(messages), PathAndQuery::from_static(method), codec)
        .await;
    let mut inbox = match answer {
        Ok(answer) => answer.into_inner(),
        Err(status) => return status,
    };
    loop {
        match inbox.message().await {
            Ok(message) => assert!(message.is_some(), "no word"),
            Err(status) => return status,
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_message_that_cannot_be_read_is_its_senders_fault() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let check = |status: Status| {
        assert_eq!(status.code(), Code::InvalidArgument, "{status}");
        assert!(status.message().contains("decode"), "{status}");
    };
    // The message has a number in place of a text or, for the worker's stream, in place of a message.
    for method in [
        "/murmuration.v1.CampaignService/GetCampaign",
        "/murmuration.v1.CheckpointService/PublishCheckpoint",
        "/murmuration.v1.WorkerService/Work",
        "/murmuration.v1.TrainerService/Train",
    ] {
        check(sent(&cluster, method, vec![v1::Credits { evaluations: 1 }]).await);
    }
    // The unreadable message follows a readable Hello. A text field of another message has the same bytes as a Hello.
    let Said::Hello(hello) = FakeWorker::hello(SIMULATOR_VERSION) else {
        panic!("not a Hello")
    };
    let hello = v1::Hello {
        embedding_kind: 0,
        ..hello
    };
    let texts = [
        String::from_utf8(hello.encode_to_vec()).unwrap(),
        "\u{7f}".to_owned(),
    ];
    let messages = texts.map(|campaign| v1::GetCampaignRequest { campaign });
    check(sent(&cluster, "/murmuration.v1.WorkerService/Work", messages.into()).await);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_small_message_of_many_parts_is_refused_before_it_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    // A busy machine needs more than half a second to encode, send and count the parts.
    let options = murmuration_dispatch::Options {
        silence_limit: Duration::from_secs(20),
        ..quick_dispatch()
    };
    let cluster = Cluster::start_with(folder.path(), 0, options).await;
    let check = |status: Status| {
        assert_eq!(status.code(), Code::ResourceExhausted, "{status}");
        assert!(status.message().contains("it has over 262144 parts"), "{status}");
    };
    let embeddings = v1::Embeddings {
        embeddings: vec![v1::Embedding::default(); MAX_PARTS],
    };
    let result = v1::BatchResult {
        outcome: Some(v1::batch_result::Outcome::Embeddings(embeddings)),
        ..Default::default()
    };
    let messages = [FakeWorker::hello(SIMULATOR_VERSION), Said::Result(result)];
    let messages = messages.map(|message| v1::WorkerMessage {
        message: Some(message),
    });
    check(sent(&cluster, "/murmuration.v1.WorkerService/Work", messages.into()).await);
    let labels = v1::AppendLabelsRequest {
        answers: vec![v1::Answer::default(); MAX_PARTS + 1],
        ..Default::default()
    };
    check(
        sent(
            &cluster,
            "/murmuration.v1.LabelService/AppendLabels",
            vec![labels],
        )
        .await,
    );
    cluster.stop().await;
}
