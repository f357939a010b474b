//! Metrics of a coordinator, in the format of Prometheus.
//!
//! [`Metrics`] is a value, not a global, because a process may run several coordinators. Events are counted where they happen,
//! through handles that are cheap to clone. Values in the store are read on each request (`observed`). docs/operations.md
//! explains every name.

mod observed;

use murmuration_access::Seats;
use murmuration_dispatch::{DispatchMetrics, Families, PeerKind};
use murmuration_engine::campaign::{CampaignError, CampaignMetrics, Campaigns};
use murmuration_proto::{SIMULATOR_VERSION, TRAINER_VERSION};
use murmuration_store::Store;
use prometheus_client::{
    encoding::text::{encode_eof, encode_registry},
    metrics::info::Info,
    registry::Registry,
};
use std::sync::Arc;

/// Content type of [`Metrics::render`]'s text.
pub const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

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

    /// All metrics as text in the OpenMetrics format, which Prometheus reads.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub async fn render(
        &self,
        campaigns: &Campaigns,
        store: &Store,
        seats: &Seats,
    ) -> Result<String, CampaignError> {
        let observed = observed::observe(campaigns, store, seats).await?;
        let mut text = String::new();
        let encoded = encode_registry(&mut text, &self.registry)
            .and_then(|()| encode_registry(&mut text, &observed))
            .and_then(|()| encode_eof(&mut text));
        encoded.map_err(|_| CampaignError::Broken)?;
        Ok(text)
    }
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}
