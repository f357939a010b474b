//! Machines that run workers, and what is known of them.

use murmuration_proto::{EmbeddingKind, Invalid};
use std::{fmt, net::IpAddr, str::FromStr};

/// A machine that runs workers: what has one vote. The coordinator derives it from what a connection shows
/// (`access::origin`), never from what a worker says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MachineId(pub u64);

impl fmt::Display for MachineId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl FromStr for MachineId {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let is_one = text.len() == 16 && text.bytes().all(|letter| letter.is_ascii_hexdigit());
        let number = u64::from_str_radix(text, 16).ok().filter(|_| is_one);
        number
            .map(Self)
            .ok_or_else(|| Invalid::new("machine", text, "16 hexadecimal digits"))
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quarantined {
    pub machine: MachineId,
    /// Name and address of the worker that gave it away.
    pub name: String,
}

/// The maker of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Maker {
    /// How its machine embeds; unknown for one that does not.
    pub kind: EmbeddingKind,
    /// Its machine, where that alone says so; `None` where another machine found the same.
    pub unaudited: Option<MachineId>,
}

/// Where a worker or trainer connects from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// Its machine: whoever shows a certificate is known by its public key, others by their address.
    pub machine: MachineId,
    /// Its address, for people.
    pub address: IpAddr,
}
