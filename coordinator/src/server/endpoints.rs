//! The endpoints of a coordinator: the requested endpoint, an endpoint for commands of its own machine, and the access file by
//! which other processes find the coordinator.

use super::{Options, Publication, ServerError};
use murmuration_access::{
    Access, Endpoint, GuardedRouter, Hosts, LocalToken, OneTimeCodes, Seats, Sessions, Tls,
    connections::{ConnectionPermits, connections},
    limits, self_signed,
};
use murmuration_link::{AccessFile, Credentials, Target, access_file_of, host_name, is_loopback};
use murmuration_web as web;
use std::{
    fmt::Display,
    net::{IpAddr, Ipv4Addr, SocketAddr},
    path::Path,
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

/// The endpoints, and how to reach them.
pub(super) struct Opened {
    pub(super) local: LocalWay,
    pub(super) servers: Vec<Serving>,
    /// For processes that find the coordinator by an access file; `None` if none is to be written.
    pub(super) published: Option<AccessFile>,
}

/// The parts of a coordinator that all its endpoints use.
struct Shared<'a> {
    data: &'a Path,
    owner: LocalToken,
    sessions: Sessions,
    codes: OneTimeCodes,
}

impl Shared<'_> {
    fn endpoint(&self, access: Access, hosts: Hosts, is_encrypted: bool) -> Endpoint {
        Endpoint {
            access,
            sessions: self.sessions.clone(),
            codes: self.codes.clone(),
            hosts,
            is_encrypted,
            public: None,
            show_refusal: web::show_refusal,
        }
    }
}

impl Served {
    /// Serves at the requested address and, if access is restricted, at a loopback address for this machine's commands.
    pub(super) async fn open(self, listener: TcpListener, options: &Options) -> Result<Opened, ServerError> {
        let (config, data) = (&options.listen, options.data.path());
        let owner = LocalToken::of(data)?;
        let (tls, access) = (config.tls(data)?, config.access(&owner));
        let is_open = access.is_open() && tls.is_none();
        let address = listener.local_addr().map_err(|source| ServerError::Listen {
            address: config.address(),
            source,
        })?;
        let own = owner.token().digest();
        // Without restricted access there are no tokens to revoke.
        let sessions = Sessions::kept(data, owner.token(), |token| {
            access.tokens.is_none() || access.whose(token).is_some() || token == own
        })?;
        let shared = Shared {
            data,
            codes: OneTimeCodes::new(owner.token()),
            owner,
            sessions,
        };
        let permits = ConnectionPermits::of_this_process();
        let hosts = config.hosts(&access);
        let endpoint = Endpoint {
            public: config.public_url().cloned(),
            ..shared.endpoint(access, hosts, tls.is_some())
        };
        let mut servers =
            vec![self.at(listener, tls.as_ref().map(Tls::config), endpoint, permits.clone())?];
        let local = if is_open {
            LocalWay {
                url: url(address, false),
                credentials: Credentials::default(),
            }
        } else {
            let (listener, address) = listen((Ipv4Addr::LOCALHOST, 0).into()).await?;
            let endpoint = shared.endpoint(shared.owner.access(), Hosts::Any, false);
            // Separate permits let this machine's commands connect even if other machines have taken all connections.
            servers.push(self.at(listener, None, endpoint, ConnectionPermits::of_this_machine())?);
            LocalWay {
                url: url(address, false),
                credentials: Credentials::token(shared.owner.token().clone()),
            }
        };
        let published = match &options.publication {
            Some(publication) => {
                let pages = publication.url(address, tls.is_some());
                let (mut access, server) = self
                    .published(&shared, pages, address.ip(), tls, is_open, permits)
                    .await?;
                servers.extend(server);
                if let Some(public) = config.public_url() {
                    access.pages = public.to_string();
                }
                Some(access)
            }
            None => None,
        };
        Ok(Opened {
            local,
            servers,
            published,
        })
    }

    /// The access file for a coordinator with these `pages`. The owner's token is sent only over encrypted connections, or on a
    /// network that the user trusts: after the end of a coordinator, another user of this machine could listen at its port. So a
    /// coordinator that listens on loopback without encryption gets a further, encrypted endpoint.
    async fn published(
        &self,
        shared: &Shared<'_>,
        pages: String,
        ip: IpAddr,
        tls: Option<Tls>,
        is_open: bool,
        permits: ConnectionPermits,
    ) -> Result<(AccessFile, Option<Serving>), ServerError> {
        let mut access = AccessFile {
            coordinator: pages.clone(),
            pages,
            fingerprint: tls.as_ref().map(Tls::fingerprint),
            name: tls.as_ref().and_then(Tls::own_name),
            token: (!is_open).then(|| shared.owner.token().clone()),
        };
        if is_open || tls.is_some() || !ip.to_canonical().is_loopback() {
            return Ok((access, None));
        }
        let tls = self_signed(shared.data)?;
        // Clients that stay, such as Python's, then reach the next coordinator too.
        let former = former_port(shared.data);
        let (listener, address) = match listen((ip, former).into()).await {
            Ok(listening) => listening,
            Err(_) => listen((ip, 0).into()).await?,
        };
        access.coordinator = url(address, true);
        access.fingerprint = Some(tls.fingerprint());
        access.name = tls.own_name();
        let endpoint = shared.endpoint(shared.owner.access(), Hosts::Any, true);
        let server = self.at(listener, Some(tls.config()), endpoint, permits)?;
        Ok((access, Some(server)))
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

impl Publication {
    /// The URL by which others reach a coordinator that listens at `address`.
    fn url(&self, address: SocketAddr, is_encrypted: bool) -> String {
        let is_everywhere = address.ip().to_canonical().is_unspecified();
        let host = match &self.contact {
            Some(contact) => Some(contact.clone()),
            None if is_everywhere => host_name(),
            None => None,
        };
        match host {
            Some(host) => url(format_args!("{host}:{}", address.port()), is_encrypted),
            None => url(address, is_encrypted),
        }
    }
}

/// The port of the encrypted endpoint of the coordinator before; 0 if there was none.
fn former_port(data: &Path) -> u16 {
    let former = AccessFile::read(&access_file_of(data));
    let port = former.ok().and_then(|access| {
        let port = access.coordinator.rsplit_once(':')?.1.parse().ok()?;
        (is_loopback(&access.coordinator) && access.coordinator != access.pages).then_some(port)
    });
    port.unwrap_or(0)
}

/// A listener, and its address.
pub(super) async fn listen(address: SocketAddr) -> Result<(TcpListener, SocketAddr), ServerError> {
    let error = |source| ServerError::Listen { address, source };
    let listener = TcpListener::bind(address).await.map_err(error)?;
    let bound = listener.local_addr().map_err(error)?;
    Ok((listener, bound))
}

/// The URL of a host and port, for clients.
pub(super) fn url(address: impl Display, is_encrypted: bool) -> String {
    let scheme = if is_encrypted { "https" } else { "http" };
    format!("{scheme}://{address}")
}
