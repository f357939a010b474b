//! The single-node harness: a whole cluster in one process on ephemeral loopback ports, and the real binaries
//! for what must survive the death of a process. For tests: whatever goes wrong here is a panic.
#![deny(missing_docs)]

mod binaries;
mod cluster;
mod impostor;

pub use binaries::{Finished, Murmuration, Running, binary};
pub use cluster::{Cluster, quick_dispatch, small_latent_spec, small_spec};
pub use impostor::Impostor;
