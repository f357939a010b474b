//! The contract: messages, services, and the validated vocabulary built on them.
//!
//! [`v1`] has the messages on the wire, which may hold anything. The rest of the project works with the types beside it. They
//! can be constructed only through `TryFrom<message>`, or a constructor with the same checks, so no invalid value exists
//! behind the edge.
//!
//! Depends on no other crate of the workspace.
#![deny(missing_docs)]

mod beginning;
mod campaign_spec;
mod checkpoint;
mod counted;
mod dataset;
mod embedder;
mod enumeration;
mod evaluation;
mod feedback;
mod field_lines;
mod image_format;
mod invalid;
mod lease_id;
mod method;
pub mod near;
pub mod onnx;
pub mod parts;
mod picture_shape;
mod random;
mod record;
mod refusal;
mod replay;
mod robot;
mod search;
mod seen;
mod space;
pub mod spec_sections;
mod starts;
pub mod text;
mod toml_errors;
mod toml_line;
mod toml_names;
pub mod training;
mod verdict;
mod world;

pub use campaign_spec::{CampaignName, CampaignSpec, SpecFileError};
pub use checkpoint::{CheckpointDigest, Lineage, PART_BYTES};
pub use counted::{counted, figure, grouped, noun};
pub use dataset::Dataset;
pub use embedder::EmbedderSource;
pub use enumeration::Enumeration;
pub use evaluation::{
    EmbeddingKind, Evaluation, Extras, FEATURE_NAMES, Features, MAX_FEATURE, check_embedding,
    embeddings_agree, mean_embedding, mean_features,
};
pub use feedback::{Feedback, Strategy};
pub use field_lines::line_of_field;
pub use image_format::ImageFormat;
pub use invalid::Invalid;
pub use lease_id::REQUEST_ID;
pub use method::Method;
pub use picture_shape::PictureShape;
pub use random::{Purpose, RandomStream};
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
pub use toml_errors::{TomlError, read_toml};
pub use toml_line::{of_toml_line, to_toml_line};
pub use verdict::{Class, Pattern, Verdict};
pub use world::{Noise, Obstacle, StartShape, World};

/// The generated messages and services of the package `murmuration.v1`.
#[allow(missing_docs, clippy::all)]
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
pub const TRAINER_VERSION: &str = "6";
