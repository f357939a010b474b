//! Why an archive cannot be measured.

use murmuration_proto::Invalid;
use murmuration_search::{interrupt::Interrupted, novelty::Misfit};

/// Why behaviours cannot be counted.
#[derive(Debug, thiserror::Error)]
pub enum BehavioursError {
    /// The archive holds vectors that cannot be compared.
    #[error("the archive holds vectors that cannot be compared: {0}")]
    Misfit(#[from] Misfit),
    /// The figures are not wanted any more.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
    /// A swarm cannot be simulated again.
    #[error("individual {index} cannot be simulated: {error}")]
    Simulation {
        /// Its index.
        index: u64,
        /// What is wrong.
        error: Invalid,
    },
    /// The archive is empty.
    #[error("the archive is empty")]
    Empty,
}
