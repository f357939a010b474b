//! The connection of a worker or trainer to its coordinator: connects, sends keep-alives, and reconnects.
//!
//! [`keep`] keeps a process connected. A [`Peer`] uses one connection, a [`Link`]. The crate does not depend on the kind of work.

mod access_file;
mod allocation;
mod attempts;
mod backoff;
mod checkpoints;
mod credentials;
mod health;
mod leaving;
mod link;
mod output;
mod pinned;
mod process;
mod stop;
mod target;
mod telemetry;
mod token;

pub use access_file::{AccessFile, AccessFileError, Fingerprint, is_loopback};
pub use allocation::{Rank, cores, host_name, machine_name, process_name, rank};
pub use attempts::{attempts, for_lease, may_pass, may_pass_elsewhere};
pub use checkpoints::fetch_checkpoint;
pub use credentials::{
    Bearer, Coordinator, Credentials, CredentialsError, IdentityFiles, TrustFiles, read_pem, read_token,
    root_cause,
};
pub use health::{Health, READY};
pub use leaving::{Leaving, OnLost};
pub use link::{Broken, Link};
pub use output::{OutputError, parse_arguments, print, say};
pub use process::{PeerArguments, Post, run_peer};
pub use stop::{stopped, termination};
pub use target::{Target, access_file_of};
pub use telemetry::{TRACE_PARENT, Telemetry, follow, telemetry, trace_parent};
pub use token::{Token, TokenDigest, TokenError};

use backoff::Backoff;
use murmuration_proto::{PROTOCOL_VERSION, SIMULATOR_VERSION, TRAINER_VERSION, v1};
use murmuration_swarm::{EmbeddingKind, Text};
use std::{
    future::Future,
    hash::{BuildHasher as _, Hasher as _, RandomState},
    io,
    net::{IpAddr, SocketAddr},
    time::{Duration, Instant, SystemTime},
};
use tokio::sync::watch;
use tonic::{Code, Status, service::interceptor::InterceptedService, transport::Endpoint};

/// The kind of process that connects. The kind determines the gRPC service and the contents of the Hello message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    Worker {
        /// Number of simultaneous evaluations, 1 to 4,096.
        capacity: u32,
        /// Embedding kind of the worker's machine; unknown if the worker does not embed.
        kind: EmbeddingKind,
    },
    /// A trainer, which runs one training at a time.
    Trainer,
}

impl Role {
    fn hello(self, name: &str, instance: u64) -> v1::Hello {
        let name = name.to_owned();
        match self {
            Self::Worker { capacity, kind } => v1::Hello {
                name,
                capacity,
                simulator_version: SIMULATOR_VERSION.to_owned(),
                trainer_version: String::new(),
                instance,
                embedding_kind: kind.number(),
                protocol_version: PROTOCOL_VERSION,
            },
            Self::Trainer => v1::Hello {
                name,
                capacity: 1,
                simulator_version: String::new(),
                trainer_version: TRAINER_VERSION.to_owned(),
                instance,
                embedding_kind: 0,
                protocol_version: PROTOCOL_VERSION,
            },
        }
    }

    const fn noun(self) -> &'static str {
        match self {
            Self::Worker { .. } => "worker",
            Self::Trainer => "trainer",
        }
    }
}

/// Why a worker or trainer gave up. After a temporary error, the process tries again without limit.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The URL is not valid, or the credentials do not fit it.
    #[error(transparent)]
    Credentials(#[from] CredentialsError),
    /// The health service could not be started.
    #[error("cannot listen on {listen} for health queries: {source}")]
    Health { listen: SocketAddr, source: io::Error },
    /// The coordinator refused the process because of its version or its credentials.
    #[error("the coordinator refused this {who}: {reason}")]
    Refused {
        /// The kind of the process: "worker" or "trainer".
        who: &'static str,
        /// The coordinator's reason.
        reason: String,
    },
    /// The process never had a connection, and has tried for long enough.
    #[error(
        "no connection to {coordinator} for {} (--on-coordinator-lost): {error}",
        humantime::format_duration(*tried)
    )]
    Lost {
        coordinator: String,
        tried: Duration,
        error: Broken,
    },
}

