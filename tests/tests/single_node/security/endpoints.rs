//! Tests the checks before every request: a page of another site can neither act nor read, but gRPC clients and probes are
//! admitted.

use crate::security::Secrets;
use murmuration_access::{
    ListenConfig,
    limits::{MAX_HEADER_BYTES, MAX_HEADERS},
};
use murmuration_proto::{
    parts::whole,
    v1::{self, campaign_service_client::CampaignServiceClient},
};
use murmuration_tests::{Cluster, small_spec};
use prost::Message;
use std::{net::SocketAddr, path::Path};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};
use tonic::{
    Code,
    transport::{Endpoint, Uri},
};

const LIST: &str = "/murmuration.v1.CampaignService/ListCampaigns";
const CREATE: &str = "/murmuration.v1.CampaignService/CreateCampaign";
const CANCEL: &str = "/murmuration.v1.CampaignService/CancelCampaign";

/// The coordinator's answer over HTTP/1.1.
#[derive(Debug)]
struct Answer {
    status: u16,
    /// Status line, headers and body.
    text: String,
}

/// Sends a request as a browser does on a plain connection: over HTTP/1.1, with exactly `headers` besides `Connection` and the
/// body's length.
async fn ask(at: SocketAddr, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
    let mut request = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\n");
    for (name, value) in headers {
        request += &format!("{name}: {value}\r\n");
    }
    request += &format!("Content-Length: {}\r\n\r\n", body.len());
    let mut stream = TcpStream::connect(at).await.unwrap();
    stream.write_all(request.as_bytes()).await.unwrap();
    // Sending fails if the coordinator refuses the request before it reads the body.
    let _ = stream.write_all(body).await;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    let text = String::from_utf8_lossy(&answer).into_owned();
    let status = text.split(' ').nth(1).and_then(|status| status.parse().ok());
    Answer {
        status: status.unwrap_or_else(|| panic!("no HTTP: {text:?}")),
        text,
    }
}

/// The bytes of a message in a gRPC frame.
fn framed(message: &impl Message) -> Vec<u8> {
    let mut frame = vec![0];
    frame.extend((message.encoded_len() as u32).to_be_bytes());
    frame.extend(message.encode_to_vec());
    frame
}

fn create() -> v1::CreateCampaignRequest {
    v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(
            (&small_spec("")).into(),
        )),
        ..v1::CreateCampaignRequest::default()
    }
}

fn address(cluster: &Cluster) -> SocketAddr {
    cluster.url().split("://").nth(1).unwrap().parse().unwrap()
}

/// Whether the answer is gRPC's status for a denied request.
fn is_denied(answer: &Answer) -> bool {
    answer.status == 200 && answer.text.to_lowercase().contains("\r\ngrpc-status: 7\r\n")
}

/// A coordinator with `--insecure-listen`, open to everyone who can reach it.
async fn trusting(data: &Path) -> Cluster {
    let listen = ListenConfig::trusting(([0, 0, 0, 0], 0).into(), None, None);
    Cluster::start_at(data, 0, listen).await
}

