//! How to reproduce the archive of a report: text for the report's page and for the top of its `spec.toml`, and commands to copy.

use super::{Entry, Report};
use murmuration_swarm::{CampaignSpec, EmbedderSource, World};
use std::fmt::Write as _;

/// The text of `spec.toml`: as comments, what the reader needs besides the specification; then the specification.
pub(super) fn specification(report: &Report) -> String {
    let mut text = String::new();
    for line in also_needed(report) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# {line}");
    }
    text + &report.spec.to_toml()
}

/// The things besides the specification that a reader needs to reproduce the archive, in entries of one or two sentences. Empty
/// if the specification suffices.
pub(super) fn also_needed(report: &Report) -> Vec<String> {
    let (campaign, repetition) = (&report.campaign, &report.repetition);
    let mut needed = Vec::new();
    if !repetition.is_by_specification() {
        needed.push(format!(
            "This specification alone does not reproduce the archive of campaign {campaign}."
        ));
    }
    if let Some(EmbedderSource::Published(digest)) = report.spec.embedder() {
        needed.push(format!(
            "Checkpoint {digest} is needed: `murmuration checkpoints export` writes it to a file, and `murmuration \
             checkpoints import` reads the file."
        ));
    }
    if repetition.attended {
        needed.push(format!(
            "The labels that campaign {campaign} learned from are needed, as they were when each round began; `murmuration \
             labels {campaign} --csv labels.csv` writes the labels as they are now."
        ));
    }
    if !repetition.is_by_specification() {
        for (round, number) in repetition.rounds.iter().zip(1..) {
            needed.push(format!(
                "Round {number} fine-tuned checkpoint {} on {} into checkpoint {} (digest of their pictures: {}).",
                round.parent,
                round.learned_from(),
                round.checkpoint,
                round.label_digest
            ));
        }
    }
    if repetition.adopted {
        needed.push(format!(
            "Checkpoint {} is needed, which the campaign adopted with `murmuration adopt`; the time of the adoption is not recorded.",
            report.checkpoint
        ));
    }
    needed
}

/// Whether commands reproduce the archive: the campaign learned from people's answers in one round, and a file can hold these
/// answers.
pub(super) fn is_by_commands(report: &Report) -> bool {
    let repetition = &report.repetition;
    let is_one_round = repetition.attended && !repetition.adopted && repetition.rounds.len() == 1;
    is_one_round && report.names.named().machine == 0
}

/// The command that runs the campaign of a `spec.toml` again.
pub(super) const RUN_AGAIN: &str = "murmuration run spec.toml";

/// The commands that run a `spec.toml` again and teach its campaign in one round.
pub(super) const TEACH_AGAIN: [&str; 3] = [
    RUN_AGAIN,
    "murmuration label latest --csv labels.csv",
    "murmuration refine latest",
];

/// The command that writes the labels of a report's campaign.
pub(super) fn write_labels(report: &Report) -> String {
    format!("murmuration labels {} --csv labels.csv", report.campaign)
}

/// The command that shows one individual's whole run as a GIF.
pub(super) fn simulate(spec: &CampaignSpec, entry: &Entry, gif: &str) -> String {
    let genes: Vec<String> = entry.controller.genes().iter().map(f64::to_string).collect();
    // With brackets, the command line does not take a negative first gene for an option.
    format!(
        "{} --controller \"[{}]\" --seed {} --gif {gif}",
        simulator(spec),
        genes.join(", "),
        entry.seed
    )
}

/// The beginning of a command that simulates any controller of a campaign; the caller appends the options for the controller.
pub(super) fn simulator(spec: &CampaignSpec) -> String {
    match spec.model().preset() {
        Some(preset) if *spec.world() == World::default() => format!("murmuration simulate --model {preset}"),
        _ => "murmuration simulate --spec spec.toml".to_owned(),
    }
}
