//! The server: a whole coordinator, or a whole cluster in one process.
//!
//! ARCHITECTURE.md has the map of its crates.

pub mod local;
pub mod metrics;

mod probes;
pub mod server;