#[tokio::test(flavor = "multi_thread")]
async fn another_sites_page_starts_and_ends_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let kept = cluster.create(&small_spec("")).await;
    let at = address(&cluster);
    let own = at.to_string();
    let cancel = v1::CancelCampaignRequest {
        campaign: kept.clone(),
    };
    for (path, body) in [(CREATE, framed(&create())), (CANCEL, framed(&cancel))] {
        for origin in ["https://evil.example", "null", "http://127.0.0.1:1"] {
            // A page can send the first request without a preflight; the second request would need permission.
            let simple = [
                ("Host", own.as_str()),
                ("Origin", origin),
                ("Content-Type", "text/plain"),
            ];
            let answer = ask(at, "POST", path, &simple, &body).await;
            assert_eq!(answer.status, 403, "{answer:?}");
            let grpc = [simple[0], simple[1], ("Content-Type", "application/grpc")];
            let answer = ask(at, "POST", path, &grpc, &body).await;
            assert!(is_denied(&answer), "{answer:?}");
        }
        // Even the coordinator's own pages do not use gRPC.
        let ours = format!("http://{own}");
        let answer = ask(
            at,
            "POST",
            path,
            &[
                ("Host", &own),
                ("Origin", &ours),
                ("Content-Type", "application/grpc"),
            ],
            &body,
        )
        .await;
        assert!(is_denied(&answer), "{answer:?}");
        for kind in [
            "text/plain",
            "application/x-www-form-urlencoded",
            "application/grpc-web",
            "application/grpc-web+proto",
            "application/grpc+json",
            "",
        ] {
            let answer = ask(at, "POST", path, &[("Host", &own), ("Content-Type", kind)], &body).await;
            assert_eq!(answer.status, 415, "{kind:?} {answer:?}");
        }
        let untyped = ask(at, "POST", path, &[("Host", &own)], &body).await;
        assert_eq!(untyped.status, 415, "{untyped:?}");
        // The coordinator refuses the preflight too.
        let preflight = [
            ("Host", own.as_str()),
            ("Origin", "https://evil.example"),
            ("Access-Control-Request-Method", "POST"),
            ("Access-Control-Request-Headers", "content-type"),
        ];
        let answer = ask(at, "OPTIONS", path, &preflight, b"").await;
        assert_eq!(answer.status, 403, "{answer:?}");
        assert!(!answer.text.to_lowercase().contains("access-control-allow"));
    }
    let campaigns = cluster.campaigns().await;
    assert_eq!(campaigns.len(), 1, "{campaigns:?}");
    assert_eq!(campaigns[0].state(), v1::CampaignState::Running, "{campaigns:?}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_was_made_to_point_here_reads_nothing() {
    let (alone, open) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let clusters = [Cluster::start(alone.path(), 0).await, trusting(open.path()).await];
    for mut cluster in clusters {
        cluster.create(&small_spec("")).await;
        let at = SocketAddr::from(([127, 0, 0, 1], address(&cluster).port()));
        let own = at.to_string();
        let foreign = format!("evil.example:{}", at.port());
        let origin = format!("http://{foreign}");
        let body = framed(&v1::ListCampaignsRequest {});
        // The foreign name is the page's own host, so a browser sends it in both `Host` and `Origin`.
        let rebound = [
            ("Host", foreign.as_str()),
            ("Origin", &origin),
            ("Content-Type", "application/grpc"),
        ];
        let answer = ask(at, "POST", LIST, &rebound, &body).await;
        assert!(
            is_denied(&answer) && !answer.text.contains("small-1"),
            "{answer:?}"
        );
        for path in [
            "/metrics",
            "/healthz",
            "/readyz",
            "/",
            "/campaigns/small-1",
            "/assets/style.css",
        ] {
            let hosts: [&[(&str, &str)]; 4] = [
                &[("Host", &foreign)],
                // One of the two hosts is foreign, so the request must be refused whichever host counts.
                &[("Host", &own), ("Host", &foreign)],
                &[("Host", "")],
                &[],
            ];
            for headers in hosts {
                let answer = ask(at, "GET", path, headers, b"").await;
                // Without a host, HTTP itself may refuse the request.
                assert!(
                    [403, 400].contains(&answer.status),
                    "{path} {headers:?}: {answer:?}"
                );
                assert!(!answer.text.contains("small-1"), "{answer:?}");
            }
            let absolute = format!("http://{foreign}{path}");
            let answer = ask(at, "GET", &absolute, &[("Host", &own)], b"").await;
            assert_eq!(answer.status, 403, "{answer:?}");
            let elsewhere = [("Host", own.as_str()), ("Origin", "https://evil.example")];
            let answer = ask(at, "GET", path, &elsewhere, b"").await;
            assert_eq!(answer.status, 403, "{answer:?}");
        }
        cluster.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn who_looks_at_probes_comes_by_address() {
    let (alone, open) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let alone = Cluster::start(alone.path(), 0).await;
    let open = trusting(open.path()).await;
    for cluster in [&alone, &open] {
        let at = SocketAddr::from(([127, 0, 0, 1], address(cluster).port()));
        for host in ["127.0.0.1", "localhost", "LOCALHOST", "[::1]", "10.42.0.7"] {
            let host = format!("{host}:{}", at.port());
            for path in ["/healthz", "/readyz", "/metrics", "/"] {
                let answer = ask(at, "GET", path, &[("Host", &host)], b"").await;
                assert_eq!(answer.status, 200, "{host}{path}: {answer:?}");
            }
        }
    }
    // Containers use host names like `coordinator`. No Internet site has a name without a dot.
    let at = SocketAddr::from(([127, 0, 0, 1], address(&open).port()));
    let answer = ask(at, "GET", "/metrics", &[("Host", "coordinator:7700")], b"").await;
    assert_eq!(answer.status, 200, "{answer:?}");
    let at = address(&alone);
    let answer = ask(at, "GET", "/metrics", &[("Host", "coordinator:7700")], b"").await;
    assert_eq!(answer.status, 403, "{answer:?}");
    alone.stop().await;
    open.stop().await;
}

/// Lists campaigns as a gRPC client that reaches the coordinator under this name; returns their number.
async fn list_under(endpoint: Endpoint, name: &str) -> Result<usize, tonic::Status> {
    let origin: Uri = format!("{}://{name}", endpoint.uri().scheme_str().unwrap())
        .parse()
        .unwrap();
    let channel = endpoint.origin(origin).connect().await.unwrap();
    let listed = CampaignServiceClient::new(channel)
        .list_campaigns(v1::ListCampaignsRequest {})
        .await?;
    Ok(whole(listed.into_inner()).await?.campaigns.len())
}

#[tokio::test(flavor = "multi_thread")]
async fn programs_come_under_the_names_that_their_network_gives() {
    const NAMES: [&str; 3] = [
        "coordinator:7700",
        "coordinator.murmuration.svc.cluster.local:7700",
        "swarm.example",
    ];
    let folder = tempfile::tempdir().unwrap();
    let cluster = trusting(folder.path()).await;
    for name in NAMES {
        let endpoint = Endpoint::from_shared(cluster.url()).unwrap();
        assert_eq!(list_under(endpoint, name).await.unwrap(), 0, "{name}");
    }
    cluster.stop().await;

    let secrets = Secrets::new();
    let cluster = secrets.cluster(0).await;
    for name in NAMES {
        let credentials = secrets.credentials(None, None);
        let endpoint = credentials.endpoint(&cluster.url()).unwrap();
        // The coordinator accepts the name, but refuses the request because the token is missing.
        let refused = list_under(endpoint, name).await.unwrap_err();
        assert_eq!(refused.code(), Code::Unauthenticated, "{name}: {refused}");
    }
    cluster.stop().await;

    // A coordinator on a person's machine answers only under its own address, to programs too.
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let endpoint = || Endpoint::from_shared(cluster.url()).unwrap();
    for name in ["127.0.0.1:7700", "localhost:7700", "[::1]:7700"] {
        assert_eq!(list_under(endpoint(), name).await.unwrap(), 0, "{name}");
    }
    for name in NAMES {
        let refused = list_under(endpoint(), name).await.unwrap_err();
        assert_eq!(refused.code(), Code::PermissionDenied, "{name}: {refused}");
        assert!(refused.message().contains("--tokens"), "{refused}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn grpc_is_known_by_its_type_with_or_without_its_encoding() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let at = address(&cluster);
    let body = framed(&v1::ListCampaignsRequest {});
    for kind in [
        "application/grpc",
        "application/grpc+proto",
        "Application/gRPC",
        "application/grpc; charset=utf-8",
    ] {
        let headers = [("Host", at.to_string()), ("Content-Type", kind.to_owned())];
        let headers = headers.each_ref().map(|(name, value)| (*name, value.as_str()));
        let answer = ask(at, "POST", LIST, &headers, &body).await;
        // gRPC reports an error in a header; over HTTP/1.1 a success has no such header.
        assert!(
            answer.status == 200 && !answer.text.contains("grpc-status"),
            "{kind}: {answer:?}"
        );
    }
    // The coordinator reports an unknown service as unknown, so that clients try another service.
    let host = at.to_string();
    let headers = [("Host", host.as_str()), ("Content-Type", "application/grpc")];
    let answer = ask(
        at,
        "POST",
        "/grpc.reflection.v1alpha.ServerReflection/Info",
        &headers,
        b"",
    )
    .await;
    assert!(answer.text.contains("grpc-status: 12"), "{answer:?}");
    cluster.stop().await;
}

const SAID_OF_HEADERS: &str =
    "a request may have at most 100 headers, and its headers and address together at most 16,384 bytes";

/// Sends a request with additional headers, over HTTP/2 if `is_2` is true and otherwise over HTTP/1.1. Returns status and body.
async fn with_headers(at: SocketAddr, is_2: bool, headers: &[(String, String)]) -> (u16, String) {
    if is_2 {
        let client = murmuration_tests::http::client().http2_prior_knowledge();
        let request = client.build().unwrap().get(format!("http://{at}/healthz"));
        let fill =
            |request: reqwest::RequestBuilder, (name, value): &(String, String)| request.header(name, value);
        let answer = headers.iter().fold(request, fill).send().await.unwrap();
        assert_eq!(answer.version(), reqwest::Version::HTTP_2);
        return (answer.status().as_u16(), answer.text().await.unwrap());
    }
    let host = at.to_string();
    let own = [("Host", host.as_str()), ("Accept", "*/*")];
    let further = headers
        .iter()
        .map(|(name, value)| (name.as_str(), value.as_str()));
    let all: Vec<(&str, &str)> = own.into_iter().chain(further).collect();
    let answer = ask(at, "GET", "/healthz", &all, b"").await;
    let (_, body) = answer.text.split_once("\r\n\r\n").unwrap();
    (answer.status, body.to_owned())
}

#[tokio::test(flavor = "multi_thread")]
async fn one_limit_of_headers_is_said_over_http_1_and_http_2() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let at = address(&cluster);
    for is_2 in [false, true] {
        // Every request has the headers Host and Accept; over HTTP/1.1, the test's client also sends Connection and
        // Content-Length.
        let (mut count, mut bytes) = (2, "/healthz".len() + "host".len() + at.to_string().len());
        bytes += "accept*/*".len() + 2 * 32;
        if !is_2 {
            (count, bytes) = (count + 2, bytes + "connectionclosecontent-length0".len() + 2 * 32);
        }
        let few = |count: usize| -> Vec<(String, String)> {
            (0..count).map(|n| (format!("x-{n}"), String::new())).collect()
        };
        let (status, _) = with_headers(at, is_2, &few(MAX_HEADERS - count)).await;
        assert_eq!(status, 200, "{is_2}");
        let (status, body) = with_headers(at, is_2, &few(MAX_HEADERS - count + 1)).await;
        assert_eq!(status, 431, "{is_2}");
        // Over HTTP/1.1, the library refuses too many headers itself, without a message.
        assert_eq!(body.contains(SAID_OF_HEADERS), is_2, "{body:?}");

        let left = MAX_HEADER_BYTES as usize - bytes - "filler".len() - 32;
        for (length, expected) in [(left, 200), (left + 1, 431), (left + 20_000, 431)] {
            let filler = ("filler".to_owned(), "a".repeat(length));
            let (status, body) = with_headers(at, is_2, &[filler]).await;
            assert_eq!(status, expected, "{is_2} {length}");
            assert!(status == 200 || body.contains(SAID_OF_HEADERS), "{is_2} {body:?}");
        }
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn headers_are_as_short_over_http_1_as_over_http_2() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let at = address(&cluster);
    let host = at.to_string();
    let most = MAX_HEADER_BYTES as usize;
    for (bytes, status) in [(most - 2048, 200), (most, 431), (10 * most, 431)] {
        let filler = "a".repeat(bytes);
        let answer = ask(
            at,
            "GET",
            "/healthz",
            &[("Host", &host), ("Filler", &filler)],
            b"",
        )
        .await;
        assert_eq!(answer.status, status, "{bytes}");
        assert!(
            status == 200 || answer.text.contains(SAID_OF_HEADERS),
            "{answer:?}"
        );
    }
    // The names of headers and the address count towards the limit, as values do.
    let many: Vec<(String, &str)> = (0..90)
        .map(|n| (format!("{}-{n}", "x".repeat(200)), ""))
        .collect();
    let many: Vec<(&str, &str)> = many.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let answer = ask(
        at,
        "GET",
        "/healthz",
        &[&[("Host", host.as_str())], &many[..]].concat(),
        b"",
    )
    .await;
    assert_eq!(answer.status, 431, "{answer:?}");
    let long = format!("/healthz?{}", "a".repeat(most));
    let answer = ask(at, "GET", &long, &[("Host", &host)], b"").await;
    assert_eq!(answer.status, 431, "{answer:?}");
    cluster.stop().await;
}