/// A coordinator, and the identity to connect with.
#[derive(Debug, Clone)]
pub struct Address {
    target: Target,
    role: Role,
    name: String,
    /// Number that identifies the process across connections; never 0.
    instance: u64,
    local_address: Option<IpAddr>,
    leaving: Leaving,
    calls: watch::Sender<Option<Coordinator>>,
}

/// The connection of a process to its coordinator for other calls than its stream; cheap to clone.
#[derive(Debug, Clone)]
pub struct Calls(watch::Receiver<Option<Coordinator>>);

impl Calls {
    /// The coordinator that the process found last. The connection is made at its first use, and again whenever it breaks.
    ///
    /// # Errors
    /// `UNAVAILABLE` if the process has not found its coordinator yet.
    pub fn coordinator(&self) -> Result<Coordinator, Status> {
        let found = self.0.borrow().clone();
        found.ok_or_else(|| Status::unavailable("the coordinator has not been found yet"))
    }
}

impl Address {
    /// The coordinator `target`, for a peer with this display name (at most 128 bytes). The coordinator's access file may not
    /// exist yet.
    ///
    /// # Errors
    /// Fails if the URL is not valid, if the credentials do not fit the URL, or if the access file is another file.
    pub fn new(target: Target, role: Role, name: &str) -> Result<Self, LinkError> {
        let address = Self {
            target,
            role,
            name: name.to_owned(),
            // `RandomState` has random keys, so two processes get different numbers.
            instance: RandomState::new().build_hasher().finish() | 1,
            local_address: None,
            leaving: Leaving::default(),
            calls: watch::Sender::new(None),
        };
        match address.find() {
            Err(CredentialsError::AccessFile(error))
                if error.is_missing() || matches!(error, AccessFileError::Ended { .. }) =>
            {
                Ok(address)
            }
            Err(error) => Err(error.into()),
            Ok(_) => Ok(address),
        }
    }

    /// Connects from this local `address`, for a machine with several addresses.
    #[must_use]
    pub fn connecting_from(mut self, address: Option<IpAddr>) -> Self {
        self.local_address = address;
        self
    }

    /// For a process that leaves by itself.
    #[must_use]
    pub fn leaving(mut self, leaving: Leaving) -> Self {
        self.leaving = leaving;
        self
    }

    /// A separate connection for other calls than the stream.
    #[must_use]
    pub fn calls(&self) -> Calls {
        if let Ok((endpoint, bearer)) = self.find() {
            self.direct_calls(&endpoint, bearer);
        }
        Calls(self.calls.subscribe())
    }

    /// Directs the [`Calls`] to a coordinator.
    fn direct_calls(&self, endpoint: &Endpoint, bearer: Bearer) {
        let is_known = self.calls.borrow().is_some() && !self.target.may_change();
        if !is_known {
            let calls = InterceptedService::new(endpoint.connect_lazy(), bearer);
            self.calls.send_replace(Some(calls));
        }
    }

    /// The coordinator as it can be reached now.
    fn find(&self) -> Result<(Endpoint, Bearer), CredentialsError> {
        let (url, credentials) = self.target.look_up()?;
        let endpoint = credentials
            .endpoint(&url)?
            .connect_timeout(Duration::from_secs(5))
            .tcp_nodelay(true)
            .http2_keep_alive_interval(Duration::from_secs(2))
            .keep_alive_timeout(Duration::from_secs(3))
            .keep_alive_while_idle(true)
            .local_address(self.local_address);
        Ok((endpoint, credentials.bearer()))
    }
}

/// A process that works for a coordinator.
pub trait Peer {
    /// Handles one connection, from the coordinator's Welcome message on. After a request to stop, sends all results, awaits
    /// [`Link::close`] and returns `Ok`.
    fn session(
        &mut self,
        link: Link,
        stop: watch::Receiver<bool>,
    ) -> impl Future<Output = Result<(), Broken>> + Send;
}

