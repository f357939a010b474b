//! An answer that stands.

use super::{Annotator, Answer};

/// An answer, as the log of today has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// Its entry in the log.
    pub entry: u64,
    /// Index of the individual.
    pub index: u64,
    /// Who answered.
    pub annotator: Annotator,
    /// The answer, its class by its name of today.
    pub answer: Answer,
    /// When, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
}
