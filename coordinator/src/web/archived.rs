//! What is archived never changes, so that a browser may keep it; but a campaign of another data directory may have the
//! same id at the same address, and what a wrong worker did is taken back. An address that also says when its campaign was
//! created, or last taken back, means one thing for ever.

use crate::store::CampaignRecord;
use axum::http::{HeaderName, header::CACHE_CONTROL};
use serde::Deserialize;

/// The part of an address that tells campaigns of one id apart.
#[derive(Debug, Deserialize)]
pub(super) struct Created {
    /// Since when the campaign is of this edition, milliseconds since 1970-01-01 UTC; absent from addresses that people type.
    created: Option<u64>,
}

impl Created {
    /// For how long a browser may keep what it was sent of this campaign.
    pub(super) fn keep(&self, record: &CampaignRecord) -> (HeaderName, &'static str) {
        let kept = match self.created == Some(record.edition().since_ms) {
            true => "public, max-age=31536000, immutable",
            false => "no-cache",
        };
        (CACHE_CONTROL, kept)
    }
}

/// Where the picture of an individual is.
pub(super) fn picture(record: &CampaignRecord, index: u64) -> String {
    let (id, created) = (&record.id, record.edition().since_ms);
    format!("/campaigns/{id}/individuals/{index}?created={created}")
}
