//! Overload: more connections, streams and bytes than a coordinator allows.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    soak::memory_mib,
    table::Row,
};
use murmuration_access::limits::{
    HANDSHAKE_LIMIT, MAX_CONNECTIONS_PER_PEER, MAX_LOCAL_CONNECTIONS, MAX_WORKER_MESSAGE, RESERVED_FILES,
};
use murmuration_proto::v1::{self, campaign_service_client::CampaignServiceClient, worker_message::Message};
use murmuration_tests::{FakeWorker, ProcessCluster};
use std::{
    io::{ErrorKind, Read as _, Write as _},
    net::{Ipv4Addr, SocketAddr, TcpStream},
    time::Instant,
};
use tokio::{net::TcpSocket, task::JoinSet};
use tonic::{Code, Status};

pub fn connections(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(scale, 300, 1000);
    // Without workers, the campaign cannot end before all connections are open.
    let mut cluster = ProcessCluster::start(0);
    let id = cluster.submit(&spec);
    let before = memory_mib(cluster.coordinator().id());
    let watching = watch_unread(&cluster, &id);
    let mut silent = Vec::new();
    for _ in 0..scale.connections {
        // The coordinator may refuse connections above its limit.
        silent.extend(TcpStream::connect(cluster.address()).ok());
    }
    let opened = silent.len();
    assert!(
        opened > scale.connections / 2,
        "only {opened} connections were taken"
    );
    cluster.add_worker();
    cluster.add_worker();
    cluster.wait_to_strike(&id, |status| status.generations_done > 0);
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

/// Opens streams that no one reads; returns the number of streams.
fn watch_unread(cluster: &ProcessCluster, id: &str) -> usize {
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
        // This task keeps the streams open until the runtime ends.
        tokio::spawn(async move {
            std::future::pending::<()>().await;
            drop(streams);
        });
        count
    })
}

/// Number of source addresses of the connections. All are addresses of this machine.
const PEERS: u8 = 3;

/// Number of connections that the coordinator has open files for. On a busy machine, many more connections would take longer to
/// open than a connection may be silent.
const MAX_CONNECTIONS: usize = 3_000;

/// Connections from each address: more than the limit for one address.
const PER_PEER: usize = MAX_CONNECTIONS_PER_PEER + 50;

const WANTED: usize = PER_PEER * PEERS as usize;

const _: () = assert!(WANTED > MAX_CONNECTIONS + 200);

/// The first bytes of an HTTP/2 connection.
const PREFACE: &[u8] = b"PRI * HTTP/2.0";

const _: () = assert!(PREFACE.len() >= PEERS as usize);

/// Number of open files that this process needs.
pub const FILES: u64 = WANTED as u64 + 500;

/// Exceeds the limits of connections in total and from one address, and of a message's size.
pub fn limits(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    rlimit::increase_nofile_limit(u64::MAX).unwrap();
    // Opening thousands of connections takes some seconds on a busy machine.
    let spec = campaign(scale, 600, 1000);
    let files = (MAX_CONNECTIONS + MAX_LOCAL_CONNECTIONS) as u64 + RESERVED_FILES;
    let mut cluster = ProcessCluster::start_with_open_files(files, 2);
    let id = cluster.submit(&spec);
    cluster.wait_to_strike(&id, |status| status.generations_done > 0);
    let kept = kept_open(&cluster);
    let url = cluster.url();
    let refused = cluster.runtime().block_on(too_large(&url));
    assert_eq!(refused.code(), Code::OutOfRange, "{refused}");
    cluster.check_running(&id);
    let digest = cluster.finish(&id);
    Row {
        done: format!(
            "{WANTED} connections from {PEERS} addresses, of which the coordinator allows {MAX_CONNECTIONS} with its open files, and a worker's message of {} MiB and some bytes",
            MAX_WORKER_MESSAGE >> 20
        ),
        found: format!(
            "{kept} stayed open, the others were closed at once; the message was refused; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

/// Opens `WANTED` connections; returns how many of them the coordinator keeps open.
fn kept_open(cluster: &ProcessCluster) -> usize {
    let mut open = Vec::new();
    for peer in 0..PEERS {
        let from = Ipv4Addr::new(127, 0, 0, 2 + peer);
        // One after the other would take longer on a busy machine than the coordinator allows the first ones to be silent.
        let to = cluster.address().parse().unwrap();
        let connections = async {
            (0..PER_PEER)
                .map(|_| connect(from, to))
                .collect::<JoinSet<_>>()
                .join_all()
                .await
        };
        open.extend(cluster.runtime().block_on(connections));
        // On a busy machine all connections together may take longer than a connection may be silent.
        for (place, stream) in open.iter_mut().enumerate() {
            let byte = usize::from(peer) - place / PER_PEER;
            // The coordinator has closed some of the connections.
            let _ = stream.write(&PREFACE[byte..=byte]);
        }
    }
    let begun = Instant::now();
    // The workers and this test's client occupy some of the connections.
    while open.len() > MAX_CONNECTIONS && begun.elapsed() < HANDSHAKE_LIMIT / 2 {
        open.retain_mut(is_open);
    }
    let kept = open.len();
    assert!(
        (MAX_CONNECTIONS - 16..=MAX_CONNECTIONS).contains(&kept),
        "{kept} connections are open"
    );
    kept
}

async fn connect(from: Ipv4Addr, to: SocketAddr) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((from, 0).into()).unwrap();
    let stream = socket.connect(to).await.unwrap();
    stream.into_std().unwrap()
}

/// Whether the other end has kept the connection open.
fn is_open(stream: &mut TcpStream) -> bool {
    let silent = |error: std::io::Error| error.kind() == ErrorKind::WouldBlock;
    stream.read(&mut [0]).is_err_and(silent)
}

/// The coordinator's error for a worker's message above the limit.
async fn too_large(url: &str) -> Status {
    let hello = v1::Hello {
        name: "a".repeat(MAX_WORKER_MESSAGE),
        ..v1::Hello::default()
    };
    FakeWorker::say_hello(url, Message::Hello(hello))
        .await
        .unwrap_err()
}
