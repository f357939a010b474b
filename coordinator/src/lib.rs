//! The program `murmuration`: the command line, a whole coordinator, and a whole cluster in one process.
//!
//! ARCHITECTURE.md has the map of the crates that it is put together from.
#![deny(missing_docs)]

pub mod cli;
pub mod label_curve;
pub mod local;
pub mod metrics;

mod probes;
pub mod server;
