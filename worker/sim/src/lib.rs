//! Evaluation as pure functions: (controller, world, seed) -> evaluation. This crate does no I/O and reads no clock.
//!
//! The tests in `tests` step whole swarms. Unit tests beside the code do not step whole swarms, so that their build need not
//! compile the kernels for every instruction set again.

pub mod case;
pub mod evaluate;
pub mod features;
mod lanes;
pub mod moments;
pub mod rasterise;
pub mod replay;
pub mod simulate;
