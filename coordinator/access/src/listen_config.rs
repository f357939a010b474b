//! The address at which a coordinator listens, its encryption, and its access rules; unsafe combinations are refused.

use super::{Access, ClassSeats, Hosts, Seats, Tokens};
use crate::limits::HANDSHAKE_LIMIT;
use murmuration_link::{CredentialsError, read_pem, root_cause};
use std::{
    net::{Ipv4Addr, SocketAddr},
    path::{Path, PathBuf},
    sync::Arc,
};
use tonic::transport::{Certificate, Identity, Server, ServerTlsConfig};

/// Where and how a coordinator listens.
#[derive(Debug)]
pub struct ListenConfig {
    address: SocketAddr,
    tls: Option<Tls>,
    tokens: Option<Arc<Tokens>>,
    seats: Seats,
}

/// The certificate of the coordinator, and the authority that signs the certificates of machines.
#[derive(Debug)]
pub struct Tls {
    config: ServerTlsConfig,
    /// Whether machines must have a certificate of an authority.
    client_ca: bool,
}

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ListenConfigError {
    /// Others on the network could read the traffic.
    #[error(
        "other machines can reach {0}, and the traffic would not be encrypted: give --certificate and --key \
         (`murmuration certs DIR` makes a first pair), or --insecure-listen on a network that you trust"
    )]
    Plain(SocketAddr),
    /// Others on the network could do anything.
    #[error(
        "other machines can reach {0}, and every person who does could do anything: give --tokens FILE (`murmuration token \
         NAME --role ROLE` makes its lines), or --insecure-listen on a network that you trust"
    )]
    Open(SocketAddr),
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] CredentialsError),
    /// The certificate, its key and the authority do not fit together.
    #[error("the certificate in {} cannot be used: {reason}", path.display())]
    Unusable {
        /// The certificate's file.
        path: PathBuf,
        /// Error of the TLS library.
        reason: String,
    },
}

impl Tls {
    /// Reads PEM files: the coordinator's certificate (followed by its chain) and key, and the certificate of the authority that
    /// signs the certificates of workers and trainers. If `client_ca` is given, workers and trainers must show a certificate;
    /// people and browsers need no certificate.
    ///
    /// # Errors
    /// The error names the file that cannot be used, and the reason.
    pub fn read(certificate: &Path, key: &Path, client_ca: Option<&Path>) -> Result<Self, ListenConfigError> {
        let identity = Identity::from_pem(
            read_pem(certificate, "certificate")?,
            read_pem(key, "private key")?,
        );
        let mut config = ServerTlsConfig::new().identity(identity).timeout(HANDSHAKE_LIMIT);
        if let Some(path) = client_ca {
            let ca = Certificate::from_pem(read_pem(path, "certificate")?);
            config = config.client_ca_root(ca).client_auth_optional(true);
        }
        // The configuration is checked now, not at the first connection.
        let checked = Server::builder().tls_config(config.clone());
        checked.map_err(|error| ListenConfigError::Unusable {
            path: certificate.to_owned(),
            reason: root_cause(&error),
        })?;
        Ok(Self {
            config,
            client_ca: client_ca.is_some(),
        })
    }
}

impl ListenConfig {
    /// A loopback address without encryption or tokens, for a machine of one person. Port 0 is any free port.
    #[must_use]
    pub fn loopback(port: u16) -> Self {
        Self {
            address: (Ipv4Addr::LOCALHOST, port).into(),
            tls: None,
            tokens: None,
            seats: Seats::new(&[]),
        }
    }

    /// A listener at `address`, encrypted with `tls`, for the holders of `tokens`. Encryption and tokens are required, unless
    /// `address` is a loopback address or everybody who can reach it is `trusted`.
    ///
    /// # Errors
    /// [`ListenConfigError::Plain`] if encryption is missing, [`ListenConfigError::Open`] if tokens are missing.
    pub fn new(
        address: SocketAddr,
        tls: Option<Tls>,
        tokens: Option<Tokens>,
        trusted: bool,
    ) -> Result<Self, ListenConfigError> {
        let alone = address.ip().to_canonical().is_loopback();
        match (&tls, &tokens) {
            (None, _) if !alone && !trusted => Err(ListenConfigError::Plain(address)),
            (Some(_), None) if !alone && !trusted => Err(ListenConfigError::Open(address)),
            _ => Ok(Self {
                address,
                tls,
                tokens: tokens.map(Arc::new),
                seats: Seats::new(&[]),
            }),
        }
    }

    /// Replaces the default seats of the classes in `changed`.
    #[must_use]
    pub fn with_seats(mut self, changed: &[ClassSeats]) -> Self {
        self.seats = Seats::new(changed);
        self
    }

    /// The seats of all endpoints.
    pub const fn seats(&self) -> &Seats {
        &self.seats
    }

    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The TLS configuration, if connections are encrypted.
    pub fn tls(&self) -> Option<ServerTlsConfig> {
        self.tls.as_ref().map(|tls| tls.config.clone())
    }

    /// The host names that the endpoint answers to.
    pub fn hosts(&self) -> Hosts {
        Hosts::of(self.address, &self.access(), self.tls.is_some())
    }

    /// Credentials that are accepted.
    pub fn access(&self) -> Access {
        Access {
            tokens: self.tokens.clone(),
            certificates: self.tls.as_ref().is_some_and(|tls| tls.client_ca),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn enter(address: &str, tokens: bool, trusted: bool) -> Result<ListenConfig, ListenConfigError> {
        let tokens = tokens.then(Tokens::default);
        ListenConfig::new(address.parse().unwrap(), None, tokens, trusted)
    }

    #[test]
    fn in_the_clear_one_listens_to_this_machine_or_on_purpose() {
        for alone in [
            "127.0.0.1:7700",
            "127.8.8.8:0",
            "[::1]:7700",
            "[::ffff:127.0.0.1]:7700",
        ] {
            assert!(enter(alone, false, false).is_ok(), "{alone}");
        }
        for elsewhere in [
            "0.0.0.0:7700",
            "[::]:7700",
            "192.168.0.7:7700",
            "[::ffff:192.168.0.7]:1",
        ] {
            for tokens in [false, true] {
                let refused = enter(elsewhere, tokens, false);
                assert!(matches!(refused, Err(ListenConfigError::Plain(_))), "{elsewhere}");
                assert!(enter(elsewhere, tokens, true).is_ok(), "{elsewhere}");
            }
        }
    }
}
