//! The network side of training. [`client`] leases trainings from a coordinator, runs them (`murmuration-train`), and publishes
//! the resulting checkpoints.

pub mod client;
mod publication;
