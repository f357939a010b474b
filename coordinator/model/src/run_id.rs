//! A run of a campaign, which a decision ends.

use crate::{CampaignId, CampaignRecord};

/// What may change a campaign from one decision about it to the next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunId {
    campaign: CampaignId,
    /// How many decisions came before it.
    number: u64,
}

impl RunId {
    /// Whose run it is.
    #[must_use]
    pub const fn campaign(&self) -> &CampaignId {
        &self.campaign
    }

    /// How many decisions came before it.
    #[must_use]
    pub const fn number(&self) -> u64 {
        self.number
    }
}

impl CampaignRecord {
    /// The run that may change the campaign, if no decision has been made since this was read.
    #[must_use]
    pub fn run_id(&self) -> RunId {
        RunId {
            campaign: self.id.clone(),
            number: self.decisions,
        }
    }
}
