//! Cases: one simulation as a JSON object, to compare this simulator with others number by number.
//!
//! A case names a controller, a world and a start (`model`, `controller`, `initial`, `agents`, `agent_radius`,
//! `wheel_radius`, `dt`, `world`, `padding`, `steps`, `jitter`) and the outcome of simulating them
//! (`checkpoints`, `features`, `image`, `image_raw`, `jitter_events`, `reference`). Running a case replaces the outcome by
//! this simulator's; everything else stays as it is.

mod outcome;
mod read;
#[cfg(test)]
mod tests;

use crate::simulate::Start;
use murmuration_proto::{Controller, ImageFormat, Invalid, World};
use serde_json::{Map, Value};

/// A case that can be simulated.
#[derive(Debug, Clone)]
pub struct Case {
    document: Map<String, Value>,
    controller: Controller,
    world: World,
    image: ImageFormat,
    start: Start,
    /// Steps to report, as spelled in the case and as numbers.
    checkpoints: Vec<(String, u32)>,
}

/// Why a text is not a case.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// It is not JSON.
    #[error("not JSON: {0}")]
    Syntax(#[from] serde_json::Error),
    /// A key is missing, or its value cannot be simulated.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

impl Case {
    /// Reads a case.
    ///
    /// `controller` and `initial` are required. Other missing keys take the paper's values. `initial` determines the number
    /// of agents, and the number of genes determines the model.
    ///
    /// # Errors
    /// Says where the text is not JSON, or which key has a value that cannot be simulated.
    pub fn from_json(text: &str) -> Result<Self, CaseError> {
        let document: Value = serde_json::from_str(text)?;
        Ok(read::case(document)?)
    }

    /// The steps at which agents are reported, in the case's own order.
    pub fn checkpoints(&self) -> impl Iterator<Item = u32> {
        self.checkpoints.iter().map(|&(_, step)| step)
    }

    /// Simulates the case. Returns the same object with this simulator's values, in the same order, and missing keys at the
    /// end.
    ///
    /// # Errors
    /// If a resulting number is not finite.
    pub fn run(&self) -> Result<Value, CaseError> {
        Ok(outcome::of(self)?)
    }
}
