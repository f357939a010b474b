//! Documents about labels, and about agreement between annotators.

use super::Document;
use murmuration_proto::v1;
use schemars::JsonSchema;
use serde::Serialize;

/// The answers that `label` added.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct AddedLabels {
    /// Id of the campaign.
    pub(crate) campaign: String,
    /// Number of answers that were added.
    pub(crate) added: usize,
    /// Digest of the classes of all individuals after the command.
    pub(crate) label_digest: String,
}

/// Agreement of two annotators.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Agreement<'a> {
    /// The first annotator and the second.
    pub(crate) annotators: [&'a str; 2],
    #[serde(flatten)]
    pub(crate) agreement: Document<'a, v1::Agreement>,
}
