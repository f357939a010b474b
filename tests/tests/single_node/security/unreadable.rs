//! Messages that cannot be decoded: the sender gets an error.

use murmuration_proto::{
    SIMULATOR_VERSION,
    v1::{self, worker_message::Message as Said},
};
use murmuration_tests::{Cluster, FakeWorker};
use prost::Message;
use tokio_stream::StreamExt as _;
use tonic::{Code, Request, Status, codegen::http::uri::PathAndQuery};

/// The final answer of a method whose client sends these messages and then nothing more.
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
    // A number where the method has a text, and the worker's stream a message.
    for method in [
        "/murmuration.v1.CampaignService/GetCampaign",
        "/murmuration.v1.CheckpointService/PublishCheckpoint",
        "/murmuration.v1.WorkerService/Work",
        "/murmuration.v1.TrainerService/Train",
    ] {
        check(sent(&cluster, method, vec![v1::Credits { evaluations: 1 }]).await);
    }
    // After a Hello that can be read: what travels as a text of some other message is the same bytes.
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
