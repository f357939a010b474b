//! What is at a limit is taken, what is over it is refused, and the connection goes on.

use crate::Desk;
use murmuration_coordinator::limits::{MAX_HEADER_BYTES, MAX_LABEL_MESSAGE, MAX_MESSAGE, MAX_POST};
use murmuration_proto::v1::{
    self, campaign_service_client::CampaignServiceClient, label_service_client::LabelServiceClient,
};
use murmuration_tests::Cluster;
use prost::Message;
use tonic::{Code, Request, metadata::MetadataValue};

/// `make` of a text as long as makes its message so many bytes.
fn of_size<M: Message>(size: usize, make: impl Fn(String) -> M) -> M {
    let around = make("a".repeat(size)).encoded_len() - size;
    let message = make("a".repeat(size - around));
    assert_eq!(message.encoded_len(), size);
    message
}

#[tokio::test(flavor = "multi_thread")]
async fn messages_and_headers() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let create = |name| v1::CreateCampaignRequest {
        spec: Some(v1::CampaignSpec {
            name: Some(name),
            ..Default::default()
        }),
    };
    let undo = |campaign| v1::UndoLabelRequest {
        campaign,
        ..Default::default()
    };
    let channel = cluster.channel().await;
    let mut campaigns = CampaignServiceClient::new(channel.clone());
    let mut labels = LabelServiceClient::new(channel);
    // What is taken in is refused for what it says.
    for (over, expected) in [(0, Code::InvalidArgument), (1, Code::OutOfRange)] {
        let message = of_size(MAX_MESSAGE + over, create);
        let refused = campaigns.create_campaign(message).await.unwrap_err();
        assert_eq!(refused.code(), expected, "{refused}");
        let message = of_size(MAX_LABEL_MESSAGE + over, undo);
        let refused = labels.undo_label(message).await.unwrap_err();
        assert_eq!(refused.code() == Code::OutOfRange, over == 1, "{refused}");
    }
    for (bytes, allowed) in [(MAX_HEADER_BYTES - 2048, true), (MAX_HEADER_BYTES, false)] {
        let mut request = Request::new(v1::ListCampaignsRequest {});
        let value = MetadataValue::try_from("a".repeat(bytes as usize)).unwrap();
        request.metadata_mut().insert("filler", value);
        assert_eq!(
            campaigns.list_campaigns(request).await.is_ok(),
            allowed,
            "{bytes}"
        );
    }
    let listed = campaigns
        .list_campaigns(v1::ListCampaignsRequest {})
        .await
        .unwrap();
    assert_eq!(listed.into_inner().campaigns, []);
    assert_eq!(
        cluster
            .client
            .list_campaigns(v1::ListCampaignsRequest {})
            .await
            .unwrap()
            .into_inner()
            .campaigns,
        []
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_pages_post() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let url = cluster.url();
    for (over, expected) in [(0, 400), (1, 413)] {
        let posted = reqwest::Client::new()
            .post(format!("{url}/campaigns/small-1/labels"))
            .header("origin", &url)
            .header("content-type", "application/json")
            .body("a".repeat(MAX_POST + over));
        assert_eq!(posted.send().await.unwrap().status(), expected);
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stranger_sends_nothing_large() {
    let desk = Desk::new();
    let cluster = desk.cluster(0).await;
    let credentials = desk.credentials(None, None);
    let channel = crate::people::channel(&cluster, &credentials).await;
    let undo = |campaign| v1::UndoLabelRequest {
        campaign,
        ..Default::default()
    };
    // Turned away for who it is, not for what it sends: nobody reads that.
    let message = of_size(MAX_LABEL_MESSAGE + 1, undo);
    let refused = LabelServiceClient::new(channel)
        .undo_label(message)
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::Unauthenticated, "{refused}");
    cluster.stop().await;
}
