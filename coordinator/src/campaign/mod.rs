//! Campaigns: where they stand, the stages that they go through, and the registry of those at work.

mod campaigns;
mod dataset;
mod embed;
mod live;
mod pretrain;
mod run;
mod search;
mod stage;
mod state;

pub use campaigns::{CampaignError, CampaignStatus, Campaigns};
pub use stage::Stage;
pub use state::{CampaignId, CampaignState, Change, NotAllowed};

pub(crate) use run::blocking;
