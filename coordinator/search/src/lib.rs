//! The search as pure functions: the filter of controllers, breeding, novelty, medoids of behaviours, and cells of the behaviour
//! space.
//!
//! Limits: no I/O, no state.

pub mod breeding;
pub mod filter;
pub mod interrupt;
mod lanes;
pub mod medoids;
pub mod novelty;
pub mod projection;
pub mod tessellation;
