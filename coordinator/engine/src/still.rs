//! Individuals for tests.

use murmuration_proto::{Controller, Preset};
use murmuration_store::ArchivedIndividual;

/// A swarm that never moved.
pub fn still(index: u64, generation: u32) -> ArchivedIndividual {
    let controller = Controller::new(Preset::SingleSensor, &[0.0; 4]).unwrap();
    ArchivedIndividual::unmeasured(index, generation, controller)
}
