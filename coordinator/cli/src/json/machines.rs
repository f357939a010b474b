//! Documents about machines, and about credentials for a coordinator.

use murmuration_model::MachineId;
use schemars::JsonSchema;
use serde::Serialize;

/// The machines in quarantine.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Quarantine {
    /// The machines, in the order in which they were quarantined.
    pub(crate) machines: Vec<QuarantinedMachine>,
}

/// A machine in quarantine.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(crate) struct QuarantinedMachine {
    /// Id of the machine, for --lift.
    machine: String,
    /// Name of the machine.
    name: String,
}

/// The machine that left quarantine.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct LiftedQuarantine {
    /// Id of the machine.
    pub(crate) lifted: String,
}

/// A link to the pages of a coordinator.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Link {
    /// Address for a browser. It works once if the coordinator requires tokens.
    pub(crate) link: String,
}

/// A new token.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Token {
    /// Name of the token's holder.
    pub(crate) name: String,
    /// `viewer`, `annotator` or `operator`.
    pub(crate) role: String,
    /// The secret of the token.
    pub(crate) token: String,
    /// Digest of the secret, which the tokens file contains.
    pub(crate) digest: String,
}

/// New certificates.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Certificates {
    /// Days for which the certificates are valid.
    pub(crate) days: u32,
    pub(crate) certificates: Vec<Certificate>,
}

/// A new certificate.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(crate) struct Certificate {
    /// Name of the certificate: `ca`, `server`, `trainer`, or the name of a worker.
    pub(crate) name: String,
    /// Path of the certificate.
    pub(crate) certificate: String,
    /// Path of the certificate's key.
    pub(crate) key: String,
}

impl QuarantinedMachine {
    pub(crate) fn new(machine: MachineId, name: &str) -> Self {
        Self {
            machine: machine.to_string(),
            name: name.to_owned(),
        }
    }
}
