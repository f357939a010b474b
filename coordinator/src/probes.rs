//! Probes of a coordinator over HTTP: liveness, readiness and metrics.
//!
//! The probes are `/healthz`, `/readyz` and `/metrics`, beside the pages and gRPC. Probes change nothing, and reveal nothing of a
//! campaign's contents.

use crate::metrics::{Format, Metrics};
use axum::{
    extract::State,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use murmuration_access::{CostClass, GuardedRouter, Requirement, Seats};
use murmuration_engine::campaign::Campaigns;
use murmuration_link::Health;
use murmuration_store::Store;
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};
use tonic_health::{pb::health_server::HealthServer, server::HealthService};

/// Whether a coordinator has resumed the campaigns of its predecessor; cheap to clone.
#[derive(Debug, Clone, Default)]
pub(crate) struct Readiness {
    ready: Arc<AtomicBool>,
    /// The same readiness, reported over gRPC.
    health: Health,
}

impl Readiness {
    pub(crate) async fn set(&self, ready: bool) {
        self.ready.store(ready, Ordering::Release);
        self.health.ready(ready).await;
    }

    /// The gRPC health service, which also covers the services of these names.
    pub(crate) async fn service(&self, services: &[&str]) -> HealthServer<HealthService> {
        for service in services {
            self.health.serves(service).await;
        }
        self.health.service()
    }
}

/// Sources of the probes' answers.
#[derive(Debug, Clone)]
pub(crate) struct Probes {
    pub(crate) readiness: Readiness,
    pub(crate) metrics: Metrics,
    pub(crate) campaigns: Campaigns,
    pub(crate) store: Store,
    pub(crate) seats: Seats,
}

impl Probes {
    pub(crate) fn routes(self) -> GuardedRouter {
        GuardedRouter::default()
            .get(
                "/healthz",
                Requirement::Nothing,
                CostClass::Free,
                async || "alive\n",
            )
            .get("/readyz", Requirement::Nothing, CostClass::Free, ready)
            .get("/metrics", Requirement::VIEWER, CostClass::Light, metrics)
            .with_state(self)
    }
}

/// Ready if the store answers and interrupted campaigns run again.
async fn ready(State(probes): State<Probes>) -> Response {
    if !probes.readiness.ready.load(Ordering::Acquire) {
        return not_ready("not ready: campaigns are being resumed, or the coordinator is shutting down");
    }
    match probes.store.run(Store::answers).await {
        Ok(()) => "ready\n".into_response(),
        Err(error) => not_ready(&format!("not ready: {error}")),
    }
}

fn not_ready(why: &str) -> Response {
    (StatusCode::SERVICE_UNAVAILABLE, format!("{why}\n")).into_response()
}

async fn metrics(State(probes): State<Probes>, headers: HeaderMap) -> Response {
    let format = Format::preferred(&headers);
    let rendered = probes
        .metrics
        .render(&probes.campaigns, &probes.store, &probes.seats, format);
    match rendered.await {
        Ok(text) => ([(header::CONTENT_TYPE, format.content_type())], text).into_response(),
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, format!("{error}\n")).into_response(),
    }
}
