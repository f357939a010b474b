//! Campaigns: where they stand, the stages that they go through, and the registry of those at work.

mod campaigns;
mod commit;
mod dataset;
mod decisions;
mod embed;
mod error;
mod evaluate;
mod fine_tune;
mod label;
mod live;
mod metrics;
mod pretrain;
mod recheck;
mod registry;
mod run;
mod search;
mod train;

pub use campaigns::{CampaignStatus, Campaigns};
pub use error::CampaignError;
pub use metrics::CampaignMetrics;

pub(crate) use dataset::tasks as dataset_tasks;
