//! More of everything than a coordinator has use for.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    processes::Cluster,
    soak::memory_mib,
    table::Row,
};
use murmuration_proto::v1::{self, campaign_service_client::CampaignServiceClient};
use std::net::TcpStream;

pub fn connections(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(60, 1000);
    let mut cluster = Cluster::start(2);
    let id = cluster.submit(&spec);
    cluster.wait_until(&id, |status| status.generations_done > 0);
    let before = memory_mib(cluster.coordinator().id());
    let watching = watch_unread(&cluster, &id);
    let mut silent = Vec::new();
    for _ in 0..scale.connections {
        // It may refuse what is too many.
        silent.extend(TcpStream::connect(cluster.address()).ok());
    }
    let opened = silent.len();
    assert!(
        opened > scale.connections / 2,
        "only {opened} connections were taken"
    );
    let digest = cluster.finish(&id);
    let grown = memory_mib(cluster.coordinator().id()) - before;
    assert!(grown < 400.0, "the coordinator grew by {grown} MiB");
    drop(silent);
    Row {
        done: format!("{opened} connections that say nothing, and {watching} watchers that never read"),
        found: format!(
            "the coordinator grew by {grown:.0} MiB; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

/// Opens streams that nobody reads; how many.
fn watch_unread(cluster: &Cluster, id: &str) -> usize {
    let (url, campaign) = (cluster.url(), id.to_owned());
    cluster.runtime().block_on(async move {
        let mut client = CampaignServiceClient::connect(url).await.unwrap();
        let mut streams = Vec::new();
        for _ in 0..20 {
            let request = v1::WatchCampaignRequest {
                campaign: campaign.clone(),
            };
            streams.push(client.watch_campaign(request).await.unwrap());
        }
        let count = streams.len();
        // For as long as the runtime lives.
        tokio::spawn(async move {
            std::future::pending::<()>().await;
            drop(streams);
        });
        count
    })
}
