//! The work on campaigns: their stages, the choice of questions for annotators, maps of archives, the individuals nearest to a
//! given behaviour, and the synthetic annotator.
//!
//! Limits: this crate uses neither the network nor HTML.

pub mod campaign;
pub mod demand;
pub mod maps;
mod messages;
pub mod nearest;
pub mod queries;
pub mod space;
pub mod synthetic;
pub mod taxonomy;

pub use murmuration_store::blocking;

/// An individual whose swarm never moved.
#[cfg(test)]
fn still(index: u64, generation: u32) -> murmuration_store::ArchivedIndividual {
    use murmuration_swarm::{Controller, Preset};
    let controller = Controller::new(Preset::SingleSensor, &[0.0; 4]).unwrap();
    murmuration_store::ArchivedIndividual::unmeasured(index, generation, controller)
}
