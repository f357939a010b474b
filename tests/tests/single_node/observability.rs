//! Tests the health, metrics, request ids and traces of a coordinator.

use murmuration_proto::{REQUEST_ID, v1};
use murmuration_tests::{Cluster, Murmuration, small_latent_spec, small_spec, start_worker_with};
use opentelemetry_proto::tonic::{
    collector::trace::v1::{
        ExportTraceServiceRequest, ExportTraceServiceResponse,
        trace_service_server::{TraceService, TraceServiceServer},
    },
    trace::v1::ResourceSpans,
};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
    time::Duration,
};
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::transport::Server;

async fn get(url: &str, path: &str) -> reqwest::Response {
    murmuration_tests::http::get(format!("{url}{path}"))
        .await
        .unwrap()
}

async fn text(url: &str, path: &str) -> (u16, String) {
    let answer = get(url, path).await;
    (answer.status().as_u16(), answer.text().await.unwrap())
}

/// The metrics by name and labels, as written on the page.
async fn metrics(url: &str) -> BTreeMap<String, f64> {
    let client = murmuration_tests::http::client().build().unwrap();
    let request = client.get(format!("{url}/metrics"));
    let request = request.header("accept", "application/openmetrics-text; version=1.0.0");
    let answer = request.send().await.unwrap();
    assert_eq!(answer.status(), 200);
    let text = answer.text().await.unwrap();
    assert!(text.ends_with("# EOF\n"), "{text}");
    // Other clients get the older format.
    let (status, classic) = self::text(url, "/metrics").await;
    assert_eq!(status, 200, "{classic}");
    assert!(
        classic.contains("# TYPE murmuration_disagreements_total counter\n") && !classic.contains("# EOF"),
        "{classic}"
    );
    let samples = text.lines().filter(|line| !line.starts_with('#'));
    let sample = |line: &str| {
        let (name, value) = line.rsplit_once(' ').unwrap();
        (name.to_owned(), value.parse().unwrap())
    };
    samples.map(sample).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_say_what_a_campaign_came_to() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let before = metrics(&cluster.url()).await;
    for name in [
        "murmuration_tasks_done_total{work=\"evaluation\"}",
        "murmuration_leases_returned_total{peer=\"worker\"}",
        "murmuration_disagreements_total",
        "murmuration_campaigns{state=\"completed\"}",
    ] {
        assert_eq!(before[name], 0.0, "{name}");
    }
    cluster.run(&small_latent_spec("")).await;
    let after = metrics(&cluster.url()).await;
    // The evaluations are 200 pictures of the dataset and 100 individuals of the archive. Audited and late evaluations count
    // twice.
    let evaluations = after["murmuration_tasks_done_total{work=\"evaluation\"}"];
    let audits = after["murmuration_audits_total"];
    assert!(
        evaluations >= 300.0 + audits,
        "{evaluations} with {audits} audits"
    );
    for (name, value) in [
        ("murmuration_tasks_done_total{work=\"training\"}", 1.0),
        ("murmuration_generation_commit_seconds_count", 5.0),
        (
            "murmuration_lease_turnaround_seconds_count{work=\"training\"}",
            1.0,
        ),
        ("murmuration_archive_individuals", 100.0),
        ("murmuration_campaigns{state=\"completed\"}", 1.0),
        ("murmuration_tasks_pending{peer=\"worker\"}", 0.0),
        ("murmuration_leases{peer=\"worker\"}", 0.0),
        ("murmuration_connected{peer=\"worker\"}", 2.0),
        ("murmuration_connected{peer=\"trainer\"}", 1.0),
        ("murmuration_label_entries", 0.0),
    ] {
        assert_eq!(after.get(name), Some(&value), "{name}");
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_workers_a_campaign_waits_in_the_queue() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    cluster.create(&small_spec("")).await;
    loop {
        let now = metrics(&cluster.url()).await;
        if now["murmuration_tasks_pending{peer=\"worker\"}"] == 20.0 {
            assert_eq!(now["murmuration_campaigns{state=\"running\"}"], 1.0);
            assert_eq!(now["murmuration_campaign_generations{campaign=\"small-1\"}"], 5.0);
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_name_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let (_, text) = text(&cluster.url(), "/metrics").await;
    let explained = include_str!("../../../docs/operations.md");
    let types = text.lines().filter_map(|line| line.strip_prefix("# TYPE "));
    let mut names = 0;
    for (name, _) in types.map(|line| line.split_once(' ').unwrap()) {
        let name = format!("`{name}`");
        assert!(explained.contains(&name), "{name} is not in docs/operations.md");
        names += 1;
    }
    assert!(names > 10, "{text}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_coordinator_says_that_it_lives_and_is_ready() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    assert_eq!(
        text(&cluster.url(), "/healthz").await,
        (200, "alive\n".to_owned())
    );
    assert_eq!(text(&cluster.url(), "/readyz").await, (200, "ready\n".to_owned()));
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_goes_by_the_name_it_came_with_or_gets_one() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let made = get(&cluster.url(), "/healthz").await;
    assert!(!made.headers()[REQUEST_ID].is_empty());

    let mut request = tonic::Request::new(v1::ListCampaignsRequest {});
    request
        .metadata_mut()
        .insert(REQUEST_ID, "the-one-42".parse().unwrap());
    let answer = cluster.client.list_campaigns(request).await.unwrap();
    assert_eq!(answer.metadata().get(REQUEST_ID).unwrap(), "the-one-42");
    // The answer to a refused request has the request id too.
    let mut request = tonic::Request::new(v1::GetCampaignRequest {
        campaign: "none".to_owned(),
    });
    request
        .metadata_mut()
        .insert(REQUEST_ID, "the-one-43".parse().unwrap());
    let refused = cluster.client.get_campaign(request).await.unwrap_err();
    assert_eq!(refused.metadata().get(REQUEST_ID).unwrap(), "the-one-43");
    cluster.stop().await;
}

#[test]
fn the_health_command_asks_a_coordinator_and_a_worker() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(folder.path());
    let none = murmuration.run(&["health"]);
    assert_ne!(none.code, Some(0), "{}", none.stderr);

    let mut coordinator = murmuration.start(&["serve", "--workers", "0", "--listen", "127.0.0.1:0"]);
    coordinator.wait_for("serving ");
    while murmuration.run(&["health"]).code != Some(0) {
        std::thread::sleep(Duration::from_millis(50));
    }

    let address = free_address();
    let url = format!("http://{address}");
    // The worker's coordinator does not exist, so the worker is alive but not ready.
    let worker = start_worker_with("http://127.0.0.1:1", &[("MURMURATION_HEALTH", &address)]);
    while murmuration
        .run(&["health", "--alive", "--coordinator", &url])
        .code
        != Some(0)
    {
        std::thread::sleep(Duration::from_millis(50));
    }
    let ready = murmuration.run(&["health", "--coordinator", &url]);
    assert_eq!(ready.code, Some(1));
    assert!(ready.stderr.contains("is not ready"), "{}", ready.stderr);
    worker.kill();
    coordinator.kill();
}

/// A collector of trace spans.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<ResourceSpans>>>);

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        request: tonic::Request<ExportTraceServiceRequest>,
    ) -> Result<tonic::Response<ExportTraceServiceResponse>, tonic::Status> {
        self.0.lock().unwrap().extend(request.into_inner().resource_spans);
        Ok(tonic::Response::new(ExportTraceServiceResponse::default()))
    }
}

