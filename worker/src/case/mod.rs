//! Cases: one simulation as a JSON object, to compare this simulator with others number by number.
//!
//! A case names a controller, a world and a start (`model`, `controller`, `initial`, `agents`, `agent_radius`,
//! `wheel_radius`, `dt`, `world`, `padding`, `steps`, `jitter`) and the outcome of simulating them
//! (`checkpoints`, `features`, `image`, `image_raw`, `jitter_events`, `reference`). Running it puts this
//! simulator's outcome in the place of whatever was there; all else is passed on as it is.

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
    /// Steps to report, as the case spells them and as numbers.
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
    /// `controller` and `initial` must be there. What else is missing has the paper's value; there are as many
    /// agents as poses in `initial`, and the model follows from the number of genes.
    ///
    /// # Errors
    /// Says where the text is not JSON, or which key holds what cannot be simulated.
    pub fn from_json(text: &str) -> Result<Self, CaseError> {
        let document: Value = serde_json::from_str(text)?;
        Ok(read::case(document)?)
    }

    /// The steps at which agents are reported, in the case's own order.
    pub fn checkpoints(&self) -> impl Iterator<Item = u32> {
        self.checkpoints.iter().map(|&(_, step)| step)
    }

    /// Simulates the case: the same object with this simulator's own values, in the same order, what was missing
    /// at the end.
    ///
    /// # Errors
    /// Where a number comes out that is not finite.
    pub fn run(&self) -> Result<Value, CaseError> {
        Ok(outcome::of(self)?)
    }
}
