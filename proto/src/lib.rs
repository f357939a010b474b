//! The contract: the generated messages and services, and how they are sent.
//!
//! This crate depends on no other crate of the workspace. The types that hold only valid values are in `murmuration-swarm`.

pub mod codec;
pub mod parts;
pub mod sections;
pub mod toml_forms;
pub mod wire;

pub use parts::PART_BYTES;

use std::fmt;

/// The generated messages and services of the package `murmuration.v1`.
#[allow(clippy::all)]
pub mod v1 {
    tonic::include_proto!("murmuration.v1");
}

/// The generated messages and service of KEDA's external scalers, the package `externalscaler`.
#[allow(clippy::all)]
pub mod externalscaler {
    tonic::include_proto!("externalscaler");
}

/// The package's file descriptors (an encoded `FileDescriptorSet`), for the reflection service.
pub const FILE_DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));

/// Version of the function (controller, world, seed) -> evaluation.
///
/// The version changes whenever a bit of any evaluation changes. Coordinator and workers must have the same version.
pub const SIMULATOR_VERSION: &str = "1";

/// Version of the messages between coordinator and workers: of what the contract's descriptors do not show, the forms of their
/// bytes, too.
pub const PROTOCOL_VERSION: u32 = 1;

/// Version of the function (pictures, training configuration) -> checkpoint.
///
/// The version changes whenever a bit of any checkpoint changes. Coordinator and trainers must have the same version.
pub const TRAINER_VERSION: &str = "7";

/// Name of the header with a request's id, in requests and answers of gRPC and plain HTTP.
///
/// The client can choose the id. A worker or trainer that makes a request for a lease uses the lease's id.
pub const REQUEST_ID: &str = "x-request-id";

/// `EPOCH-NUMBER`.
impl fmt::Display for v1::LeaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.epoch, self.number)
    }
}
