//! What a process says of itself while it runs: a log on stderr, and traces for a collector where one is named.

use opentelemetry::{
    propagation::TextMapPropagator as _,
    trace::{TraceContextExt as _, TracerProvider as _},
};
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::{Resource, propagation::TraceContextPropagator, trace::SdkTracerProvider};
use std::{collections::HashMap, env, io};
use tracing::Span;
use tracing_opentelemetry::OpenTelemetrySpanExt as _;
use tracing_subscriber::{EnvFilter, layer::SubscriberExt as _, util::SubscriberInitExt as _};

/// Names a collector's URL; its siblings are read too, as the exporter documents them.
const COLLECTOR: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";
/// The header under which a trace goes from one process to the next, by the W3C's Trace Context.
pub const TRACE_PARENT: &str = "traceparent";

/// A process's telemetry, for as long as it runs.
#[derive(Debug)]
#[must_use = "what is not ended may lose its last spans"]
pub struct Telemetry(Option<SdkTracerProvider>);

/// Logs to stderr, in colours on a terminal alone, what `RUST_LOG` lets through; without it, all from the level `default` on ("info", say). Where
/// `OTEL_EXPORTER_OTLP_ENDPOINT` names a collector, sends it the spans of the same, by gRPC, as those of `service`.
/// Once a process, on a tokio runtime.
pub fn telemetry(service: &'static str, default: &str) -> Telemetry {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    let provider = collector(service);
    let traces = provider
        .as_ref()
        .ok()
        .and_then(Option::as_ref)
        .map(|provider| tracing_opentelemetry::layer().with_tracer(provider.tracer(service)));
    tracing_subscriber::registry()
        .with(filter)
        .with(traces)
        .with(
            tracing_subscriber::fmt::layer()
                .with_ansi(in_colour())
                .with_writer(io::stderr),
        )
        .init();
    Telemetry(provider.unwrap_or_else(|error| {
        tracing::error!(%error, "no traces are sent");
        None
    }))
}

/// Whether the log on stderr may have colours: on a terminal, unless `NO_COLOR` or `TERM` says otherwise.
fn in_colour() -> bool {
    anstream::AutoStream::choice(&io::stderr()) != anstream::ColorChoice::Never
}

/// What sends spans to the collector; none where none is named.
fn collector(
    service: &'static str,
) -> Result<Option<SdkTracerProvider>, opentelemetry_otlp::ExporterBuildError> {
    if env::var_os(COLLECTOR).is_none_or(|url| url.is_empty()) {
        return Ok(None);
    }
    let exporter = SpanExporter::builder().with_tonic().build()?;
    let resource = Resource::builder().with_service_name(service).build();
    let provider = SdkTracerProvider::builder()
        .with_batch_exporter(exporter)
        .with_resource(resource);
    Ok(Some(provider.build()))
}

impl Telemetry {
    /// Sends what has not been sent, for five seconds at most.
    pub async fn end(self) {
        let Some(provider) = self.0 else { return };
        // It waits for an answer that comes by this runtime.
        let ended = tokio::task::spawn_blocking(move || provider.shutdown()).await;
        if let Ok(Err(error)) = ended {
            tracing::warn!(%error, "the last spans were not sent");
        }
    }
}

/// The trace that a span belongs to, as the W3C writes it, for a process that goes on with it; empty where nothing is
/// traced.
#[must_use]
pub fn trace_parent(span: &Span) -> String {
    let mut carrier = HashMap::new();
    TraceContextPropagator::new().inject_context(&span.context(), &mut carrier);
    carrier.remove(TRACE_PARENT).unwrap_or_default()
}

/// Makes a span go on with a trace that another process began; does nothing where `parent` is none.
pub fn follow(span: &Span, parent: &str) {
    let carrier = HashMap::from([(TRACE_PARENT.to_owned(), parent.to_owned())]);
    let context = TraceContextPropagator::new().extract(&carrier);
    if context.span().span_context().is_valid() {
        // An error says that nothing is traced here.
        let _ = span.set_parent(context);
    }
}
