//! The certificates and the token by which a process and a coordinator trust each other, read from files.

use crate::{AccessFile, AccessFileError, Fingerprint, Token, TokenError, pinned::PinnedCertificate};
use murmuration_files::{InputKind, read_text};
use murmuration_swarm::text::masked_url;
use std::{
    env, io,
    path::{Path, PathBuf},
    sync::Arc,
};
use tonic::{
    Request, Status,
    metadata::{Ascii, MetadataValue},
    service::{Interceptor, interceptor::InterceptedService},
    transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity},
};

/// Environment variable that holds the token if no file is named.
const TOKEN: &str = "MURMURATION_TOKEN";

/// A connection to a coordinator. If the process has a token, the connection sends it with every request.
pub type Coordinator = InterceptedService<Channel, Bearer>;

/// Files by which a client of a coordinator finds, trusts and convinces it.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct TrustFiles {
    /// Access file of the coordinator: `serve` writes it, and other programs find the coordinator by it [default: access.json in
    /// the data directory]
    #[arg(long, global = true, env = "MURMURATION_ACCESS", value_name = "FILE")]
    pub access: Option<PathBuf>,
    /// Certificate of the authority that signed the coordinator's certificate, for an https:// coordinator
    #[arg(long, global = true, env = "MURMURATION_CA", value_name = "FILE")]
    pub ca: Option<PathBuf>,
    /// File that holds your token; MURMURATION_TOKEN may hold the token itself instead
    #[arg(long, global = true, env = "MURMURATION_TOKEN_FILE", value_name = "FILE")]
    pub token_file: Option<PathBuf>,
}

/// A machine's own certificate.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct IdentityFiles {
    /// Certificate to show to the coordinator, signed by its client CA
    #[arg(long, env = "MURMURATION_CERTIFICATE", value_name = "FILE", requires = "key")]
    pub certificate: Option<PathBuf>,
    /// Private key of the certificate
    #[arg(long, env = "MURMURATION_KEY", value_name = "FILE", requires = "certificate")]
    pub key: Option<PathBuf>,
}

/// The credentials to send to a coordinator, and the authority to trust. By default there are no credentials, and no
/// coordinator is trusted over https.
#[derive(Debug, Clone, Default)]
pub struct Credentials {
    ca: Option<Certificate>,
    identity: Option<Secret<Identity>>,
    token: Option<Token>,
    /// Fingerprint of the only certificate that the coordinator may show. With a fingerprint, no authority is needed.
    pinned: Option<Fingerprint>,
}

/// Why credentials cannot be used, or do not fit the coordinator's URL.
#[derive(Debug, thiserror::Error)]
pub enum CredentialsError {
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
    /// A file does not contain the expected item.
    #[error("{} holds no {what} in PEM format", path.display())]
    Pem {
        path: PathBuf,
        /// "certificate" or "private key".
        what: &'static str,
    },
    /// A file does not hold a token.
    #[error("{}: {error}", path.display())]
    TokenFile { path: PathBuf, error: TokenError },
    /// Both ways to name a coordinator are given.
    #[error(
        "--coordinator and --access both name a coordinator: give one of them (MURMURATION_COORDINATOR and MURMURATION_ACCESS count too)"
    )]
    TwoCoordinators,
    /// The access file cannot be used.
    #[error(transparent)]
    AccessFile(#[from] AccessFileError),
    /// The environment variable does not hold a token.
    #[error("{TOKEN}: {0}")]
    TokenVariable(TokenError),
    #[error("\"{0}\" is not a coordinator's URL (such as http://127.0.0.1:7700)")]
    Url(String),
    /// The URL has a path, as of a proxy that serves pages.
    #[error(
        "\"{0}\" has a path, for which calls of a coordinator have no place: name the coordinator itself (such as \
         http://127.0.0.1:7700), or its access file with --access FILE"
    )]
    UrlPath(String),
    /// No authority is given for the coordinator's certificate.
    #[error(
        "{0} is encrypted: name the coordinator's access file with --access FILE instead of its URL, or the certificate of \
         the authority that signed the coordinator's certificate with --ca FILE"
    )]
    NoAuthority(String),
    /// A certificate is given for an unencrypted connection, which would not use it.
    #[error("{0} is not encrypted, and takes no certificate: use https://, or omit --certificate")]
    Plain(String),
    /// Certificate, key or authority cannot be used.
    #[error("the certificates for {url} cannot be used: {reason}")]
    Unusable {
        url: String,
        /// The TLS library's error.
        reason: String,
    },
}

/// A value that `Debug` does not show.
#[derive(Clone)]
struct Secret<T>(T);

impl<T> std::fmt::Debug for Secret<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("hidden")
    }
}

impl Credentials {
    /// Reads the named files, and the variable `MURMURATION_TOKEN` if no token file is named.
    ///
    /// # Errors
    /// The error names the file or variable that cannot be used, but never quotes its contents.
    pub fn read(trust: &TrustFiles, identity: &IdentityFiles) -> Result<Self, CredentialsError> {
        let ca = trust.ca.as_deref().map(|path| read_pem(path, "certificate"));
        let identity = match (&identity.certificate, &identity.key) {
            (Some(certificate), Some(key)) => {
                let (certificate, key) = (
                    read_pem(certificate, "certificate")?,
                    read_pem(key, "private key")?,
                );
                Some(Secret(Identity::from_pem(certificate, key)))
            }
            _ => None,
        };
        Ok(Self {
            ca: ca.transpose()?.map(Certificate::from_pem),
            identity,
            token: match &trust.token_file {
                Some(path) => Some(read_token(path)?),
                None => token_of_environment()?,
            },
            pinned: None,
        })
    }

