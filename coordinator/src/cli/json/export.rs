//! What was exported of a campaign.

use murmuration_export::Exported;
use schemars::JsonSchema;
use serde::Serialize;

/// What was exported of a campaign.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Export {
    /// Id of the campaign.
    campaign: String,
    /// Its state when it was exported: running, paused, completed, failed or cancelled.
    state: &'static str,
    /// The folder that was written.
    folder: String,
    /// Its files, by path within the folder.
    files: Vec<String>,
    /// Complete generations.
    generations: u32,
    /// Individuals of these generations.
    individuals: u64,
    /// Entries of the label log.
    label_entries: u64,
    /// The checkpoint that embeds the archive; null if there is none.
    checkpoint: Option<String>,
    /// The digest of the archive, BLAKE3 in hexadecimal digits.
    digest: String,
}

impl From<&Exported> for Export {
    fn from(exported: &Exported) -> Self {
        let record = &exported.campaign.record;
        let checkpoint = record.embedder.checkpoint();
        Self {
            campaign: record.id.to_string(),
            state: record.state.name(),
            folder: exported.folder.display().to_string(),
            files: exported.files.clone(),
            generations: record.generations_done,
            individuals: record.individuals(),
            label_entries: exported.campaign.label_entries,
            checkpoint: checkpoint.map(|digest| digest.to_string()),
            digest: exported.campaign.digest.clone(),
        }
    }
}
