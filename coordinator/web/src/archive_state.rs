//! The state of an archive, by which a page and its script learn that the page is of an earlier one.

use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};

/// The state of an archive: a page that shows the archive is loaded again when the state changes.
#[derive(PartialEq, Eq)]
pub(super) struct ArchiveState {
    pub(super) version: ArchiveVersion,
    pub(super) individuals: u64,
    pub(super) completed: bool,
}

impl ArchiveState {
    pub(super) fn of(record: &CampaignRecord) -> Self {
        Self {
            version: record.archive_version(),
            individuals: record.individuals(),
            completed: record.state == CampaignState::Completed,
        }
    }

    /// The state as one word of a page's markup, from which a script learns whether the page is of the archive as it is now.
    pub(super) fn word(&self) -> String {
        let completed = if self.completed { "completed" } else { "growing" };
        format!("{}-{}-{completed}", self.version, self.individuals)
    }
}
