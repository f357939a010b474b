//! The connection of a worker or trainer to its coordinator: made, kept alive, and made again when it breaks.
//!
//! [`keep`] is the whole of it: a [`Peer`] says what it does while it is connected, [`Link`] is what it does it with.
//! Knows nothing of the work itself.
#![deny(missing_docs)]

mod attempts;
mod backoff;
mod checkpoints;
mod credentials;
mod health;
mod input;
mod link;
mod output;
mod process;
mod stop;
mod telemetry;
mod token;

pub use attempts::{attempts, for_lease, may_pass, may_pass_elsewhere};
pub use checkpoints::fetch_checkpoint;
pub use credentials::{
    Bearer, Coordinator, Credentials, CredentialsError, IdentityFiles, TrustFiles, read_pem, read_token,
    root_cause,
};
pub use health::{Health, READY};
pub use input::{InputKind, TooLong, read_bytes, read_text, text_of};
pub use link::{Broken, Link};
pub use output::{OutputError, parse_arguments, print, say};
pub use process::{PartyArguments, Post, run_party};
pub use stop::{stopped, termination};
pub use telemetry::{TRACE_PARENT, Telemetry, follow, telemetry, trace_parent};
pub use token::{Token, TokenDigest, TokenError};

use backoff::Backoff;
use murmuration_proto::{EmbeddingKind, SIMULATOR_VERSION, TRAINER_VERSION, Text, v1};
use std::{
    future::Future,
    hash::{BuildHasher as _, Hasher as _, RandomState},
    io,
    net::{IpAddr, SocketAddr},
    time::Duration,
};
use tokio::sync::watch;
use tonic::{service::interceptor::InterceptedService, transport::Endpoint};

/// Who connects: decides the service, and what is said in Hello.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A worker that runs so many evaluations at once, 1 to 4,096.
    Worker {
        /// How many.
        capacity: u32,
        /// How it embeds; unknown if it does not.
        kind: EmbeddingKind,
    },
    /// A trainer, which has one training at a time.
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
            },
            Self::Trainer => v1::Hello {
                name,
                capacity: 1,
                simulator_version: String::new(),
                trainer_version: TRAINER_VERSION.to_owned(),
                instance,
                embedding_kind: 0,
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

/// Why a worker or trainer gave up. Anything that may pass is tried again for ever.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The URL is not one, or the credentials are not for it.
    #[error(transparent)]
    Credentials(#[from] CredentialsError),
    /// Nobody could ask how it is.
    #[error("cannot listen on {listen} to be asked for this process's health: {source}")]
    Health {
        /// The address.
        listen: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The coordinator does not take it: its version is another, or it has not shown who it is.
    #[error("the coordinator refused this {who}: {reason}")]
    Refused {
        /// "worker" or "trainer".
        who: &'static str,
        /// What the coordinator said.
        reason: String,
    },
}

/// Where a coordinator is, and as whom to connect.
#[derive(Debug, Clone)]
pub struct Address {
    endpoint: Endpoint,
    bearer: Bearer,
    role: Role,
    name: String,
    /// Who connects, over however many connections; not 0.
    instance: u64,
}

impl Address {
    /// The coordinator at `url` (`http://HOST:PORT` or `https://HOST:PORT`), for a party of this name (for people; at
    /// most 128 bytes) that shows these credentials.
    ///
    /// # Errors
    /// Where `url` is not one, or the credentials are not for it.
    pub fn new(url: &str, credentials: &Credentials, role: Role, name: &str) -> Result<Self, LinkError> {
        let endpoint = credentials
            .endpoint(url)?
            .connect_timeout(Duration::from_secs(5))
            .tcp_nodelay(true)
            .http2_keep_alive_interval(Duration::from_secs(2))
            .keep_alive_timeout(Duration::from_secs(3))
            .keep_alive_while_idle(true);
        Ok(Self {
            endpoint,
            bearer: credentials.bearer(),
            role,
            name: name.to_owned(),
            // Keyed at random by the system: two processes must not be taken for one.
            instance: RandomState::new().build_hasher().finish() | 1,
        })
    }

    /// The same, connecting from this address of the machine, where it has several.
    #[must_use]
    pub fn connecting_from(mut self, address: Option<IpAddr>) -> Self {
        self.endpoint = self.endpoint.local_address(address);
        self
    }

    /// A connection of its own for other calls, made when it is first used and again whenever it is broken.
    #[must_use]
    pub fn channel(&self) -> Coordinator {
        InterceptedService::new(self.endpoint.connect_lazy(), self.bearer.clone())
    }
}

/// Somebody who works for a coordinator.
pub trait Peer {
    /// One connection, from the Welcome on. `Ok` once it was asked to stop and has said what there was to say:
    /// then [`Link::close`] must have been awaited.
    fn session(
        &mut self,
        link: Link,
        stop: watch::Receiver<bool>,
    ) -> impl Future<Output = Result<(), Broken>> + Send;
}

/// Keeps `party` connected until it leaves after `stop` became true; `health` is told whether it is.
///
/// # Errors
/// Where the coordinator does not take it.
pub async fn keep(
    address: &Address,
    health: &Health,
    party: &mut impl Peer,
    mut stop: watch::Receiver<bool>,
) -> Result<(), LinkError> {
    let mut pause = Backoff::new();
    loop {
        let connected = tokio::select! {
            connected = Link::connect(address) => connected,
            () = stopped(&mut stop) => return Ok(()),
        };
        let ended = match connected {
            Ok(link) => {
                pause.reset();
                tracing::info!(name = address.name, coordinator = %address.endpoint.uri(), "connected");
                health.ready(true).await;
                let ended = party.session(link, stop.clone()).await;
                health.ready(false).await;
                ended
            }
            Err(broken) => Err(broken),
        };
        let error = match ended {
            Ok(()) => return Ok(()),
            Err(Broken::Refused(status)) => {
                return Err(LinkError::Refused {
                    who: address.role.noun(),
                    reason: Text::line(status.message()).into(),
                });
            }
            Err(broken) => broken,
        };
        tracing::info!(name = address.name, %error, "not connected, will try again");
        tokio::select! {
            () = tokio::time::sleep(pause.next()) => {}
            () = stopped(&mut stop) => return Ok(()),
        }
    }
}
