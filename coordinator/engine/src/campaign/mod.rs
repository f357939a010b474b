//! Campaigns: their status, their stages, and the registry of their runs.

mod campaigns;
mod commit;
mod context;
mod dataset;
mod decisions;
mod embed;
mod error;
mod evaluate;
mod fine_tune;
mod label;
mod metrics;
mod preconditions;
mod registry;
mod reverify;
mod run;
mod run_handle;
mod search;
mod train;

pub use campaigns::{CampaignStatus, Campaigns, ListedCampaign};
pub use error::CampaignError;
pub use metrics::CampaignMetrics;

pub use dataset::tasks as dataset_tasks;
