//! The search as pure functions: which controllers pass the filter, how the next ones are bred, how novel a behaviour is,
//! which behaviours stand for all, and in which cells of the behaviour space they lie.
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
