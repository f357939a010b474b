//! The test harness: a whole cluster in one process on ephemeral loopback ports, and the real binaries for tests that kill
//! processes. Functions of the harness panic on errors.

mod bound_folder;
mod built;
mod cluster;
mod fake_worker;
mod faulty_libc;
pub mod fuzz_targets;
mod harness;
pub mod http;
mod murmuration;
pub mod pages;
mod process;
mod process_cluster;
pub mod requirements;
pub mod schemas;
mod small_disk;

pub use bound_folder::BoundFolder;
pub use built::binary;
pub use cluster::{Cluster, longer_spec, quick_dispatch, small_latent_spec, small_spec};
pub use fake_worker::FakeWorker;
pub use faulty_libc::FaultyLibc;
pub use harness::{Test, block_on, run, run_one_by_one};
pub use http::page;
pub use murmuration::{Finished, Murmuration, start_trainer, start_worker, start_worker_with, whole_number};
pub use process::{PATIENCE, Running};
pub use process_cluster::{Environment, OVER_TOO_EARLY, ProcessClient, ProcessCluster};
pub use requirements::Requirement;
pub use small_disk::SmallDisk;
