//! Who may do what: the doors of a coordinator, what a request shows at one, and what it needs.
//!
//! `needs` is the one table of what every method and page needs; `admit` asks it before anything else happens with a
//! request, and `origin` whether another site's page may have sent it. Machines show certificates, people tokens, browsers
//! a cookie that a token was given for. Services and pages know nothing of any of this.
//!
//! Beside it stand the `connections` of a listener, every limit on what comes over the network, and the id of a request.

mod admit;
pub mod connections;
pub mod limits;
mod listen_config;
mod local;
mod machine;
mod needs;
mod origin;
pub mod requests;
mod sessions;
mod tokens;

pub use admit::{Door, admit, is_for_anybody};
pub use listen_config::{ListenConfig, ListenConfigError, Tls};
pub use local::{Local, local_token};
pub use machine::{Machine, origin};
pub use needs::Role;
pub use origin::Hosts;
pub use sessions::{Session, Sessions};
pub use tokens::{HolderName, entry};
pub use tokens::{Tokens, TokensError};

use machine::Certificate;
use murmuration_link::TokenDigest;
use needs::Requirement;
use std::sync::Arc;

/// Whom a door lets in.
#[derive(Debug, Clone, Default)]
pub struct Access {
    /// Whose tokens are good; without any, everybody is an operator.
    pub tokens: Option<Arc<Tokens>>,
    /// Whether machines must show a certificate.
    pub certificates: bool,
}

/// What a request shows for itself.
#[derive(Debug, Clone, Default)]
pub struct PresentedCredentials {
    /// The digest of a token, in a header or behind a cookie.
    token: Option<TokenDigest>,
    /// The certificate of its connection, which the TLS library has checked.
    certificate: Option<Certificate>,
}

/// Why a request is not let in.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// It shows nothing.
    #[error(
        "this coordinator asks for a token: put yours into MURMURATION_TOKEN, or its file's name into \
         MURMURATION_TOKEN_FILE (in a browser, log in)"
    )]
    NoToken,
    /// It shows a token of nobody's.
    #[error("this coordinator does not know that token")]
    UnknownToken,
    /// It shows no certificate.
    #[error(
        "workers and trainers need a certificate that the coordinator's client CA signed: name it with --certificate \
         and --key"
    )]
    NoCertificate,
    /// It shows a certificate for other machines.
    #[error("this certificate is not for a {0}: it names another kind of machine")]
    WrongCertificate(Machine),
    /// Its token is not good for this.
    #[error("this needs the role {needs}; the token of \"{name}\" has the role {has}")]
    Role {
        /// Whose token it is.
        name: HolderName,
        /// What the token is good for.
        has: Role,
        /// What would be needed.
        needs: Role,
    },
    /// It is one of too many.
    #[error("too many requests on one connection: try again in a second")]
    Rate,
    /// It has more headers than there may be, or longer ones.
    #[error(
        "a request may have {} headers, and {} bytes of them and its address together",
        crate::limits::MAX_HEADERS,
        crate::limits::MAX_HEADER_BYTES
    )]
    Headers,
    /// It names a host that may be somebody else's.
    #[error(
        "this coordinator asks nobody for a token, so it answers under its address and as localhost alone: under \
         another name it could be a part of somebody's web site (`serve --tokens FILE`, or TLS, allows any name)"
    )]
    Host,
    /// It comes from another site's page, or does not say that it comes from one of ours.
    #[error("only pages of this coordinator may ask for that: the header Origin must be theirs")]
    Origin,
    /// It is not what gRPC clients send.
    #[error("gRPC methods take requests of the content type application/grpc alone")]
    ContentType,
}

impl Access {
    /// Whether everybody gets in, as an operator.
    pub const fn is_open(&self) -> bool {
        self.tokens.is_none() && !self.certificates
    }

    fn admits(&self, need: Requirement, shown: &PresentedCredentials) -> Result<(), Refusal> {
        let certificate = shown.certificate.as_ref().filter(|_| self.certificates);
        let is_for = |machine| certificate.is_some_and(|certificate| certificate.is_for(machine));
        let needs = match need {
            Requirement::Nothing => return Ok(()),
            Requirement::Machine(machine) if is_for(machine) => return Ok(()),
            Requirement::Machine(machine) if certificate.is_some() => {
                return Err(Refusal::WrongCertificate(machine));
            }
            Requirement::Machine(_) if self.certificates => return Err(Refusal::NoCertificate),
            Requirement::MachineOr(machine, _) if is_for(machine) => return Ok(()),
            Requirement::AnyMachineOr(_) if is_for(Machine::Worker) || is_for(Machine::Trainer) => {
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
        let digest = shown.token.ok_or(Refusal::NoToken)?;
        let holder = tokens.holder(digest).ok_or(Refusal::UnknownToken)?;
        match holder.role >= needs {
            true => Ok(()),
            false => Err(Refusal::Role {
                name: holder.name.clone(),
                has: holder.role,
                needs,
            }),
        }
    }

    /// Whose token this is: name and role, if it is somebody's.
    pub fn whose(&self, token: TokenDigest) -> Option<(&HolderName, Role)> {
        let holder = self.tokens.as_ref()?.holder(token)?;
        Some((&holder.name, holder.role))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_link::Token;

    fn shown(token: Option<&Token>, certificate: &[Machine]) -> PresentedCredentials {
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
                let admitted = access.admits(Requirement::Person(role), &shown(Some(token), &[]));
                assert_eq!(admitted.is_ok(), place >= needs, "{place} for {role}");
            }
            // Without a client CA machines are let in as operators.
            let machine = access.admits(
                Requirement::Machine(Machine::Worker),
                &shown(Some(token), &[Machine::Worker]),
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
        let refused = access.admits(Requirement::Person(Role::Viewer), &shown(Some(&stranger), &[]));
        assert_eq!(refused, Err(Refusal::UnknownToken));
    }

    #[test]
    fn with_a_client_ca_machines_show_certificates_and_nothing_else() {
        let operator = Token::generate().unwrap();
        let access = access(&[(Role::Operator, &operator)], true);
        let (worker, trainer) = (Machine::Worker, Machine::Trainer);
        let person = shown(Some(&operator), &[]);
        let refused = access.admits(Requirement::Machine(worker), &person);
        assert_eq!(refused, Err(Refusal::NoCertificate));
        let machine = shown(None, &[worker]);
        assert_eq!(access.admits(Requirement::Machine(worker), &machine), Ok(()));
        let refused = access.admits(Requirement::Machine(trainer), &machine);
        assert_eq!(refused, Err(Refusal::WrongCertificate(trainer)));
        for need in [
            Requirement::AnyMachineOr(Role::Operator),
            Requirement::MachineOr(worker, Role::Operator),
        ] {
            assert_eq!(access.admits(need, &machine), Ok(()));
            assert_eq!(access.admits(need, &person), Ok(()));
        }
        for need in [
            Requirement::MachineOr(trainer, Role::Operator),
            Requirement::Person(Role::Viewer),
        ] {
            assert_eq!(access.admits(need, &machine), Err(Refusal::NoToken));
        }
    }

    #[test]
    fn without_tokens_everybody_is_an_operator() {
        let open = Access::default();
        for need in [
            Requirement::Machine(Machine::Worker),
            Requirement::Person(Role::Operator),
            Requirement::MachineOr(Machine::Trainer, Role::Operator),
        ] {
            assert_eq!(open.admits(need, &PresentedCredentials::default()), Ok(()));
        }
    }
}
