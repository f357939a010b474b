//! The command lines that a report offers, ready to be typed.

use super::{Entry, Report};
use murmuration_proto::{CampaignSpec, World};

/// Runs the campaign of a `spec.toml` again.
pub(super) const RUN_AGAIN: &str = "murmuration run spec.toml";

/// Teaches the campaign that a `spec.toml` ran, in one round.
pub(super) const TEACH_AGAIN: [&str; 3] = [
    RUN_AGAIN,
    "murmuration label latest --csv labels.csv",
    "murmuration refine latest",
];

/// Writes the labels of a report's campaign.
pub(super) fn write_labels(report: &Report) -> String {
    format!("murmuration labels {} --csv labels.csv", report.campaign)
}

/// Shows one individual's whole run as a GIF.
pub(super) fn simulate(spec: &CampaignSpec, entry: &Entry, gif: &str) -> String {
    let genes: Vec<String> = entry.controller.genes().iter().map(f64::to_string).collect();
    // Brackets, so that a first gene below zero is not taken for an option.
    format!(
        "{} --controller \"[{}]\" --seed {} --gif {gif}",
        simulator(spec),
        genes.join(", "),
        entry.seed
    )
}

/// The command that simulates any controller of a campaign, before the options that say which.
pub(super) fn simulator(spec: &CampaignSpec) -> String {
    match spec.model().preset() {
        Some(preset) if *spec.world() == World::default() => format!("murmuration simulate --model {preset}"),
        _ => "murmuration simulate --spec spec.toml".to_owned(),
    }
}
