//! Why the report of a study cannot be written.

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file or folder cannot be written.
    #[error("{0}")]
    Write(#[from] murmuration_report::ReportError),
    /// A map cannot be drawn.
    #[error("cannot draw the map \"{title}\": {reason}")]
    Map {
        /// Its title.
        title: String,
        /// What is wrong.
        reason: String,
    },
    /// A medoid cannot be simulated or drawn.
    #[error("cannot draw individual {index} of campaign {campaign}: {reason}")]
    Picture {
        /// Its index.
        index: u64,
        /// Its campaign.
        campaign: String,
        /// What is wrong.
        reason: String,
    },
}
