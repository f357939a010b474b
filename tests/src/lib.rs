//! The single-node harness: a whole cluster in one process on ephemeral loopback ports, and the real binaries
//! for what must survive the death of a process. For tests: whatever goes wrong here is a panic.
#![deny(missing_docs)]

mod binaries;
mod built;
mod cluster;
mod fake_worker;
mod faulty_libc;
pub mod fuzz_targets;
mod harness;
pub mod requirements;
mod small_disk;

pub use binaries::{Finished, Murmuration, Running};
pub use built::binary;
pub use cluster::{Cluster, longer_spec, quick_dispatch, small_latent_spec, small_spec};
pub use fake_worker::FakeWorker;
pub use faulty_libc::FaultyLibc;
pub use harness::{Test, block_on, run, run_one_by_one};
pub use requirements::Requirement;
pub use small_disk::SmallDisk;
