//! Metrics of campaigns.

use prometheus_client::{
    metrics::histogram::{Histogram, exponential_buckets},
    registry::{Registry, Unit},
};
use std::time::Duration;

/// Counters of campaigns; cheap to clone.
#[derive(Debug, Clone)]
pub struct CampaignMetrics {
    commit: Histogram,
}

impl CampaignMetrics {
    /// All metrics at zero, added to `registry`.
    pub fn register(registry: &mut Registry) -> Self {
        // The buckets range from a millisecond to half a minute.
        let commit = Histogram::new(exponential_buckets(0.001, 2.0, 16));
        registry.register_with_unit(
            "generation_commit",
            "Time to put a generation on disk",
            Unit::Seconds,
            commit.clone(),
        );
        Self { commit }
    }

    /// Records the commit of a generation.
    pub(super) fn generation_committed(&self, took: Duration) {
        self.commit.observe(took.as_secs_f64());
    }
}
