//! The address at which a coordinator listens, its encryption, and its access rules.

use super::{Access, ClassSeats, Hosts, LocalToken, PublicUrl, Seats, Tls, TlsError, Tokens, self_signed};
use std::{
    net::{Ipv4Addr, SocketAddr},
    path::Path,
};

/// Where and how a coordinator listens.
#[derive(Debug)]
pub struct ListenConfig {
    address: SocketAddr,
    encryption: Encryption,
    people: People,
    seats: Seats,
    public: Option<PublicUrl>,
}

#[derive(Debug)]
enum Encryption {
    /// The traffic stays on this machine, or on a trusted network.
    Nothing,
    /// By a certificate that the coordinator makes for itself.
    SelfSigned,
    /// By a certificate of the user's.
    Certificate(Tls),
}

/// Whom a coordinator admits.
#[derive(Debug)]
enum People {
    /// Everybody who reaches the coordinator, as an operator.
    Everybody,
    /// The bearers of these tokens, and of the owner's token.
    Holders(Tokens),
}

impl ListenConfig {
    /// A loopback address without encryption, where everybody is an operator: for a machine of one person. Port 0 is any free
    /// port.
    #[must_use]
    pub fn open(port: u16) -> Self {
        Self::trusting((Ipv4Addr::LOCALHOST, port).into(), None, None)
    }

    /// A listener at `address`, encrypted with `tls`, for the holders of `tokens` and the bearers of the owner's token. Without
    /// `tls`, a listener for other machines is encrypted by a certificate that the coordinator makes for itself.
    #[must_use]
    pub fn new(address: SocketAddr, tls: Option<Tls>, tokens: Option<Tokens>) -> Self {
        let is_loopback = address.ip().to_canonical().is_loopback();
        Self {
            address,
            encryption: match tls {
                Some(tls) => Encryption::Certificate(tls),
                None if is_loopback => Encryption::Nothing,
                None => Encryption::SelfSigned,
            },
            people: People::Holders(tokens.unwrap_or_default()),
            seats: Seats::new(&[]),
            public: None,
        }
    }

    /// A listener on a network whose users are all trusted: without `tls` it is not encrypted, and without `tokens` everybody who
    /// reaches it is an operator.
    #[must_use]
    pub fn trusting(address: SocketAddr, tls: Option<Tls>, tokens: Option<Tokens>) -> Self {
        Self {
            address,
            encryption: tls.map_or(Encryption::Nothing, Encryption::Certificate),
            people: tokens.map_or(People::Everybody, People::Holders),
            seats: Seats::new(&[]),
            public: None,
        }
    }

    /// Serves the pages at `public` too, through a proxy.
    #[must_use]
    pub fn with_public_url(mut self, public: Option<PublicUrl>) -> Self {
        self.public = public;
        self
    }

    pub const fn public_url(&self) -> Option<&PublicUrl> {
        self.public.as_ref()
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

    /// Whether connections are encrypted.
    pub const fn is_encrypted(&self) -> bool {
        !matches!(self.encryption, Encryption::Nothing)
    }

    /// The certificate of the coordinator over the data directory `data`, if connections are encrypted.
    ///
    /// # Errors
    /// If the coordinator's own certificate cannot be read or made.
    pub fn tls(&self, data: &Path) -> Result<Option<Tls>, TlsError> {
        match &self.encryption {
            Encryption::Nothing => Ok(None),
            Encryption::SelfSigned => self_signed(data).map(Some),
            Encryption::Certificate(tls) => Ok(Some(tls.clone())),
        }
    }

    /// The host names that the endpoint answers to.
    pub fn hosts(&self, access: &Access) -> Hosts {
        Hosts::of(self.address, access, self.is_encrypted())
    }

    /// Credentials that are accepted.
    pub fn access(&self, owner: &LocalToken) -> Access {
        let certificates = matches!(&self.encryption, Encryption::Certificate(tls) if tls.has_client_ca());
        match &self.people {
            People::Everybody => Access {
                certificates,
                ..Access::default()
            },
            People::Holders(tokens) => owner.access_with(tokens.clone(), certificates),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn others_reach_a_coordinator_encrypted_and_with_a_token_unless_they_are_trusted() {
        let folder = tempfile::tempdir().unwrap();
        let owner = LocalToken::of(folder.path()).unwrap();
        for (address, is_loopback) in [
            ("127.0.0.1:7700", true),
            ("127.8.8.8:0", true),
            ("[::1]:7700", true),
            ("[::ffff:127.0.0.1]:7700", true),
            ("0.0.0.0:7700", false),
            ("[::]:7700", false),
            ("192.168.0.7:7700", false),
            ("[::ffff:192.168.0.7]:1", false),
        ] {
            let address = address.parse().unwrap();
            let config = ListenConfig::new(address, None, None);
            assert_eq!(config.is_encrypted(), !is_loopback, "{address}");
            assert_eq!(config.tls(folder.path()).unwrap().is_some(), !is_loopback);
            let access = config.access(&owner);
            assert!(access.whose(owner.token().digest()).is_some() && !access.is_open());
            let trusting = ListenConfig::trusting(address, None, None);
            assert!(!trusting.is_encrypted() && trusting.access(&owner).is_open());
            let with_tokens = ListenConfig::trusting(address, None, Some(Tokens::default()));
            assert!(!with_tokens.access(&owner).is_open());
        }
    }
}
