//! How long a browser may keep pictures and motions of an archive. They do not change, but a campaign of another data
//! directory may have the same id at the same address, and results of a wrong worker are discarded. An address with the time
//! at which its campaign was created, and the number of times that results were discarded, always means the same content.

use axum::http::{HeaderName, HeaderValue, header::CACHE_CONTROL};
use murmuration_model::CampaignRecord;
use serde::Deserialize;

/// The browser may keep the response as long as it wants.
const LASTING: &str = "private, max-age=31536000, immutable";
/// The browser must ask the coordinator before each use.
const CHECKED: &str = "private, no-cache";

/// Whether a header is one of these two.
pub(super) fn is_kept(cache_control: &HeaderValue) -> bool {
    cache_control == LASTING || cache_control == CHECKED
}

/// The part of an address that distinguishes campaigns with the same id.
#[derive(Debug, Deserialize)]
pub(super) struct Created {
    /// The [`ArchiveVersion::origin`] of the archive; absent from addresses that people type.
    ///
    /// [`ArchiveVersion::origin`]: murmuration_model::ArchiveVersion::origin
    created: Option<String>,
}

impl Created {
    /// The header that tells a browser how long to keep a response. It forbids shared caches, since the request may have needed a
    /// token.
    pub(super) fn keep(&self, record: &CampaignRecord) -> (HeaderName, &'static str) {
        let kept = match self.created == Some(record.archive_version().origin()) {
            true => LASTING,
            false => CHECKED,
        };
        (CACHE_CONTROL, kept)
    }
}

/// The address of the picture of an individual.
pub(super) fn picture(record: &CampaignRecord, index: u64) -> String {
    let (id, created) = (&record.id, record.archive_version().origin());
    format!("/campaigns/{id}/individuals/{index}?created={created}")
}
