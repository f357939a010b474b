//! What it takes to get the archive of a report again: for its page, and atop its `spec.toml`.

use super::Report;
use murmuration_proto::{EmbedderSource, counted};
use std::fmt::Write as _;

/// The text of `spec.toml`: what the specification alone does not give, as comments, then the specification.
pub(super) fn specification(report: &Report) -> String {
    let mut text = String::new();
    for line in also_needed(report) {
        // Writing into a string does not fail.
        let _ = writeln!(text, "# {line}");
    }
    text + &report.spec.to_toml()
}

/// What it takes besides the specification, one sentence or two an entry; nothing where it takes nothing else.
pub(super) fn also_needed(report: &Report) -> Vec<String> {
    let (campaign, repetition) = (&report.campaign, &report.repetition);
    let mut needed = Vec::new();
    if !repetition.is_by_specification() {
        needed.push(format!(
            "This specification alone does not give the archive of campaign {campaign} again."
        ));
    }
    if let Some(EmbedderSource::Published(digest)) = report.spec.embedder() {
        needed.push(format!(
            "It takes checkpoint {digest}: `murmuration checkpoints export` writes it to a file, `murmuration checkpoints \
             import` reads it."
        ));
    }
    if repetition.attended {
        needed.push(format!(
            "It takes the labels that campaign {campaign} learned from, as they stood when each round began; `murmuration \
             labels {campaign} --csv labels.csv` writes those that stand today."
        ));
    }
    if !repetition.is_by_specification() {
        for (round, number) in repetition.rounds.iter().zip(1..) {
            needed.push(format!(
                "Round {number} fine-tuned checkpoint {} on the classes of {}, which made checkpoint {} (digest of the \
                 labelled pictures: {}).",
                round.parent,
                counted(round.labels, "individual"),
                round.checkpoint,
                round.label_digest
            ));
        }
    }
    if repetition.adopted {
        needed.push(format!(
            "It takes checkpoint {}, to which somebody moved the campaign with `murmuration adopt`; when that was is not \
             kept.",
            report.checkpoint
        ));
    }
    needed
}

/// Whether commands lead to the archive again: one round of people's answers, which a file can hold.
pub(super) fn is_by_commands(report: &Report) -> bool {
    let repetition = &report.repetition;
    let is_one_round = repetition.attended && !repetition.adopted && repetition.rounds.len() == 1;
    is_one_round && report.names.named().machine == 0
}
