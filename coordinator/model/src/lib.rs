//! What every other part speaks of: campaigns and what they have come to, machines, embedders. Plain values: no disk, no
//! network, no tasks.

mod campaign_id;
pub mod colours;
mod embedder;
pub mod labels;
mod machine;
mod record;
mod repetition;
mod run_id;
mod stage;
mod state;
mod training;
mod weight;

pub use campaign_id::CampaignId;
pub use embedder::Embedder;
pub use machine::{MachineId, Maker, Origin, Quarantined};
pub use record::{ArchiveVersion, CampaignRecord};
pub use repetition::{Repetition, Round, generations_in_words};
pub use run_id::RunId;
pub use stage::Stage;
pub use state::{CampaignState, Change, NotAllowed};
pub use training::{SavedTraining, TrainingPictures};
pub use weight::Weight;
