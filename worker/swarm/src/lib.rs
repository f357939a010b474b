//! Validated types: robots, worlds, controllers, campaign specifications, trainings, random streams.
//!
//! Messages of the contract ([`murmuration_proto::v1`]) can hold invalid values; the types here cannot, and the rest of the
//! project works with these types. Values are constructed only by `TryFrom<message>`, or by a constructor with the same checks.

mod behaviour_space;
mod campaign_spec;
mod checkpoint;
mod choice;
mod compressed_image;
mod counted;
mod dataset;
mod embedder;
mod enumeration;
mod evaluation;
mod feedback;
mod field_lines;
mod image_format;
mod invalid;
mod method;
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
mod toml_line;
pub mod training;
mod verdict;
mod world;

pub use behaviour_space::{BehaviourSpace, Scale};
pub use campaign_spec::{Begun, CampaignName, CampaignSpec, SpecFileError};
pub use checkpoint::{CheckpointDigest, Lineage};
pub use choice::Choice;
pub use compressed_image::{CompressedImage, Compressor, Decompressor, NoImage};
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
pub use toml_line::{of_toml_line, to_differing_line};
pub use verdict::{Class, Pattern, Verdict};
pub use world::{Noise, Obstacle, StartShape, World};
