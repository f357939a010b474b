//! The contract: messages, services, and the validated vocabulary built on them.
//!
//! [`v1`] has the messages on the wire, which may hold any values. The rest of the project uses the validated types of this
//! crate. They can be constructed only through `TryFrom<message>`, or a constructor with the same checks, so no invalid value
//! exists behind the edge.
//!
//! Depends on no other crate of the workspace.

mod behaviour_space;
mod campaign_spec;
mod checkpoint;
mod choice;
pub mod codec;
mod counted;
mod dataset;
mod embedder;
mod enumeration;
mod evaluation;
mod feedback;
mod field_lines;
mod field_names;
mod image_format;
mod invalid;
mod method;
pub mod onnx;
pub mod parts;
mod picture_shape;
mod random;
mod record;
mod replay;
mod robot;
mod search;
mod seen;
mod space;
pub mod spec_sections;
mod starts;
mod status;
pub mod text;
mod toml_file;
mod toml_names;
pub mod training;
mod verdict;
mod wire;
mod world;

pub use behaviour_space::{BehaviourSpace, Scale};
pub use campaign_spec::{CampaignName, CampaignSpec, SpecFileError};
pub use checkpoint::{CheckpointDigest, Lineage, PART_BYTES};
pub use choice::Choice;
pub use counted::{counted, figure, grouped, in_full, noun, rounded};
pub use dataset::Dataset;
pub use embedder::EmbedderSource;
pub use enumeration::Enumeration;
pub use evaluation::{
    EmbeddingKind, Evaluation, Extras, FEATURE_NAMES, Features, MAX_EMBEDDING, MAX_FEATURE, check_embedding,
    embeddings_agree, mean_embedding, mean_features,
};
pub use feedback::{Feedback, Strategy};
pub use field_lines::line_of_field;
pub use image_format::ImageFormat;
pub use invalid::Invalid;
pub use method::Method;
pub use picture_shape::PictureShape;
pub use random::{Purpose, RandomStream, start_seed};
pub use replay::{Frames, Pose, Replay};
pub use robot::{
    Boundary, CapabilityModel, Controller, Drive, DriveKind, Preset, Robot, RobotController, Seen,
    SeenRobots, Sensor, SensorAngle, SensorDescription, Species, SpeciesName,
};
pub use search::Search;
pub use seen::SeenPictures;
pub use space::{ControllerSpace, GeneSpace};
pub use starts::Starts;
pub use text::Text;
pub use toml_file::{TomlError, read_toml};
pub use toml_names::{of_toml_line, to_differing_line};
pub use verdict::{Class, Pattern, Verdict};
pub use world::{Noise, Obstacle, StartShape, World};

use std::fmt;

/// The generated messages and services of the package `murmuration.v1`.
#[allow(clippy::all)]
pub mod v1 {
    tonic::include_proto!("murmuration.v1");
}

/// The package's file descriptors (an encoded `FileDescriptorSet`), for the reflection service.
pub const FILE_DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/descriptors.bin"));

/// Version of the function (controller, world, seed) -> evaluation.
///
/// It changes whenever a bit of any evaluation changes. Coordinator and workers must have the same version.
pub const SIMULATOR_VERSION: &str = "1";

/// Version of the function (pictures, training configuration) -> checkpoint.
///
/// It changes whenever a bit of any checkpoint changes. Coordinator and trainers must have the same version.
pub const TRAINER_VERSION: &str = "7";

/// The header with a request's id, in requests and answers, in gRPC and plain HTTP.
///
/// The client may choose the id. A worker or trainer that makes a request for a lease uses the lease's id.
pub const REQUEST_ID: &str = "x-request-id";

/// `EPOCH-NUMBER`.
impl fmt::Display for v1::LeaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.epoch, self.number)
    }
}
