//! How long a browser can keep pictures and motions of an archive. These do not change, with two exceptions: a campaign of
//! another data directory can have the same id at the same address, and a rollback discards results. An address that also
//! contains the time of the campaign's creation and the number of rollbacks always has the same content.

use axum::http::{HeaderName, HeaderValue, header::CACHE_CONTROL};
use murmuration_model::CampaignRecord;
use serde::Deserialize;

/// The browser can keep the response as long as it wants.
const LASTING: &str = "private, max-age=31536000, immutable";
/// The browser must ask the coordinator before each use.
const CHECKED: &str = "private, no-cache";

/// Whether a header is [`LASTING`] or [`CHECKED`].
pub(super) fn is_kept(cache_control: &HeaderValue) -> bool {
    cache_control == LASTING || cache_control == CHECKED
}

/// The part of an address that distinguishes campaigns with the same id.
#[derive(Debug, Deserialize)]
pub(super) struct Created {
    /// The [`ArchiveVersion::origin`] of the archive; an address that a person typed lacks it.
    ///
    /// [`ArchiveVersion::origin`]: murmuration_model::ArchiveVersion::origin
    created: Option<String>,
}

impl Created {
    /// The header that sets how long a browser can keep a response. The header forbids shared caches, because the request can
    /// have needed a token.
    pub(super) fn keep(&self, record: &CampaignRecord) -> (HeaderName, &'static str) {
        let kept = match self.created == Some(record.archive_version().origin()) {
            true => LASTING,
            false => CHECKED,
        };
        (CACHE_CONTROL, kept)
    }
}

/// The address of the picture of an individual, as the embedder sees it.
pub(super) fn picture(record: &CampaignRecord, index: u64) -> String {
    of_individual(record, index, "")
}

/// The address of the coloured paths of an individual.
pub(super) fn paths(record: &CampaignRecord, index: u64) -> String {
    of_individual(record, index, "/paths.png")
}

fn of_individual(record: &CampaignRecord, index: u64, what: &str) -> String {
    let (id, created) = (&record.id, record.archive_version().origin());
    format!("/campaigns/{id}/individuals/{index}{what}?created={created}")
}
