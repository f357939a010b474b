//! A pure function with a network face: (controller, world, seed, checkpoint) -> evaluation.
#![deny(missing_docs)]

pub mod case;
pub mod client;
pub mod evaluate;
pub mod features;
pub mod rasterise;
pub mod replay;
pub mod simulate;