impl Collector {
    /// Starts a collector; returns the collector and its URL.
    async fn start() -> (Self, String) {
        let collector = Self::default();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let server = Server::builder().add_service(TraceServiceServer::new(collector.clone()));
        tokio::spawn(server.serve_with_incoming(TcpListenerStream::new(listener)));
        (collector, url)
    }

    /// The ids of traces in which a process of this service has the span of a lease, each with the id of the span's parent.
    fn leases(&self, service: &str) -> BTreeMap<Vec<u8>, Vec<u8>> {
        let is_named = |spans: &&ResourceSpans| {
            let attributes = spans.resource.iter().flat_map(|resource| &resource.attributes);
            attributes.into_iter().any(|attribute| {
                attribute.key == "service.name"
                    && format!("{:?}", attribute.value).contains(&format!("\"{service}\""))
            })
        };
        let all = self.0.lock().unwrap();
        let named = all.iter().filter(is_named);
        let spans = named
            .flat_map(|spans| &spans.scope_spans)
            .flat_map(|spans| &spans.spans);
        let leases = spans.filter(|span| span.name == "lease");
        leases
            .map(|span| (span.trace_id.clone(), span.parent_span_id.clone()))
            .collect()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lease_is_one_trace_on_coordinator_and_worker() {
    let (collector, url) = Collector::start().await;
    let variables = [
        ("OTEL_EXPORTER_OTLP_ENDPOINT", url.as_str()),
        ("OTEL_BSP_SCHEDULE_DELAY", "100"),
    ];
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(folder.path());
    let mut coordinator = murmuration.start_with(
        &[
            "serve",
            "--workers",
            "0",
            "--listen",
            "127.0.0.1:0",
            "--insecure-listen",
        ],
        &variables,
    );
    let message = coordinator.wait_for("serving ");
    let worker = start_worker_with(message.rsplit(' ').next().unwrap(), &variables);
    let spec = folder.path().join("small.toml");
    std::fs::write(&spec, small_spec("").to_toml()).unwrap();
    let submitted = murmuration.run(&["submit", spec.to_str().unwrap()]);
    assert_eq!(submitted.code, Some(0), "{}", submitted.stderr);
    loop {
        let given = collector.leases("murmuration");
        let done = collector.leases("murmuration-worker");
        if let Some((_, parent)) = done.iter().find(|(trace, _)| given.contains_key(*trace)) {
            assert!(!parent.is_empty());
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(worker.terminate(), Some(0));
    coordinator.kill();
}

/// An address that was free a moment ago.
fn free_address() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().to_string()
}
