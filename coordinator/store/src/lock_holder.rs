//! Who holds a data directory, as its lock says.

use std::fmt;

/// Who holds a data directory.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct LockHolder {
    /// Its process id; 0 if it has not said yet.
    pub process: u32,
    /// Where its coordinator listens, `http://HOST:PORT`; empty if it has not said yet.
    pub address: String,
}

impl fmt::Display for LockHolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.process, self.address.as_str()) {
            (0, _) => write!(f, "another murmuration process"),
            (process, "") => write!(f, "process {process}"),
            (process, address) => write!(f, "process {process} at {address}"),
        }
    }
}
