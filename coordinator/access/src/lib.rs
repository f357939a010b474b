//! Access control: the endpoints of a coordinator, the credentials of a request, and the requirement of its route.
//!
//! A page or service is registered with a `GuardedRouter`, which takes the `Requirement` with the route. `admit` reads the
//! requirement before anything reads the request's body, and `origin` checks whether another site's page may have sent the
//! request. Machines show certificates, people show tokens, and browsers show a cookie that they got for a token. The request
//! then takes one of the `seats` of its cost class. The `response_body` holds this seat until the body has been sent. The
//! handlers of services and pages need no checks of their own.
//!
//! The crate also holds the `connections` of a listener, every limit on what comes over the network, and the ids of
//! requests.

mod admit;
pub mod connections;
pub mod limits;
mod listen_config;
mod local;
mod machine;
mod media_types;
mod messages;
mod one_time;
mod origin;
mod public_url;
mod request_body;
pub mod requests;
mod requirement;
mod response_body;
mod router;
mod seats;
mod self_signed;
mod sessions;
mod tls;
mod tokens;

pub use admit::{Endpoint, RequestHead};
pub use listen_config::ListenConfig;
pub use local::{LocalToken, local_token};
pub use machine::{ByCertificate, MachineKind, origin};
pub use media_types::preferred;
pub use one_time::{OneTimeCodes, one_time_code};
pub use origin::Hosts;
pub use public_url::{NoPublicUrl, PublicUrl};
pub use requirement::{MethodRequirements, Requirement, Requirements, Role};
pub use router::GuardedRouter;
pub use seats::{ClassSeats, Client, CostClass, NoClassSeats, NoSeat, SeatCounts, SeatLimits, Seats};
pub use self_signed::self_signed;
pub use sessions::Sessions;
pub use tls::{Tls, TlsError};
pub use tokens::{HolderName, Tokens, TokensError, file_entry};

use machine::Certificate;
use murmuration_link::TokenDigest;
use murmuration_swarm::grouped;
use std::sync::Arc;

/// Credentials that an endpoint accepts.
#[derive(Debug, Clone, Default)]
pub struct Access {
    /// The tokens that are accepted; if `None`, everybody is an operator.
    pub tokens: Option<Arc<Tokens>>,
    /// The owner's token, if it is one of `tokens`.
    pub owner: Option<TokenDigest>,
    /// Whether machines must show a certificate.
    pub certificates: bool,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct PresentedCredentials {
    /// The digest of the token in the request's header, or of the token that the browser's session was opened with.
    token: Option<TokenDigest>,
    /// The certificate of the request's connection, which the TLS library has checked.
    certificate: Option<Certificate>,
}

/// Why a request is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    #[error(
        "this coordinator requires a token: name its access file with --access FILE, or set MURMURATION_TOKEN_FILE to the \
         file that holds your token (in a browser, open the link that `murmuration link` prints)"
    )]
    NoToken,
    #[error("this coordinator does not know that token")]
    UnknownToken,
    #[error(
        "workers and trainers need a certificate that the coordinator's client CA signed: give its files with \
         --certificate and --key"
    )]
    NoCertificate,
    #[error("this certificate is not for a {0}: it names another kind of machine")]
    WrongCertificate(MachineKind),
    /// The role of the request's token does not suffice.
    #[error("this needs the role {needs}; the token of \"{name}\" has the role {has}")]
    Role {
        name: HolderName,
        has: Role,
        needs: Role,
    },
    /// The request's connection has sent too many requests.
    #[error("too many requests on one connection: try again in a second")]
    Rate,
    /// The request has too many headers, or headers that are too long.
    #[error(
        "a request may have at most {} headers, and its headers and address together at most {} bytes",
        crate::limits::MAX_HEADERS,
        grouped(crate::limits::MAX_HEADER_BYTES.into())
    )]
    Headers,
    /// The request names a host that may belong to another web site.
    #[error(
        "this coordinator requires no token, so it answers only requests for its IP address or localhost: under another \
         name it could be made a part of another web site (`serve --tokens FILE`, or TLS, allows any name)"
    )]
    Host,
    /// A page of another site sent the request, or the request does not name its page.
    #[error(
        "only pages of this coordinator may send this request: the header Origin must name this coordinator"
    )]
    Origin,
    /// The content type of the request is not a content type of gRPC.
    #[error("gRPC methods accept only requests of the content type application/grpc")]
    ContentType,
    /// The request came without token or certificate, and took too long.
    #[error(
        "a request without a token has {} seconds to arrive: send it again, all at once",
        crate::limits::STRANGER_LIMIT.as_secs()
    )]
    Slow,
    /// There is no seat for the request.
    #[error(transparent)]
    NoSeat(#[from] NoSeat),
}

impl Access {
    /// Whether everybody may pass, as an operator.
    pub const fn is_open(&self) -> bool {
        self.tokens.is_none() && !self.certificates
    }

