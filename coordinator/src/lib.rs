//! Campaigns: the search, its archive and taxonomy, the leases that farm it out, and the command line.
//!
//! ARCHITECTURE.md has the map. Knows `proto`, and `worker` only to start workers in-process and for the
//! `simulate` command.
#![deny(missing_docs)]

pub mod cli;
pub mod label_curve;
pub mod local;
pub mod metrics;

mod probes;
pub mod server;
