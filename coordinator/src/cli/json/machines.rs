//! Machines, and what people and machines show to a coordinator.

use murmuration_model::MachineId;
use schemars::JsonSchema;
use serde::Serialize;

/// The machines in quarantine.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Quarantine {
    /// In the order in which they were quarantined.
    pub(in crate::cli) machines: Vec<QuarantinedMachine>,
}

/// A machine in quarantine.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(in crate::cli) struct QuarantinedMachine {
    /// Its id, for --lift.
    machine: String,
    /// Its name.
    name: String,
}

/// The machine that left quarantine.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct LiftedQuarantine {
    /// Its id.
    pub(in crate::cli) lifted: String,
}

/// A new token.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Token {
    /// Whom it is for.
    pub(in crate::cli) name: String,
    /// `viewer`, `annotator` or `operator`.
    pub(in crate::cli) role: String,
    /// The secret itself.
    pub(in crate::cli) token: String,
    /// What the tokens file holds in place of the secret.
    pub(in crate::cli) digest: String,
}

/// New certificates.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Certificates {
    /// Days for which they are valid.
    pub(in crate::cli) days: u32,
    pub(in crate::cli) certificates: Vec<Certificate>,
}

/// A new certificate.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
pub(in crate::cli) struct Certificate {
    /// Its name: `ca`, `server`, `trainer`, or the name of a worker.
    pub(in crate::cli) name: String,
    /// Path of the certificate.
    pub(in crate::cli) certificate: String,
    /// Path of its key.
    pub(in crate::cli) key: String,
}

impl QuarantinedMachine {
    pub(in crate::cli) fn new(machine: MachineId, name: &str) -> Self {
        Self {
            machine: machine.to_string(),
            name: name.to_owned(),
        }
    }
}