    fn admits(&self, requirement: Requirement, presented: &PresentedCredentials) -> Result<(), Refusal> {
        let certificate = presented.certificate.as_ref().filter(|_| self.certificates);
        let is_for = |machine| certificate.is_some_and(|certificate| certificate.is_for(machine));
        let required = match requirement {
            Requirement::Nothing => return Ok(()),
            Requirement::Machine(machine) if is_for(machine) => return Ok(()),
            Requirement::Machine(machine) if certificate.is_some() => {
                return Err(Refusal::WrongCertificate(machine));
            }
            Requirement::Machine(_) if self.certificates => return Err(Refusal::NoCertificate),
            Requirement::MachineOr(machine, _) if is_for(machine) => return Ok(()),
            Requirement::AnyMachineOr(_) if is_for(MachineKind::Worker) || is_for(MachineKind::Trainer) => {
                return Ok(());
            }
            Requirement::Machine(_) => Role::Operator,
            Requirement::MachineOr(_, role) | Requirement::AnyMachineOr(role) | Requirement::Person(role) => {
                role
            }
        };
        let Some(tokens) = &self.tokens else {
            return Ok(());
        };
        let digest = presented.token.ok_or(Refusal::NoToken)?;
        let holder = tokens.holder(digest).ok_or(Refusal::UnknownToken)?;
        match holder.role >= required {
            true => Ok(()),
            false => Err(Refusal::Role {
                name: holder.name.clone(),
                has: holder.role,
                needs: required,
            }),
        }
    }

    /// The holder of a token: name and role.
    pub fn whose(&self, token: TokenDigest) -> Option<(&HolderName, Role)> {
        let holder = self.tokens.as_ref()?.holder(token)?;
        Some((&holder.name, holder.role))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_link::Token;

    fn presented(token: Option<&Token>, certificate: &[MachineKind]) -> PresentedCredentials {
        PresentedCredentials {
            token: token.map(Token::digest),
            certificate: (!certificate.is_empty()).then(|| Certificate::for_these(certificate)),
        }
    }

    fn access(tokens: &[(Role, &Token)], certificates: bool) -> Access {
        let holders = tokens
            .iter()
            .map(|(role, token)| (role.to_string().parse().unwrap(), *role, token.digest()));
        Access {
            tokens: Some(Arc::new(Tokens::of(holders))),
            owner: None,
            certificates,
        }
    }

    #[test]
    fn a_role_may_do_what_lower_ones_may() {
        let tokens = [(); 3].map(|()| Token::generate().unwrap());
        let roles = [Role::Viewer, Role::Annotator, Role::Operator];
        let pairs: Vec<_> = roles.into_iter().zip(&tokens).collect();
        let access = access(&pairs, false);
        for (place, token) in tokens.iter().enumerate() {
            for (needs, role) in roles.into_iter().enumerate() {
                let admitted = access.admits(Requirement::Person(role), &presented(Some(token), &[]));
                assert_eq!(admitted.is_ok(), place >= needs, "{place} for {role}");
            }
            // Without a client CA, machines need an operator's token.
            let machine = access.admits(
                Requirement::Machine(MachineKind::Worker),
                &presented(Some(token), &[MachineKind::Worker]),
            );
            assert_eq!(machine.is_ok(), place == 2);
        }
        assert_eq!(
            access.admits(Requirement::Nothing, &PresentedCredentials::default()),
            Ok(())
        );
        assert_eq!(
            access.admits(
                Requirement::Person(Role::Viewer),
                &PresentedCredentials::default()
            ),
            Err(Refusal::NoToken)
        );
        let stranger = Token::generate().unwrap();
        let refused = access.admits(
            Requirement::Person(Role::Viewer),
            &presented(Some(&stranger), &[]),
        );
        assert_eq!(refused, Err(Refusal::UnknownToken));
    }

    #[test]
    fn with_a_client_ca_machines_show_certificates_and_nothing_else() {
        let operator = Token::generate().unwrap();
        let access = access(&[(Role::Operator, &operator)], true);
        let (worker, trainer) = (MachineKind::Worker, MachineKind::Trainer);
        let person = presented(Some(&operator), &[]);
        let refused = access.admits(Requirement::Machine(worker), &person);
        assert_eq!(refused, Err(Refusal::NoCertificate));
        let machine = presented(None, &[worker]);
        assert_eq!(access.admits(Requirement::Machine(worker), &machine), Ok(()));
        let refused = access.admits(Requirement::Machine(trainer), &machine);
        assert_eq!(refused, Err(Refusal::WrongCertificate(trainer)));
        for requirement in [
            Requirement::AnyMachineOr(Role::Operator),
            Requirement::MachineOr(worker, Role::Operator),
        ] {
            assert_eq!(access.admits(requirement, &machine), Ok(()));
            assert_eq!(access.admits(requirement, &person), Ok(()));
        }
        for requirement in [
            Requirement::MachineOr(trainer, Role::Operator),
            Requirement::Person(Role::Viewer),
        ] {
            assert_eq!(access.admits(requirement, &machine), Err(Refusal::NoToken));
        }
    }

    #[test]
    fn without_tokens_everybody_is_an_operator() {
        let open = Access::default();
        for requirement in [
            Requirement::Machine(MachineKind::Worker),
            Requirement::Person(Role::Operator),
            Requirement::MachineOr(MachineKind::Trainer, Role::Operator),
        ] {
            assert_eq!(open.admits(requirement, &PresentedCredentials::default()), Ok(()));
        }
    }
}
