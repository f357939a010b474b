//! Machines that run workers.

use murmuration_swarm::{EmbeddingKind, Invalid};
use std::{fmt, net::IpAddr, str::FromStr};

/// A machine that runs workers, and has one vote. The coordinator derives the machine's id from the connection
/// (`access::origin`), never from the worker's own reports.
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
    /// Name and address of the worker whose results were found wrong.
    pub name: String,
}

/// The maker of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Maker {
    /// Embedding kind of the maker's machine; unknown for a machine that does not embed.
    pub kind: EmbeddingKind,
    /// The machine, if no other machine has confirmed the result; otherwise `None`.
    pub unaudited: Option<MachineId>,
}

/// Where a worker or trainer connects from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// The machine: identified by the public key of its certificate, or else by its address.
    pub machine: MachineId,
    /// The address, for display.
    pub address: IpAddr,
}
