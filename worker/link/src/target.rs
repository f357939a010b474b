//! Where a coordinator is, as the user of a program says it.

use crate::{AccessFile, Credentials, CredentialsError, IdentityFiles, TrustFiles};
use murmuration_swarm::text::masked_url;
use std::{
    env,
    ffi::OsStr,
    fmt,
    path::{Path, PathBuf},
};

/// A coordinator: its URL, or the access file that has its URL at any time.
#[derive(Debug, Clone)]
pub enum Target {
    Url {
        /// `http://HOST:PORT` or `https://HOST:PORT`.
        url: String,
        credentials: Credentials,
    },
    AccessFile {
        path: PathBuf,
        /// Credentials in addition to the file's.
        credentials: Credentials,
    },
}

impl Target {
    /// The coordinator that a user names by its URL (`--coordinator`) or by its access file (`--access`); `None` if by neither. An
    /// option counts more than a variable of the environment.
    ///
    /// # Errors
    /// If both are options or both are variables, or a file of `trust` or `identity` cannot be read.
    pub fn named(
        url: Option<&str>,
        trust: &TrustFiles,
        identity: &IdentityFiles,
    ) -> Result<Option<Self>, CredentialsError> {
        let is_variable = |name: &str, value: &OsStr| env::var_os(name).is_some_and(|set| set == value);
        let (url, path) = match (url, &trust.access) {
            (Some(given), Some(path)) => {
                let url_is_variable = is_variable("MURMURATION_COORDINATOR", given.as_ref());
                match (
                    url_is_variable,
                    is_variable("MURMURATION_ACCESS", path.as_os_str()),
                ) {
                    (true, false) => (None, Some(path)),
                    (false, true) => (Some(given), None),
                    _ => return Err(CredentialsError::TwoCoordinators),
                }
            }
            (url, path) => (url, path.as_ref()),
        };
        Ok(match (url, path) {
            (Some(url), _) => Some(Self::Url {
                url: url.to_owned(),
                credentials: Credentials::read(trust, identity)?,
            }),
            (None, Some(path)) => Some(Self::AccessFile {
                path: path.clone(),
                credentials: Credentials::beside_access_file(trust, identity)?,
            }),
            (None, None) => None,
        })
    }

    /// The coordinator at `url`, which requires no credentials.
    #[must_use]
    pub fn open(url: &str) -> Self {
        Self::Url {
            url: url.to_owned(),
            credentials: Credentials::default(),
        }
    }

    /// The URL and the credentials for it, as they are now.
    ///
    /// # Errors
    /// If the access file cannot be read.
    pub fn look_up(&self) -> Result<(String, Credentials), CredentialsError> {
        match self {
            Self::Url { url, credentials } => Ok((url.clone(), credentials.clone())),
            Self::AccessFile { path, credentials } => {
                let access = AccessFile::read(path)?;
                Ok((access.coordinator.clone(), credentials.clone().with(access)))
            }
        }
    }

    /// Whether a later look-up may find another coordinator or other credentials.
    pub(crate) const fn may_change(&self) -> bool {
        matches!(self, Self::AccessFile { .. })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Url { url, .. } => f.write_str(&masked_url(url)),
            Self::AccessFile { path, .. } => write!(f, "the coordinator of {}", path.display()),
        }
    }
}

/// The access file of a data directory.
#[must_use]
pub fn access_file_of(data: &Path) -> PathBuf {
    data.join(AccessFile::NAME)
}
