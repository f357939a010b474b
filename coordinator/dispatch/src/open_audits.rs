//! Audits that go on after the jobs of campaigns, and the disagreements that they found.

use crate::JobError;
use murmuration_model::CampaignId;
use std::collections::BTreeMap;

/// Audits that go on after their jobs, by campaign.
#[derive(Debug, Default)]
pub(crate) struct OpenAudits {
    /// Number of jobs of audits that are not over.
    jobs: BTreeMap<CampaignId, usize>,
    /// Disagreements that no third machine could decide.
    disagreements: BTreeMap<CampaignId, JobError>,
}

impl OpenAudits {
    pub(crate) fn begin(&mut self, campaign: &CampaignId) {
        *self.jobs.entry(campaign.clone()).or_default() += 1;
    }

    pub(crate) fn end(&mut self, campaign: &CampaignId) {
        if let Some(jobs) = self.jobs.get_mut(campaign) {
            *jobs -= 1;
            if *jobs == 0 {
                self.jobs.remove(campaign);
            }
        }
    }

    /// Notes a disagreement; returns whether the campaign had none.
    pub(crate) fn disagree(&mut self, campaign: &CampaignId, error: JobError) -> bool {
        self.disagreements.insert(campaign.clone(), error).is_none()
    }

    /// Whether nothing goes on for a campaign, or there is a disagreement.
    pub(crate) fn is_over(&self, campaign: &CampaignId) -> bool {
        !self.jobs.contains_key(campaign) || self.disagreements.contains_key(campaign)
    }

    /// A campaign's disagreement, which is then forgotten.
    pub(crate) fn take_disagreement(&mut self, campaign: &CampaignId) -> Option<JobError> {
        self.disagreements.remove(campaign)
    }
}
