//! Liveness and readiness of a process, by gRPC's health service, for supervisors that restart processes.

use crate::LinkError;
use std::net::SocketAddr;
use tokio::net::TcpListener;
use tokio_stream::wrappers::TcpListenerStream;
use tonic::transport::Server;
use tonic_health::{
    ServingStatus,
    pb::health_server::HealthServer,
    server::{HealthReporter, HealthService},
};

/// Service name for readiness. A worker or trainer is ready once it is connected; a coordinator is ready once it has resumed
/// interrupted campaigns. The empty service name means liveness.
pub const READY: &str = "ready";

/// The health of a process; cheap to clone. At first the process is alive and not ready.
#[derive(Debug, Clone)]
pub struct Health(HealthReporter);

impl Health {
    /// The health of a process without a listener; [`Health::service`] answers queries.
    #[must_use]
    pub fn new() -> Self {
        Self(HealthReporter::new())
    }

    /// Answers health queries at the address `listen` on a task of its own, until the process ends.
    ///
    /// # Errors
    /// Fails if the process cannot listen on this address.
    pub async fn serve(&self, listen: SocketAddr) -> Result<(), LinkError> {
        self.ready(false).await;
        let listener = TcpListener::bind(listen)
            .await
            .map_err(|source| LinkError::Health { listen, source })?;
        let server = Server::builder().add_service(self.service());
        tokio::spawn(async move {
            let served = server.serve_with_incoming(TcpListenerStream::new(listener)).await;
            if let Err(error) = served {
                tracing::error!(%error, "this process no longer answers health queries");
            }
        });
        Ok(())
    }

    #[must_use]
    pub fn service(&self) -> HealthServer<HealthService> {
        HealthServer::new(HealthService::from_health_reporter(self.0.clone()))
    }

    /// Reports the gRPC service of this name as serving.
    pub async fn serves(&self, service: &str) {
        self.0.set_service_status(service, ServingStatus::Serving).await;
    }

    /// Reports whether the process is ready.
    pub async fn ready(&self, ready: bool) {
        let status = match ready {
            true => ServingStatus::Serving,
            false => ServingStatus::NotServing,
        };
        self.0.set_service_status(READY, status).await;
    }
}

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::transport::Endpoint;
    use tonic_health::pb::{HealthCheckRequest, health_client::HealthClient, health_server::Health as _};

    async fn status(health: &Health, service: &str) -> i32 {
        let service_of = HealthService::from_health_reporter(health.0.clone());
        let request = HealthCheckRequest {
            service: service.to_owned(),
        };
        service_of
            .check(tonic::Request::new(request))
            .await
            .unwrap()
            .into_inner()
            .status
    }

    #[tokio::test]
    async fn a_process_lives_before_it_is_ready() {
        let health = Health::new();
        health.ready(false).await;
        assert_eq!((status(&health, "").await, status(&health, READY).await), (1, 2));
        health.clone().ready(true).await;
        assert_eq!(status(&health, READY).await, 1);
    }

    #[tokio::test]
    async fn whoever_asks_at_the_address_is_answered_and_a_second_process_is_refused_it() {
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = free.local_addr().unwrap();
        drop(free);
        Health::new().serve(address).await.unwrap();
        let endpoint = Endpoint::from_shared(format!("http://{address}")).unwrap();
        let mut client = HealthClient::new(endpoint.connect().await.unwrap());
        let answer = client.check(HealthCheckRequest::default()).await.unwrap();
        assert_eq!(answer.into_inner().status, 1);
        let refused = Health::new().serve(address).await.unwrap_err().to_string();
        assert!(refused.contains(&address.to_string()), "{refused}");
    }
}
