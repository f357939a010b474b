//! Individuals for tests.

use murmuration_proto::{CapabilityModel, Controller};
use murmuration_store::ArchivedIndividual;

/// A swarm that never moved.
pub fn still(index: u64, generation: u32) -> ArchivedIndividual {
    ArchivedIndividual {
        index,
        generation,
        controller: Controller::new(CapabilityModel::SingleSensor, &[0.0; 4]).unwrap(),
        seed: 0,
        features: [0.0; 5],
        embedding: Vec::new(),
        novelty: 0.0,
        image: None,
    }
}
