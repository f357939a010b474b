//! The types that all other parts use: campaigns and their states, machines, embedders. These types are plain values, and use no
//! disk, network or tasks.

mod archive_embedder;
mod campaign_id;
pub mod colours;
pub mod csv_file;
mod exported;
pub mod labels;
mod machine;
mod new_campaign;
mod notes;
mod record;
mod repetition;
mod scalar;
mod stage;
mod state;
pub mod study_records;
pub mod tables;
mod time_left;
mod timestamp;
mod training;
mod weight;

pub use archive_embedder::{ArchiveEmbedder, EmbedderRef};
pub use campaign_id::CampaignId;
pub use exported::ExportedCampaign;
pub use machine::{MachineId, Maker, Origin, Quarantined};
pub use new_campaign::{NewCampaign, study_name};
pub use notes::{CampaignNotes, Note, NotesChange, Tag, Tags};
pub use record::{ArchiveVersion, CampaignHead, CampaignRecord, Rounds, RunId};
pub use repetition::{Repetition, Round, generations_in_words};
pub use scalar::Scalar;
pub use stage::Stage;
pub use state::{CampaignState, Change, NotAllowed};
pub use time_left::{TimeLeft, WorkLeft};
pub use timestamp::{NotATimestamp, Timestamp};
pub use training::{NextTraining, SavedTraining, TrainingPictures};
pub use weight::Weight;
