//! The search as pure functions: which controllers pass the filter, how the next ones are bred, how novel a behaviour is,
//! and which behaviours stand for all.
//!
//! Limits: no I/O, no state.

pub mod breeding;
pub mod filter;
pub mod interrupt;
mod lanes;
pub mod medoids;
pub mod novelty;
pub mod projection;
