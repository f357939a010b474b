//! Telemetry of a process: a log on stderr, and traces for a collector if the environment names a collector.

use murmuration_swarm::text;
use opentelemetry::{
    propagation::TextMapPropagator as _,
    trace::{TraceContextExt as _, TracerProvider as _},
};
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::{Resource, propagation::TraceContextPropagator, trace::SdkTracerProvider};
use std::{collections::HashMap, env, io};
use tracing::{Level, Span};
use tracing_opentelemetry::OpenTelemetrySpanExt as _;
use tracing_subscriber::{filter::Targets, layer::SubscriberExt as _, util::SubscriberInitExt as _};

/// Environment variable with the collector's URL. The exporter also reads the other `OTEL_` variables that it documents.
const COLLECTOR: &str = "OTEL_EXPORTER_OTLP_ENDPOINT";
/// Header that passes a trace from one process to the next (W3C Trace Context).
pub const TRACE_PARENT: &str = "traceparent";

/// Telemetry of a process; [`Telemetry::end`] sends its last spans.
#[derive(Debug)]
#[must_use = "what is not ended may lose its last spans"]
pub struct Telemetry(Option<SdkTracerProvider>);

/// Starts telemetry. The log goes to stderr, with colours only on a terminal. `RUST_LOG` filters the log by level and module;
/// without this variable, the log has the level `default`. If `OTEL_EXPORTER_OTLP_ENDPOINT` names a collector, spans of `service`
/// go to this collector by gRPC. Call this function once per process, on a tokio runtime.
pub fn telemetry(service: &'static str, default: Level) -> Telemetry {
    let asked = env::var("RUST_LOG").ok().filter(|asked| !asked.is_empty());
    let asked = asked.map(|asked| asked.parse::<Targets>());
    let refused = asked
        .as_ref()
        .and_then(|asked| asked.as_ref().err().map(ToString::to_string));
    let filter = asked
        .and_then(Result::ok)
        // The client of a bucket logs each repeated request; what comes of them is logged by the caller.
        .unwrap_or_else(|| {
            Targets::new()
                .with_default(default)
                .with_target("object_store", Level::WARN.min(default))
        });
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
                .with_writer(|| LogLines),
        )
        .init();
    if let Some(error) = refused {
        tracing::error!("RUST_LOG is not a valid filter and is ignored: {error}");
    }
    Telemetry(provider.unwrap_or_else(|error| {
        tracing::error!(%error, "no traces are sent");
        None
    }))
}

/// Writes the log to stderr without hidden characters, except for its own colours: errors of libraries may repeat text from other
/// machines.
#[derive(Debug)]
struct LogLines;

impl io::Write for LogLines {
    fn write(&mut self, lines: &[u8]) -> io::Result<usize> {
        io::stderr().write_all(shown(&String::from_utf8_lossy(lines)).as_bytes())?;
        Ok(lines.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// Removes hidden characters from `lines`, except for escape sequences of colours.
fn shown(lines: &str) -> String {
    let mut parts = lines.split("\u{1b}[");
    let mut all = text::printable(parts.next().unwrap_or_default());
    for part in parts {
        let codes = part.len()
            - part
                .trim_start_matches(|c: char| c.is_ascii_digit() || c == ';')
                .len();
        match part[codes..].strip_prefix('m') {
            Some(rest) => all.extend(["\u{1b}[", &part[..codes], "m", &text::printable(rest)]),
            None => all += &text::printable(&format!("\u{1b}[{part}")),
        }
    }
    all
}

/// Whether the log on stderr has colours: on a terminal, unless `NO_COLOR` or `TERM` forbids colours.
fn in_colour() -> bool {
    anstream::AutoStream::choice(&io::stderr()) != anstream::ColorChoice::Never
}

/// The exporter of spans; `None` if no collector is named.
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
    /// Sends the remaining spans, for five seconds at most.
    pub async fn end(self) {
        let Some(provider) = self.0 else { return };
        // `shutdown` blocks until this runtime has delivered the collector's answer, so it needs its own thread.
        let ended = tokio::task::spawn_blocking(move || provider.shutdown()).await;
        if let Ok(Err(error)) = ended {
            tracing::warn!(%error, "the last spans were not sent");
        }
    }
}

/// The trace of a span, in the W3C's format, for another process to continue; empty if nothing is traced.
#[must_use]
pub fn trace_parent(span: &Span) -> String {
    let mut carrier = HashMap::new();
    TraceContextPropagator::new().inject_context(&span.context(), &mut carrier);
    carrier.remove(TRACE_PARENT).unwrap_or_default()
}

/// Lets a span continue a trace that another process began; does nothing if `parent` is not a trace.
pub fn follow(span: &Span, parent: &str) {
    let carrier = HashMap::from([(TRACE_PARENT.to_owned(), parent.to_owned())]);
    let context = TraceContextPropagator::new().extract(&carrier);
    if context.span().span_context().is_valid() {
        // An error means that tracing is off.
        let _ = span.set_parent(context);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_has_our_colours_and_no_other_hidden_characters() {
        let line = "\u{1b}[31mERROR\u{1b}[0m http://x\u{1b}[2J\u{202e}y\u{1b}]0;title\u{7}\n";
        let shown = shown(line);
        assert!(
            shown.starts_with("\u{1b}[31mERROR\u{1b}[0m http://x"),
            "{shown:?}"
        );
        assert!(shown.ends_with('\n'), "{shown:?}");
        let rest = shown.replace("\u{1b}[31m", "").replace("\u{1b}[0m", "");
        assert!(!rest.contains(['\u{1b}', '\u{202e}', '\u{7}']), "{shown:?}");
    }
}
