//! Individuals for tests.

use murmuration_proto::{CapabilityModel, Controller};
use murmuration_store::ArchivedIndividual;

/// A swarm that never moved.
pub fn still(index: u64, generation: u32) -> ArchivedIndividual {
    let controller = Controller::new(CapabilityModel::SingleSensor, &[0.0; 4]).unwrap();
    ArchivedIndividual::unmeasured(index, generation, controller)
}
