//! The certificate with which a coordinator encrypts its connections.

use crate::limits::HANDSHAKE_LIMIT;
use murmuration_link::{CredentialsError, Fingerprint, read_pem, root_cause};
use murmuration_store::StoreError;
use rustls_pki_types::{CertificateDer, pem::PemObject as _};
use std::path::{Path, PathBuf};
use tonic::transport::{Certificate, Identity, Server, ServerTlsConfig};

/// The certificate of the coordinator, and the authority that signs the certificates of machines.
#[derive(Debug, Clone)]
pub struct Tls {
    config: ServerTlsConfig,
    fingerprint: Fingerprint,
    /// Whether machines must have a certificate of an authority.
    client_ca: bool,
    /// The name in a certificate that the coordinator made for itself.
    own_name: Option<&'static str>,
}

/// Why a certificate cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] CredentialsError),
    /// The file of the coordinator's own certificate cannot be used.
    #[error(transparent)]
    SelfSigned(#[from] StoreError),
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
    pub fn read(certificate: &Path, key: &Path, client_ca: Option<&Path>) -> Result<Self, TlsError> {
        let ca = client_ca.map(|path| read_pem(path, "certificate")).transpose()?;
        let (chain, key) = (
            read_pem(certificate, "certificate")?,
            read_pem(key, "private key")?,
        );
        Self::of(certificate, &chain, &key, ca.as_deref())
    }

    /// `path` is the file of the certificate, for errors.
    pub(crate) fn of(
        path: &Path,
        certificate: &str,
        key: &str,
        client_ca: Option<&str>,
    ) -> Result<Self, TlsError> {
        let unusable = |reason| TlsError::Unusable {
            path: path.to_owned(),
            reason,
        };
        let first = CertificateDer::from_pem_slice(certificate.as_bytes());
        let first = first.map_err(|error| unusable(error.to_string()))?;
        let mut config = ServerTlsConfig::new()
            .identity(Identity::from_pem(certificate, key))
            .timeout(HANDSHAKE_LIMIT);
        if let Some(ca) = client_ca {
            config = config
                .client_ca_root(Certificate::from_pem(ca))
                .client_auth_optional(true);
        }
        // The configuration is checked now, not at the first connection.
        let checked = Server::builder().tls_config(config.clone());
        checked.map_err(|error| unusable(root_cause(&error)))?;
        Ok(Self {
            config,
            fingerprint: Fingerprint::of(&first),
            client_ca: client_ca.is_some(),
            own_name: None,
        })
    }

    /// This certificate, which the coordinator made for itself with this `name`.
    pub(crate) const fn made_with(mut self, name: &'static str) -> Self {
        self.own_name = Some(name);
        self
    }

    /// The name in a certificate that the coordinator made for itself; `None` for a certificate of an authority.
    pub fn own_name(&self) -> Option<String> {
        self.own_name.map(str::to_owned)
    }

    /// Whether machines must have a certificate of an authority.
    pub(crate) const fn has_client_ca(&self) -> bool {
        self.client_ca
    }

    /// The fingerprint of the coordinator's certificate.
    pub const fn fingerprint(&self) -> Fingerprint {
        self.fingerprint
    }

    /// The configuration of a listener.
    pub fn config(&self) -> ServerTlsConfig {
        self.config.clone()
    }
}