    /// Reads the files that add to an access file. A token in the environment is for coordinators that the user names by their URL.
    ///
    /// # Errors
    /// The errors of [`Credentials::read`].
    pub fn beside_access_file(
        trust: &TrustFiles,
        identity: &IdentityFiles,
    ) -> Result<Self, CredentialsError> {
        let mut read = Self::read(trust, identity)?;
        if trust.token_file.is_none() {
            read.token = None;
        }
        Ok(read)
    }

    /// These credentials, completed by the token and the certificate of an access file.
    #[must_use]
    pub fn with(mut self, access: AccessFile) -> Self {
        self.token = self.token.or(access.token);
        if self.ca.is_none() {
            self.pinned = access.fingerprint;
        }
        self
    }

    /// Credentials that consist of a token only, for processes on the coordinator's own machine.
    #[must_use]
    pub fn token(token: Token) -> Self {
        Self {
            token: Some(token),
            ..Self::default()
        }
    }

    /// The coordinator at `url` (`http://HOST:PORT` or `https://HOST:PORT`), not yet connected.
    ///
    /// # Errors
    /// Fails if `url` is not valid, or these credentials do not fit it.
    pub fn endpoint(&self, url: &str) -> Result<Endpoint, CredentialsError> {
        let shown = || masked_url(url);
        let no_url = || CredentialsError::Url(shown());
        let endpoint = Endpoint::from_shared(url.to_owned()).map_err(|_| no_url())?;
        if endpoint.uri().path_and_query().is_some_and(|path| path != "/") {
            return Err(CredentialsError::UrlPath(shown()));
        }
        match endpoint.uri().scheme_str() {
            Some("http") if self.identity.is_some() => Err(CredentialsError::Plain(shown())),
            Some("http") => Ok(endpoint),
            Some("https") => {
                let tls = match &self.identity {
                    Some(Secret(identity)) => ClientTlsConfig::new().identity(identity.clone()),
                    None => ClientTlsConfig::new(),
                };
                let configured = match (self.pinned, &self.ca) {
                    (Some(pinned), _) => {
                        endpoint.tls_config_with_verifier(tls, Arc::new(PinnedCertificate::new(pinned)))
                    }
                    (None, Some(ca)) => endpoint.tls_config(tls.ca_certificate(ca.clone())),
                    (None, None) => return Err(CredentialsError::NoAuthority(shown())),
                };
                configured.map_err(|error| CredentialsError::Unusable {
                    url: shown(),
                    reason: root_cause(&error),
                })
            }
            _ => Err(no_url()),
        }
    }

    /// The interceptor that adds the token, if any, to every request.
    #[must_use]
    pub fn bearer(&self) -> Bearer {
        // All characters of a token are allowed in a header.
        let header = self.token.as_ref().and_then(|token| {
            let mut value = MetadataValue::try_from(format!("Bearer {}", token.reveal())).ok()?;
            value.set_sensitive(true);
            Some(value)
        });
        Bearer { header }
    }
}

/// Adds `authorization: Bearer TOKEN` to requests, if there is a token.
#[derive(Debug, Clone)]
pub struct Bearer {
    header: Option<MetadataValue<Ascii>>,
}

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(header) = &self.header {
            request.metadata_mut().insert("authorization", header.clone());
        }
        Ok(request)
    }
}

/// The token in a file, without surrounding spaces and line ends.
///
/// # Errors
/// Fails if the file cannot be read, or does not contain a token.
pub fn read_token(path: &Path) -> Result<Token, CredentialsError> {
    let text = read_text(path, InputKind::Token).map_err(|source| CredentialsError::File {
        path: path.to_owned(),
        source,
    })?;
    text.trim().parse().map_err(|error| CredentialsError::TokenFile {
        path: path.to_owned(),
        error,
    })
}

/// The text of a PEM file that contains a "certificate" or a "private key".
///
/// # Errors
/// Fails if the file cannot be read, or does not contain the certificate or key.
pub fn read_pem(path: &Path, what: &'static str) -> Result<String, CredentialsError> {
    let text = read_text(path, InputKind::Pem).map_err(|source| CredentialsError::File {
        path: path.to_owned(),
        source,
    })?;
    // The line is "BEGIN CERTIFICATE" or "BEGIN PRIVATE KEY", with or without an algorithm's name.
    let marker = what.to_uppercase();
    let holds = |line: &str| line.starts_with("-----BEGIN ") && line.contains(&marker);
    match text.lines().any(holds) {
        true => Ok(text),
        false => Err(CredentialsError::Pem {
            path: path.to_owned(),
            what,
        }),
    }
}

fn token_of_environment() -> Result<Option<Token>, CredentialsError> {
    let text = match env::var(TOKEN) {
        Ok(text) => text,
        Err(env::VarError::NotPresent) => return Ok(None),
        Err(env::VarError::NotUnicode(_)) => return Err(CredentialsError::TokenVariable(TokenError::Token)),
    };
    match text.trim() {
        // Compose files and service managers set unset variables to the empty string.
        "" => Ok(None),
        text => text.parse().map(Some).map_err(CredentialsError::TokenVariable),
    }
}

/// Text of an error's root cause. The text of a transport error itself does not contain the cause.
#[must_use]
pub fn root_cause(error: &(dyn std::error::Error + 'static)) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.last().map_or_else(String::new, ToString::to_string)
}

#[cfg(test)]
mod tests;
