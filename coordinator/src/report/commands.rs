//! The command lines that a report offers, ready to be typed.

use super::Entry;
use murmuration_proto::{CampaignSpec, World};

/// Runs the campaign of a `spec.toml` again.
pub(super) const RUN_AGAIN: &str = "murmuration run spec.toml";

/// Shows one individual's whole run as a GIF.
pub(super) fn simulate(spec: &CampaignSpec, entry: &Entry, gif: &str) -> String {
    let model = spec.model();
    let genes: Vec<String> = entry.controller.genes().iter().map(f64::to_string).collect();
    let world = if *spec.world() == World::default() {
        ""
    } else {
        " --spec spec.toml"
    };
    // Brackets, so that a first gene below zero is not taken for an option.
    format!(
        "murmuration simulate{world} --model {model} --controller \"[{}]\" --seed {} --gif {gif}",
        genes.join(", "),
        entry.seed
    )
}