/// How much later than its workers a coordinator may begin to listen.
const LATE_START: Duration = Duration::from_secs(90);
/// A connection that lasts this long is not one of a series of failures.
const LASTING: Duration = Duration::from_secs(2);

/// Keeps `peer` connected until `stop` becomes true and the peer has left, or until the coordinator has been lost for as long as
/// [`OnLost`] says. Reports to `health` whether the peer is connected.
///
/// # Errors
/// Fails if the coordinator refuses the peer, or if there was no connection for as long as [`OnLost`] says.
pub async fn keep(
    address: &Address,
    health: &Health,
    peer: &mut impl Peer,
    mut stop: watch::Receiver<bool>,
) -> Result<(), LinkError> {
    let mut pause = Backoff::new();
    let mut lost = Lost::new(address.leaving.on_lost);
    let coordinator = address.target.to_string();
    loop {
        let connected = tokio::select! {
            connected = Link::connect(address) => connected,
            () = stopped(&mut stop) => return Ok(()),
        };
        let ended = match connected {
            Ok(link) => {
                let connected = Instant::now();
                tracing::info!(name = address.name, coordinator, "connected");
                health.ready(true).await;
                let ended = peer.session(link, stop.clone()).await;
                // A worker goes on with its leases, and sends the results over its next connection.
                if matches!(address.role, Role::Trainer) {
                    address.leaving.activity.dropped_all();
                }
                // A coordinator that ends each connection at once gets longer pauses too.
                if connected.elapsed() >= LASTING {
                    pause.reset();
                }
                lost.was_connected();
                health.ready(false).await;
                ended
            }
            Err(broken) => Err(broken),
        };
        let error = match ended {
            Ok(()) => return Ok(()),
            Err(Broken::Target(CredentialsError::AccessFile(AccessFileError::Ended { at, .. })))
                if lost.ended_now(at) =>
            {
                tracing::info!(
                    name = address.name,
                    coordinator,
                    "the coordinator has ended, leaving"
                );
                return Ok(());
            }
            // The access file may name another token soon.
            Err(Broken::Refused(status)) if !(address.target.may_change() && is_unknown(&status)) => {
                return Err(LinkError::Refused {
                    who: address.role.noun(),
                    reason: Text::line(status.message()).into(),
                });
            }
            Err(broken) => broken,
        };
        if lost.is_for_good() {
            if lost.had_a_connection {
                tracing::info!(name = address.name, coordinator, %error, "the coordinator is lost, leaving");
                return Ok(());
            }
            return Err(LinkError::Lost {
                coordinator,
                tried: Duration::from_secs(lost.since.elapsed().as_secs()),
                error,
            });
        }
        tracing::info!(name = address.name, coordinator, %error, "not connected, will try again");
        tokio::select! {
            () = tokio::time::sleep(pause.next()) => {}
            () = stopped(&mut stop) => return Ok(()),
        }
    }
}

/// Whether the coordinator does not know the credentials of this process.
fn is_unknown(status: &Status) -> bool {
    status.code() == Code::Unauthenticated
}

/// The time since a process lost its last connection, or since its start.
struct Lost {
    on_lost: OnLost,
    had_a_connection: bool,
    since: Instant,
    /// The start of the process.
    started: SystemTime,
}

impl Lost {
    fn new(on_lost: OnLost) -> Self {
        Self {
            on_lost,
            had_a_connection: false,
            since: Instant::now(),
            started: SystemTime::now(),
        }
    }

    fn was_connected(&mut self) {
        self.had_a_connection = true;
        self.since = Instant::now();
    }

    /// Whether a coordinator that ended at this time is the one that this process waits for, and not one before it.
    fn ended_now(&self, at: Option<SystemTime>) -> bool {
        self.had_a_connection || at.is_some_and(|at| at > self.started) || self.since.elapsed() >= LATE_START
    }

    fn is_for_good(&self) -> bool {
        match self.on_lost {
            OnLost::Retry => false,
            OnLost::RetryFor(time) => self.since.elapsed() >= time,
            OnLost::Exit => self.had_a_connection,
        }
    }
}
