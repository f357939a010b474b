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

#[cfg(test)]
mod still;
