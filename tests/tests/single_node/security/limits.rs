//! Tests limits: the coordinator accepts requests at a limit and refuses requests over it, and the connection continues.

use crate::security::Secrets;
use murmuration_access::limits::{
    MAX_HEADER_BYTES, MAX_LABEL_MESSAGE, MAX_MESSAGE, MAX_POST, MAX_READ_HEADER_BYTES,
    MAX_STREAMS_PER_CONNECTION,
};
use murmuration_proto::{
    parts::whole,
    v1::{self, campaign_service_client::CampaignServiceClient, label_service_client::LabelServiceClient},
};
use murmuration_tests::Cluster;
use prost::Message;
use std::collections::HashMap;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};
use tonic::{Code, Request, metadata::MetadataValue};

/// A message of `size` bytes, made by `make` from a text of the right length.
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
        campaign: Some(v1::create_campaign_request::Campaign::Spec(v1::CampaignSpec {
            name: Some(name),
            ..Default::default()
        })),
        ..v1::CreateCampaignRequest::default()
    };
    let undo = |campaign| v1::UndoLabelsRequest {
        campaign,
        ..Default::default()
    };
    let channel = cluster.channel().await;
    let mut campaigns = CampaignServiceClient::new(channel.clone());
    let mut labels = LabelServiceClient::new(channel);
    // The coordinator refuses a message within the limit only for its content.
    for (over, expected) in [(0, Code::InvalidArgument), (1, Code::OutOfRange)] {
        let message = of_size(MAX_MESSAGE + over, create);
        let refused = campaigns.create_campaign(message).await.unwrap_err();
        assert_eq!(refused.code(), expected, "{refused}");
        let message = of_size(MAX_LABEL_MESSAGE + over, undo);
        let refused = labels.undo_labels(message).await.unwrap_err();
        assert_eq!(refused.code() == Code::OutOfRange, over == 1, "{refused}");
    }
    for (bytes, allowed) in [(MAX_HEADER_BYTES - 2048, true), (MAX_HEADER_BYTES, false)] {
        let mut request = Request::new(v1::ListCampaignsRequest {});
        let value = MetadataValue::try_from("a".repeat(bytes as usize)).unwrap();
        request.metadata_mut().insert("filler", value);
        // A refusal can arrive as late as the first part of the list.
        let listed = match campaigns.list_campaigns(request).await {
            Ok(parts) => whole(parts.into_inner()).await,
            Err(refused) => Err(refused),
        };
        assert_eq!(listed.is_ok(), allowed, "{bytes}: {listed:?}");
        if let Err(refused) = listed {
            assert_eq!(refused.code(), Code::ResourceExhausted, "{refused}");
            assert!(refused.message().contains("16,384 bytes"), "{refused}");
        }
    }
    let listed = campaigns
        .list_campaigns(v1::ListCampaignsRequest {})
        .await
        .unwrap();
    assert_eq!(whole(listed.into_inner()).await.unwrap().campaigns, []);
    assert_eq!(cluster.campaigns().await, []);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_pages_post() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let url = cluster.url();
    for (over, expected) in [(0, 400), (1, 413)] {
        let posted = murmuration_tests::http::client()
            .build()
            .unwrap()
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
    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    let credentials = secrets.credentials(None, None);
    let channel = crate::security::people::channel(&cluster, &credentials).await;
    let undo = |campaign| v1::UndoLabelsRequest {
        campaign,
        ..Default::default()
    };
    // The coordinator refuses the caller for the missing token, and does not read the message, which is too large.
    let message = of_size(MAX_LABEL_MESSAGE + 1, undo);
    let refused = LabelServiceClient::new(channel)
        .undo_labels(message)
        .await
        .unwrap_err();
    assert_eq!(refused.code(), Code::Unauthenticated, "{refused}");
    cluster.stop().await;
}

/// A connection announces its limits of requests and of headers in HTTP/2's SETTINGS, which this test reads directly.
#[tokio::test(flavor = "multi_thread")]
async fn streams_and_headers_of_a_connection() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let address = cluster.url().replace("http://", "");
    let mut stream = TcpStream::connect(address).await.unwrap();
    let preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";
    stream.write_all(preface).await.unwrap();
    let mut head = [0; 9];
    stream.read_exact(&mut head).await.unwrap();
    assert_eq!(head[3], 4, "not a SETTINGS frame");
    let mut settings = HashMap::new();
    for _ in 0..usize::from(head[2]) / 6 {
        let (name, value) = (stream.read_u16().await.unwrap(), stream.read_u32().await.unwrap());
        settings.insert(name, value);
    }
    assert_eq!(
        settings.get(&3),
        Some(&MAX_STREAMS_PER_CONNECTION),
        "{settings:?}"
    );
    assert_eq!(settings.get(&6), Some(&MAX_READ_HEADER_BYTES), "{settings:?}");
    cluster.stop().await;
}
