//! Tests answers that are longer than a gRPC message: every client, with its library's default limit of 4 MiB, receives them
//! whole.

use murmuration_proto::{
    parts::whole,
    v1::{
        self, checkpoint_service_client::CheckpointServiceClient, label_service_client::LabelServiceClient,
    },
};
use murmuration_swarm::{CampaignSpec, Lineage};
use murmuration_tests::{Cluster, Murmuration, small_spec};
use prost::Message as _;
use std::{fs, path::Path};
use tonic::Code;

/// The default limit of a message in gRPC's libraries.
const LIMIT: usize = 4 << 20;

fn large_pictures() -> CampaignSpec {
    let text = small_spec("[image]\nresolution = 500\nwindow = 20").to_toml();
    let text = text
        .replace("generations = 5", "generations = 1")
        .replace("medoids = 4", "medoids = 20");
    CampaignSpec::from_toml(&text).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_report_of_large_pictures_can_be_had_by_any_client() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    cluster.run(&large_pictures()).await;
    let request = v1::GetTaxonomyRequest {
        campaign: "latest".to_owned(),
    };
    let taxonomy = cluster.client.get_taxonomy(request).await.unwrap();
    let taxonomy = whole(taxonomy.into_inner()).await.unwrap();
    assert!(taxonomy.encoded_len() > LIMIT);
    assert_eq!((taxonomy.medoids.len(), taxonomy.clusters.len()), (20, 20));
    let page = format!("{}/campaigns/small-1/report", cluster.url());
    let page = murmuration_tests::http::get(page).await.unwrap();
    assert_eq!(page.status(), 200);
    assert!(page.text().await.unwrap().contains("small-1"));
    let elsewhere = tempfile::tempdir().unwrap();
    let out = elsewhere.path().join("report").display().to_string();
    let arguments = ["report", "latest", "--coordinator", &cluster.url(), "--out", &out].map(str::to_owned);
    let reported = tokio::task::spawn_blocking(move || {
        let murmuration = Murmuration::over(Path::new("nowhere"));
        murmuration.run(&arguments.each_ref().map(String::as_str))
    });
    let reported = reported.await.unwrap();
    assert_eq!(reported.code, Some(0), "{}", reported.stderr);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_label_log_is_listed_whole() {
    const ANSWERS: usize = 12_000;
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    let answer = |number: usize| v1::Answer {
        index: number as u64 % 100,
        answer: "雪".repeat(64),
        time_ms: 1,
        annotator: format!("{}{number:05}", "雪".repeat(59)),
    };
    let mut labels = LabelServiceClient::connect(cluster.url()).await.unwrap();
    let request = v1::AppendLabelsRequest {
        campaign: "latest".to_owned(),
        request_id: "all".to_owned(),
        answers: (0..ANSWERS).map(answer).collect(),
    };
    let added = labels.append_labels(request).await.unwrap();
    let added = whole(added.into_inner()).await.unwrap();
    assert!(added.encoded_len() > LIMIT);
    assert_eq!(added.entries.len(), ANSWERS);
    let request = v1::ListLabelEntriesRequest {
        campaign: "latest".to_owned(),
    };
    let log = labels.list_label_entries(request).await.unwrap();
    assert_eq!(whole(log.into_inner()).await.unwrap().entries, added.entries);
    let request = v1::ListLabelsRequest {
        campaign: "latest".to_owned(),
    };
    let standing = whole(labels.list_labels(request).await.unwrap().into_inner())
        .await
        .unwrap();
    assert!(standing.encoded_len() > LIMIT);
    assert_eq!((standing.labels.len(), standing.digest.len()), (ANSWERS, 64));
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_list_of_checkpoints_is_listed_whole() {
    const CHECKPOINTS: usize = 70;
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let model = fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("models/small.onnx")).unwrap();
    let mut checkpoints = CheckpointServiceClient::connect(cluster.url()).await.unwrap();
    for number in 0..CHECKPOINTS {
        let lineage = Lineage {
            configuration: "# and so on\n".repeat(5461),
            ..Lineage::default()
        };
        // The same model with an additional unknown field, which changes the bytes.
        let model = [&model[..], &[0x9a, 0x06, 1, number as u8]].concat();
        let parts = lineage.publish_requests(&model);
        checkpoints
            .publish_checkpoint(tokio_stream::iter(parts))
            .await
            .unwrap();
    }
    let listed = checkpoints
        .list_checkpoints(v1::ListCheckpointsRequest {})
        .await
        .unwrap();
    let listed = whole(listed.into_inner()).await.unwrap();
    assert!(listed.encoded_len() > LIMIT);
    assert_eq!(listed.checkpoints.len(), CHECKPOINTS);
    let url = cluster.url();
    let printed = tokio::task::spawn_blocking(move || {
        Murmuration::over(Path::new("nowhere")).run(&["checkpoints", "list", "--coordinator", &url])
    });
    let printed = printed.await.unwrap();
    assert_eq!(printed.code, Some(0), "{}", printed.stderr);
    assert_eq!(printed.stdout.lines().count(), 1 + CHECKPOINTS);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_held_or_sent_is_refused_when_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let mut huge = v1::CampaignSpec::from(&small_spec(""));
    huge.world = Some(v1::World {
        width: Some(1000.0),
        height: Some(1000.0),
        ..v1::World::default()
    });
    huge.image = Some(v1::ImageFormat {
        resolution: Some(1000),
        ..v1::ImageFormat::default()
    });
    huge.search.as_mut().unwrap().population = Some(100_000);
    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(huge)),
        ..v1::CreateCampaignRequest::default()
    };
    let status = cluster.client.create_campaign(request).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let expected = "search.population = 100000: must be at most 4294 where image.resolution = 1000";
    assert!(status.message().starts_with(expected), "{status}");

    let mut crowd = v1::CampaignSpec::from(&small_spec(""));
    crowd.world = Some(v1::World {
        agents: Some(10_000),
        ..v1::World::default()
    });
    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(crowd)),
        ..v1::CreateCampaignRequest::default()
    };
    let crowd = cluster
        .client
        .create_campaign(request)
        .await
        .unwrap()
        .into_inner();
    let request = v1::GetReplayRequest {
        campaign: crowd.id,
        index: 0,
        stride: 1,
    };
    let status = cluster.client.get_replay(request).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let expected = "1201 frames of 10000 agents are 12010000 poses";
    assert!(status.message().contains(expected), "{status}");
    cluster.stop().await;
}
