//! Metrics of a coordinator, in the format of Prometheus.
//!
//! [`Metrics`] is a value, not a global, because a process may run several coordinators. Events are counted where they happen,
//! through handles that are cheap to clone. Values in the store are read on each request (`observed`). docs/operations.md
//! explains every name.

mod observed;

use axum::http::HeaderMap;
use murmuration_access::{Seats, preferred};
use murmuration_dispatch::{DispatchMetrics, Families, PeerKind};
use murmuration_engine::campaign::{CampaignError, CampaignMetrics, Campaigns};
use murmuration_proto::{SIMULATOR_VERSION, TRAINER_VERSION};
use murmuration_store::Store;
use prometheus_client::{
    encoding::text::{encode_eof, encode_registry},
    metrics::info::Info,
    registry::Registry,
};
use std::{collections::HashMap, sync::Arc};

/// A text format of metrics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    OpenMetrics,
    /// The older format of Prometheus, which `promtool check metrics` and many other tools read.
    Classic,
}

impl Format {
    const OPEN_METRICS: &str = "application/openmetrics-text";
    const CLASSIC: &str = "text/plain";

    /// The format that a client with these headers prefers.
    #[must_use]
    pub fn preferred(headers: &HeaderMap) -> Self {
        match preferred(headers, &[Self::CLASSIC, Self::OPEN_METRICS]) {
            Self::OPEN_METRICS => Self::OpenMetrics,
            _ => Self::Classic,
        }
    }

    #[must_use]
    pub const fn content_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Classic => "text/plain; version=0.0.4; charset=utf-8",
        }
    }
}

/// Turns OpenMetrics into the older format: there, the name of a counter's or an info's family is that of its samples, infos are
/// gauges, and units and the end have no lines.
fn classic(text: &str) -> String {
    let mut kinds = HashMap::new();
    for line in text.lines() {
        if let Some((name, kind)) = line.strip_prefix("# TYPE ").and_then(|rest| rest.split_once(' ')) {
            kinds.insert(name, kind);
        }
    }
    let mut lines = String::new();
    for line in text.lines() {
        let comment = line.strip_prefix("# ").map(|rest| {
            let mut words = rest.splitn(3, ' ');
            [(); 3].map(|()| words.next().unwrap_or_default())
        });
        match comment {
            Some([word @ ("HELP" | "TYPE"), name, rest]) => {
                let kind = kinds.get(name).copied().unwrap_or_default();
                let (suffix, rest) = match (kind, word) {
                    ("counter", _) => ("_total", rest),
                    ("info", "TYPE") => ("_info", "gauge"),
                    ("info", _) => ("_info", rest),
                    (_, _) => ("", rest),
                };
                lines += &format!("# {word} {name}{suffix} {rest}\n");
            }
            // The unit of a family, and the end.
            Some(_) => {}
            None => {
                lines += line;
                lines.push('\n');
            }
        }
    }
    lines
}

/// Prefix of every metric's name.
const PREFIX: &str = "murmuration";

/// The metrics of one coordinator; cheap to clone.
#[derive(Debug, Clone)]
pub struct Metrics {
    registry: Arc<Registry>,
    dispatch: Families,
    campaigns: CampaignMetrics,
}

impl Metrics {
    /// All metrics at zero.
    #[must_use]
    pub fn new() -> Self {
        let mut registry = Registry::with_prefix(PREFIX);
        let versions = [
            ("version", env!("CARGO_PKG_VERSION")),
            ("simulator", SIMULATOR_VERSION),
            ("trainer", TRAINER_VERSION),
        ];
        registry.register("build", "Versions of what runs", Info::new(versions.to_vec()));
        let campaigns = CampaignMetrics::register(&mut registry);
        let dispatch = Families::register(&mut registry);
        Self {
            registry: Arc::new(registry),
            dispatch,
            campaigns,
        }
    }

    /// The counters for the dispatcher of workers or trainers.
    #[must_use]
    pub fn dispatch(&self, peer: PeerKind) -> DispatchMetrics {
        self.dispatch.of(peer)
    }

    /// The counters for campaigns.
    #[must_use]
    pub fn campaigns(&self) -> CampaignMetrics {
        self.campaigns.clone()
    }

    /// All metrics as text.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn render(
        &self,
        campaigns: &Campaigns,
        store: &Store,
        seats: &Seats,
        format: Format,
    ) -> Result<String, CampaignError> {
        let observed = observed::observe(campaigns, store, seats).await?;
        let mut text = String::new();
        let encoded = encode_registry(&mut text, &self.registry)
            .and_then(|()| encode_registry(&mut text, &observed))
            .and_then(|()| encode_eof(&mut text));
        encoded.map_err(|_| CampaignError::Broken)?;
        Ok(match format {
            Format::OpenMetrics => text,
            Format::Classic => classic(&text),
        })
    }
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::{HeaderValue, header::ACCEPT};

    #[test]
    fn only_a_client_that_names_openmetrics_gets_it() {
        let prometheus =
            "application/openmetrics-text;version=1.0.0;q=0.5,text/plain;version=0.0.4;q=0.3,*/*;q=0.2";
        let format = |accept| {
            let headers = HeaderMap::from_iter([(ACCEPT, HeaderValue::from_static(accept))]);
            Format::preferred(&headers)
        };
        assert_eq!(format(prometheus), Format::OpenMetrics);
        for accept in ["*/*", "text/plain", "application/openmetrics-text;q=0"] {
            assert_eq!(format(accept), Format::Classic, "{accept}");
        }
        assert_eq!(Format::preferred(&HeaderMap::new()), Format::Classic);
    }

    #[test]
    fn families_of_the_older_format_have_the_names_of_their_samples() {
        let text = "# HELP a_build Versions.\n# TYPE a_build info\na_build_info{version=\"1 # 2\"} 1\n\
                    # HELP a_seconds Time # spent.\n# TYPE a_seconds counter\n# UNIT a_seconds seconds\na_seconds_total 3\n\
                    # HELP a_workers Workers.\n# TYPE a_workers gauge\na_workers 2\n# EOF\n";
        let expected = "# HELP a_build_info Versions.\n# TYPE a_build_info gauge\na_build_info{version=\"1 # 2\"} 1\n\
                        # HELP a_seconds_total Time # spent.\n# TYPE a_seconds_total counter\na_seconds_total 3\n\
                        # HELP a_workers Workers.\n# TYPE a_workers gauge\na_workers 2\n";
        assert_eq!(classic(text), expected);
    }
}
