//! The worker: a pure function, (controller, world, seed, checkpoint) -> evaluation, and a client that runs it for a
//! coordinator.
#![deny(missing_docs)]

pub mod case;
pub mod client;
pub mod evaluate;
pub mod features;
mod lanes;
#[cfg(test)]
mod proptest_cases;
pub mod rasterise;
pub mod replay;
pub mod simulate;
