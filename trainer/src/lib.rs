//! The trainer: will learn embedders from trajectory images and publish them as checkpoints.
//!
//! So far it is a service that answers health checks and leases no jobs.
#![deny(missing_docs)]
