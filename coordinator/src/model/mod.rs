//! What every other part speaks of: campaigns and what they have come to, machines, embedders. Plain values: no disk, no
//! network, no tasks.

mod campaign_id;
mod embedder;
mod machine;
mod record;
mod stage;
mod state;
mod training;
mod weight;

pub use campaign_id::CampaignId;
pub use embedder::Embedder;
pub use machine::{MachineId, Maker, Quarantined};
pub use record::{CampaignRecord, Edition};
pub use stage::Stage;
pub use state::{CampaignState, Change, NotAllowed};
pub use training::{SavedTraining, TrainingPictures};
pub use weight::Weight;
