//! Evaluation as pure functions: (controller, world, seed) -> evaluation. There is no I/O and no clock.
//!
//! The tests in `tests` step whole swarms. Unit tests beside the code do not, so that their build need not compile the kernels for
//! every instruction set again.

pub mod case;
pub mod evaluate;
pub mod features;
mod lanes;
pub mod rasterise;
pub mod replay;
pub mod simulate;
