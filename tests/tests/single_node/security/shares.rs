//! Tests fair shares: when one viewer floods the coordinator, other callers are still served, and a shutdown does not wait for
//! the flood.

use crate::security::Secrets;
use murmuration_access::CostClass;
use murmuration_link::Coordinator;
use murmuration_proto::{
    parts::whole,
    v1::{self, campaign_service_client::CampaignServiceClient},
};
use murmuration_tests::{Cluster, Murmuration, small_spec};
use std::{
    fs,
    time::{Duration, Instant},
};
use tokio::task::JoinSet;
use tonic::{Code, Status, Streaming, service::interceptor::InterceptedService, transport::Endpoint};

const SMALL_WINDOW: u32 = 1024;

/// A channel with a small window, in which streams that no one reads soon stop.
async fn channel(secrets: &Secrets, cluster: &Cluster, token: &str) -> Coordinator {
    let credentials = secrets.credentials(Some(token), None);
    let endpoint = credentials.endpoint(&cluster.url()).unwrap();
    let endpoint = endpoint.initial_stream_window_size(SMALL_WINDOW);
    InterceptedService::new(endpoint.connect().await.unwrap(), credentials.bearer())
}

fn archive(campaign: &str) -> v1::GetArchiveRequest {
    v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: true,
    }
}

fn watch(campaign: &str) -> v1::WatchCampaignRequest {
    v1::WatchCampaignRequest {
        campaign: campaign.to_owned(),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn archives_that_one_viewer_does_not_read_hold_a_share_and_no_more() {
    let secrets = Secrets::new();
    let mut cluster = secrets.cluster(1).await;
    cluster.run(&small_spec("")).await;
    let viewer = channel(&secrets, &cluster, &secrets.people.viewer).await;
    let mut asked = JoinSet::new();
    for _ in 0..100 {
        let mut client = CampaignServiceClient::new(viewer.clone());
        asked.spawn(async move { client.get_archive(archive("small-1")).await.unwrap() });
    }
    let share = CostClass::Reading.limits().share.get();
    let mut held = Vec::new();
    while held.len() < share {
        held.push(asked.join_next().await.unwrap().unwrap());
    }
    // Other callers are served while the viewer's further requests wait.
    let operator = channel(&secrets, &cluster, &secrets.people.operator).await;
    let mut operator = CampaignServiceClient::new(operator);
    for _ in 0..3 {
        let answer = operator.get_archive(archive("small-1")).await.unwrap();
        let whole = whole(answer.into_inner()).await.unwrap();
        assert_eq!(whole.individuals.len() as u64, small_spec("").evaluations());
    }
    let list = operator.list_campaigns(v1::ListCampaignsRequest {}).await;
    assert_eq!(
        whole(list.unwrap().into_inner()).await.unwrap().campaigns.len(),
        1
    );
    let further = asked.try_join_next();
    assert!(further.is_none(), "the viewer has more than a share: {further:?}");
    // The viewer's cheap requests are served too.
    let mut light = CampaignServiceClient::new(viewer);
    let one = v1::GetCampaignRequest {
        campaign: "small-1".to_owned(),
    };
    light.get_campaign(one).await.unwrap();
    // Reading one archive to its end makes room for the next.
    whole(held.pop().unwrap().into_inner()).await.unwrap();
    held.push(asked.join_next().await.unwrap().unwrap());
    asked.shutdown().await;
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn one_viewer_cannot_take_all_the_places_of_those_who_watch() {
    let secrets = Secrets::new();
    let mut cluster = secrets.cluster(0).await;
    let id = cluster.create(&small_spec("")).await;
    let viewer = channel(&secrets, &cluster, &secrets.people.viewer).await;
    let mut viewer = CampaignServiceClient::new(viewer);
    let share = CostClass::Streaming.limits().share.get();
    let mut watching: Vec<Streaming<v1::Campaign>> = Vec::new();
    for _ in 0..share {
        watching.push(viewer.watch_campaign(watch(&id)).await.unwrap().into_inner());
    }
    let refused: Status = viewer.watch_campaign(watch(&id)).await.unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted, "{refused}");
    assert!(refused.message().contains("from this token"), "{refused}");
    let operator = channel(&secrets, &cluster, &secrets.people.operator).await;
    let mut operator = CampaignServiceClient::new(operator);
    let mut theirs = operator.watch_campaign(watch(&id)).await.unwrap().into_inner();
    assert!(theirs.message().await.unwrap().is_some());
    let paused = operator.pause_campaign(v1::PauseCampaignRequest { campaign: id.clone() });
    paused.await.unwrap();
    watching.pop();
    let left = Instant::now();
    while viewer.watch_campaign(watch(&id)).await.is_err() {
        assert!(
            left.elapsed() < Duration::from_secs(10),
            "the place was not given back"
        );
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_shutdown_waits_for_nobody_who_reads_or_watches() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let spec = folder.path().join("small.toml");
    fs::write(&spec, small_spec("").to_toml()).unwrap();
    let spec = spec.display().to_string();
    assert_eq!(murmuration.run(&["run", &spec]).code, Some(0));
    let (serving, url) = murmuration.serve("127.0.0.1:0", &["--workers", "0"]);
    assert_eq!(murmuration.run(&["submit", &spec]).code, Some(0));
    let mut client = CampaignServiceClient::connect(url.clone()).await.unwrap();
    let mut watching = Vec::new();
    for _ in 0..20 {
        watching.push(
            client
                .watch_campaign(watch("small-2"))
                .await
                .unwrap()
                .into_inner(),
        );
    }
    let endpoint = Endpoint::from_shared(url).unwrap();
    let endpoint = endpoint.initial_stream_window_size(SMALL_WINDOW);
    let client = CampaignServiceClient::new(endpoint.connect().await.unwrap());
    let mut asked = JoinSet::new();
    for _ in 0..50 {
        let mut client = client.clone();
        asked.spawn(async move {
            let digest = v1::GetDigestRequest {
                campaign: "small-1".to_owned(),
            };
            let mut unread = client.get_archive(archive("small-1")).await?.into_inner();
            // The archive's first part has arrived, and the client does not read the rest.
            client.get_digest(digest).await?;
            tokio::time::sleep(Duration::from_secs(60)).await;
            unread.message().await.map(drop)
        });
    }
    tokio::time::sleep(Duration::from_millis(500)).await;
    let begun = Instant::now();
    let (code, text) = tokio::task::spawn_blocking(move || serving.terminate_and_hear())
        .await
        .unwrap();
    assert_eq!(code, Some(0), "{text}");
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    let mut last = watching.pop().unwrap();
    let ended = loop {
        match last.message().await {
            Ok(Some(_)) => {}
            other => break other,
        }
    };
    let status = ended.unwrap_err();
    assert_eq!(status.code(), Code::Unavailable, "{status}");
}
