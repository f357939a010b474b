//! Documents about campaigns and their results.

use super::Document;
use murmuration_proto::v1;
use schemars::JsonSchema;
use serde::Serialize;

/// The result of a campaign.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Run {
    /// Id of the campaign.
    pub(crate) campaign: String,
    /// Digest of the campaign's archive.
    pub(crate) digest: String,
    /// Path of the campaign's report.
    pub(crate) report: String,
    /// Number of evaluations in the campaign's archive.
    pub(crate) evaluations: u64,
    /// Duration of the command.
    pub(crate) seconds: f64,
}

/// The data that was deleted with a campaign, or that a deletion would remove.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Deletion<'a> {
    /// Whether the campaign was deleted.
    pub(crate) deleted: bool,
    #[serde(flatten)]
    pub(crate) deletion: Document<'a, v1::DeleteCampaignResponse>,
}

/// The digest of an archive.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Digest<'a> {
    /// Id of the campaign.
    pub(crate) campaign: &'a str,
    /// Whether the campaign has completed. The archive of any other campaign still grows, or stays incomplete.
    pub(crate) complete: bool,
    #[serde(flatten)]
    pub(crate) digest: Document<'a, v1::GetDigestResponse>,
}

/// The taxonomy of a completed campaign, without pictures.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Taxonomy<'a> {
    /// Id of the campaign.
    pub(crate) campaign: &'a str,
    #[serde(flatten)]
    pub(crate) taxonomy: Document<'a, v1::Taxonomy>,
}

/// The location of a report.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Report {
    /// Path of the report's page.
    pub(crate) report: String,
}

/// A figure that was drawn.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Figure {
    /// Path of the figure.
    pub(crate) figure: String,
    /// Width of the figure on paper.
    pub(crate) width_mm: f64,
    /// Height of the figure on paper.
    pub(crate) height_mm: f64,
    /// The behaviours in the order of the figure: row by row, from the left.
    pub(crate) behaviours: Vec<FigureBehaviour>,
}

/// A behaviour of a figure.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct FigureBehaviour {
    /// Number of the behaviour in the report.
    pub(crate) behaviour: usize,
    /// Label of the behaviour in the figure.
    pub(crate) label: Option<String>,
    /// Name of the behaviour, with a question mark unless a person gave the name.
    pub(crate) name: Option<String>,
    /// Share of its cluster in the archive, from 0 to 1.
    pub(crate) share: f64,
}
