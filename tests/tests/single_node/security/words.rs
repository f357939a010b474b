//! Tests that names and texts from workers and clients cannot move a terminal's cursor, hide text, or be unbounded.

use murmuration_proto::v1::{self, label_service_client::LabelServiceClient, worker_message::Message};
use murmuration_tests::{Cluster, FakeWorker, small_spec};
use tonic::Code;

/// A text that must not reach a terminal.
const HOSTILE: &str = "broken\u{1b}]0;owned\u{7} \u{9b}2J\u{202e}txet";

fn failure(lease: v1::LeaseId, message: String) -> Message {
    Message::Result(v1::BatchResult {
        lease: Some(lease),
        outcome: Some(v1::batch_result::Outcome::Failure(v1::Failure {
            class: v1::FailureClass::Retryable as i32,
            message,
        })),
        credits: 0,
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_workers_words_are_cleaned_and_cut() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let campaign = cluster.create(&small_spec("")).await;
    let mut worker = FakeWorker::connect(&cluster.url()).await;
    let (lease, _) = worker.lease(5).await;
    let endless = format!("{HOSTILE} {}", "x".repeat(8 << 20));
    worker.send(failure(lease, endless)).await;
    let status = cluster
        .watch_until(&campaign, |status| status.waiting.starts_with("impostor"))
        .await;
    let expected = "impostor returned work, which will be tried again: broken]0;owned 2Jtxet xxx";
    assert!(
        status.waiting.starts_with(expected),
        "{:?}",
        &status.waiting[..100]
    );
    assert!(status.waiting.len() < 3000, "{} bytes", status.waiting.len());
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn names_that_cannot_be_seen_are_refused_by_field() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    for name in ["", "\u{200b}", "wor\u{202e}ker", "a\u{1b}[2J"] {
        let Message::Hello(hello) = FakeWorker::hello(murmuration_proto::SIMULATOR_VERSION) else {
            unreachable!()
        };
        let name = name.to_owned();
        let refused =
            FakeWorker::say_hello(&cluster.url(), Message::Hello(v1::Hello { name, ..hello })).await;
        let status = refused.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument);
        assert!(status.message().starts_with("hello.name = "), "{status}");
    }
    let campaign = cluster.create(&small_spec("")).await;
    cluster.finish(&campaign).await;
    let mut labels = LabelServiceClient::connect(cluster.url()).await.unwrap();
    for (class, annotator, expected) in [
        ("\u{200b}", "ana", "answers[0].class = "),
        ("gn\u{202e}ir", "ana", "answers[0].class = "),
        ("ring", "ana\u{2069}", "answers[0].annotator = "),
        ("ring", "\u{3164}", "answers[0].annotator = "),
    ] {
        let request = v1::AppendLabelsRequest {
            campaign: campaign.clone(),
            request_id: "one".to_owned(),
            answers: vec![v1::Answer {
                index: 0,
                answer: class.to_owned(),
                time_ms: 0,
                annotator: annotator.to_owned(),
            }],
        };
        let status = labels.append_labels(request).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument);
        assert!(status.message().starts_with(expected), "{status}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refusal_does_not_repeat_what_has_no_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let request = v1::GetCampaignRequest {
        campaign: format!("{HOSTILE}{}", "x".repeat(60_000)),
    };
    let status = cluster.client.get_campaign(request).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound, "{status}");
    assert!(status.message().len() < 3000 && !status.message().contains('\u{1b}'));
    cluster.stop().await;
}
