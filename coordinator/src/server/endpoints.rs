//! The endpoints of a coordinator: the requested endpoint, and an endpoint for processes of its own machine.

use super::{Options, ServerError};
use murmuration_access::{
    Endpoint, GuardedRouter, Hosts, LocalToken, Seats, Sessions,
    connections::{ConnectionPermits, connections},
    limits,
};
use murmuration_link::{Credentials, Target};
use murmuration_web as web;
use std::{
    net::{Ipv4Addr, SocketAddr},
    sync::Arc,
    time::Duration,
};
use tokio::{net::TcpListener, sync::watch, task::JoinHandle};
use tonic::transport::{Server, ServerTlsConfig};

/// A listener's task.
pub(super) type Serving = JoinHandle<Result<(), tonic::transport::Error>>;

/// Access for processes of this machine and the same user.
#[derive(Debug, Clone)]
pub struct LocalWay {
    /// The URL, unencrypted because the traffic stays on this machine.
    pub url: String,
    /// Credentials for this URL.
    pub credentials: Credentials,
}

impl LocalWay {
    /// The coordinator, for a worker or trainer of this machine.
    #[must_use]
    pub fn target(&self) -> Target {
        Target::Url {
            url: self.url.clone(),
            credentials: self.credentials.clone(),
        }
    }
}

/// Pages and services that every endpoint serves.
pub(super) struct Served {
    pub(super) routes: GuardedRouter,
    pub(super) seats: Seats,
    /// True once the server must stop.
    pub(super) stopped: watch::Receiver<bool>,
}

impl Served {
    /// Serves at the requested address and, if access is restricted, at a loopback address for this machine.
    pub(super) async fn open(
        self,
        listener: TcpListener,
        options: &Options,
    ) -> Result<(LocalWay, Vec<Serving>), ServerError> {
        let (config, data) = (&options.listen, options.data.path());
        let local = LocalToken::of(data)?;
        let (tls, access) = (config.tls(), config.access());
        let is_open = access.is_open() && tls.is_none();
        let address = listener.local_addr().map_err(|source| ServerError::Listen {
            address: config.address(),
            source,
        })?;
        let own = local.token().digest();
        // Without restricted access there are no tokens to revoke.
        let sessions = Sessions::kept(data, local.token(), |token| {
            access.tokens.is_none() || access.whose(token).is_some() || token == own
        })?;
        let endpoint = Endpoint {
            access,
            sessions: sessions.clone(),
            hosts: config.hosts(),
            is_encrypted: tls.is_some(),
            show_refusal: web::show_refusal,
        };
        let mut servers = vec![self.at(listener, tls, endpoint, ConnectionPermits::of_this_process())?];
        let way = if is_open {
            LocalWay {
                url: url(address, false),
                credentials: Credentials::default(),
            }
        } else {
            let (listener, address) = listen((Ipv4Addr::LOCALHOST, 0).into()).await?;
            let endpoint = Endpoint {
                access: local.access(),
                sessions,
                hosts: Hosts::Any,
                is_encrypted: false,
                show_refusal: web::show_refusal,
            };
            // Separate permits let this machine's commands connect even if other machines have taken all connections.
            let permits = ConnectionPermits::of_this_machine();
            servers.push(self.at(listener, None, endpoint, permits)?);
            LocalWay {
                url: url(address, false),
                credentials: Credentials::token(local.token().clone()),
            }
        };
        Ok((way, servers))
    }

    fn at(
        &self,
        listener: TcpListener,
        tls: Option<ServerTlsConfig>,
        endpoint: Endpoint,
        permits: ConnectionPermits,
    ) -> Result<Serving, tonic::transport::Error> {
        let mut server = Server::builder()
            .http2_keepalive_interval(Some(Duration::from_secs(2)))
            .http2_keepalive_timeout(Some(Duration::from_secs(3)))
            .http2_max_header_list_size(limits::MAX_READ_HEADER_BYTES)
            .initial_stream_window_size(limits::UNREAD_BYTES_PER_STREAM)
            .initial_connection_window_size(
                limits::UNREAD_BYTES_PER_STREAM * limits::MAX_STREAMS_PER_CONNECTION,
            )
            .max_concurrent_streams(limits::MAX_STREAMS_PER_CONNECTION)
            // Browsers use HTTP/1 on an unencrypted connection.
            .accept_http1(true);
        if let Some(tls) = tls {
            server = server.tls_config(tls)?;
        }
        let routes = web::behind(self.routes.clone(), Arc::new(endpoint), self.seats.clone());
        let connections = connections(listener, permits);
        let mut stopped = self.stopped.clone();
        let serving = server
            .add_routes(routes)
            .serve_with_incoming_shutdown(connections, async move {
                // A dropped sender also stops the server.
                let _ = stopped.wait_for(|&stopped| stopped).await;
            });
        Ok(tokio::spawn(serving))
    }
}

/// A listener, and its address.
pub(super) async fn listen(address: SocketAddr) -> Result<(TcpListener, SocketAddr), ServerError> {
    let error = |source| ServerError::Listen { address, source };
    let listener = TcpListener::bind(address).await.map_err(error)?;
    let bound = listener.local_addr().map_err(error)?;
    Ok((listener, bound))
}

/// The URL of an address, for clients.
pub(super) fn url(address: SocketAddr, is_encrypted: bool) -> String {
    let scheme = if is_encrypted { "https" } else { "http" };
    format!("{scheme}://{address}")
}
