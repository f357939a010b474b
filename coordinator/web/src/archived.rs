//! What is archived never changes, so that a browser may keep it; but a campaign of another data directory may have the
//! same id at the same address, and what a wrong worker did is taken back. An address that also says when its campaign was
//! created, and how often something of it was taken back, means one thing for ever.

use axum::http::{HeaderName, HeaderValue, header::CACHE_CONTROL};
use murmuration_model::CampaignRecord;
use serde::Deserialize;

/// For as long as the browser likes.
const LASTING: &str = "private, max-age=31536000, immutable";
/// Until it is wanted again, and asked for again.
const CHECKED: &str = "private, no-cache";

/// Whether that is how long something archived may be kept.
pub(super) fn is_kept(cache_control: &HeaderValue) -> bool {
    cache_control == LASTING || cache_control == CHECKED
}

/// The part of an address that tells campaigns of one id apart.
#[derive(Debug, Deserialize)]
pub(super) struct Created {
    /// The [`ArchiveVersion::origin`] of what is meant; absent from addresses that people type.
    ///
    /// [`ArchiveVersion::origin`]: murmuration_model::ArchiveVersion::origin
    created: Option<String>,
}

impl Created {
    /// For how long a browser, and nobody between it and here, may keep what it was sent of this campaign: who asks may
    /// have had to show a token.
    pub(super) fn keep(&self, record: &CampaignRecord) -> (HeaderName, &'static str) {
        let kept = match self.created == Some(record.archive_version().origin()) {
            true => LASTING,
            false => CHECKED,
        };
        (CACHE_CONTROL, kept)
    }
}

/// Where the picture of an individual is.
pub(super) fn picture(record: &CampaignRecord, index: u64) -> String {
    let (id, created) = (&record.id, record.archive_version().origin());
    format!("/campaigns/{id}/individuals/{index}?created={created}")
}
