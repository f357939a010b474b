//! Campaigns: where they stand, the search that they run, and the registry of those at work.

mod campaigns;
mod live;
mod search;
mod state;

pub use campaigns::{CampaignError, CampaignStatus, Campaigns};
pub use state::{CampaignId, CampaignState, Change, NotAllowed};

pub(crate) use search::blocking;
