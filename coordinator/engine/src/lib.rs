//! Campaigns at work: the stages that they go through, what to ask people next, maps of archives, what in them is
//! like a behaviour from elsewhere, and the synthetic annotator.
//!
//! Limits: knows neither the network nor HTML.

pub mod campaign;
pub mod maps;
mod messages;
pub mod nearest;
pub mod queries;
pub mod space;
pub mod synthetic;
pub mod taxonomy;

pub use murmuration_store::blocking;

/// A swarm that never moved.
#[cfg(test)]
fn still(index: u64, generation: u32) -> murmuration_store::ArchivedIndividual {
    use murmuration_proto::{Controller, Preset};
    let controller = Controller::new(Preset::SingleSensor, &[0.0; 4]).unwrap();
    murmuration_store::ArchivedIndividual::unmeasured(index, generation, controller)
}
