//! The server: a whole coordinator, and a whole cluster in one process.
//!
//! ARCHITECTURE.md has the map of the crates that it is put together from.

pub mod local;
pub mod metrics;

mod probes;
pub mod server;
