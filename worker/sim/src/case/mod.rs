//! Cases: a simulation as a JSON object, to compare this simulator with others number by number.
//!
//! A case names a controller, a world and a start (`model`, `controller`, `initial`, `agents`, `agent_radius`, `wheel_radius`,
//! `dt`, `world`, `padding`, `steps`, `jitter`) and the outcome of simulating them (`checkpoints`, `features`, `image`,
//! `image_raw`, `jitter_events`, `reference`). Running a case replaces the outcome with this simulator's outcome, and changes
//! nothing else.
//!
//! In a case of described robots, `species` replaces `model`, `controller`, `agent_radius` and `wheel_radius`. Each species has
//! `name`, `count`, `radius`, `drive`, `sensors` and `controller`. `walls` is true if the world has walls.

mod keys;
mod outcome;
mod read;
mod species;

use crate::{
    replay::replay,
    simulate::{Start, Swarm},
};
use murmuration_swarm::{Controller, ImageFormat, Invalid, Replay, World};
use serde_json::{Map, Value};
use std::num::NonZeroU32;

/// A case that can be simulated.
#[derive(Debug, Clone)]
pub struct Case {
    document: Map<String, Value>,
    controller: Controller,
    world: World,
    image: ImageFormat,
    start: Start,
    /// Steps to report, as written in the case and as numbers.
    checkpoints: Vec<(String, u32)>,
}

/// Why a text is not a case.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The text is not JSON.
    #[error("not JSON: {0}")]
    Syntax(#[from] serde_json::Error),
    /// A key is missing, or its value cannot be simulated.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

impl Case {
    /// Reads a case.
    ///
    /// A case must have `initial`, and either `controller` or `species`. The defaults of other keys are the paper's values.
    /// `initial` determines the number of agents, and the number of genes determines the model.
    ///
    /// # Errors
    /// The error names the place where the text is not JSON, or the key whose value cannot be simulated.
    pub fn from_json(text: &str) -> Result<Self, CaseError> {
        let document: Value = serde_json::from_str(text)?;
        Ok(read::case(document)?)
    }

    /// The steps at which agents are reported, in the case's own order.
    pub fn checkpoints(&self) -> impl Iterator<Item = u32> {
        self.checkpoints.iter().map(|&(_, step)| step)
    }

    /// Simulates the case. Returns the case's object with this simulator's values. The object's keys keep their order, and
    /// missing keys are added at the end.
    ///
    /// # Errors
    /// Fails if a resulting number is not finite.
    pub fn run(&self) -> Result<Value, CaseError> {
        Ok(outcome::of(self)?)
    }

    #[must_use]
    pub const fn world(&self) -> &World {
        &self.world
    }

    #[must_use]
    pub const fn controller(&self) -> &Controller {
        &self.controller
    }

    /// The motion of the case: its start, every `stride`-th step, and the end.
    ///
    /// # Errors
    /// The errors of [`replay`](crate::replay::replay()).
    pub fn replay(&self, stride: NonZeroU32) -> Result<Replay, Invalid> {
        replay(&self.controller, &self.world, &self.start, stride)
    }

    /// The swarm at its start.
    ///
    /// # Errors
    /// Fails if the start does not fit the world.
    pub fn swarm(&self) -> Result<Swarm, Invalid> {
        Swarm::new(&self.controller, &self.world, &self.start)
    }
}
