//! What is needed to reproduce the archive of a report: for its page, and at the top of its `spec.toml`.

use super::Report;
use murmuration_proto::EmbedderSource;
use std::fmt::Write as _;

/// The text of `spec.toml`: what is needed besides the specification, as comments, then the specification.
pub(super) fn specification(report: &Report) -> String {
    let mut text = String::new();
    for line in also_needed(report) {
        // Writing into a string does not fail.
        let _ = writeln!(text, "# {line}");
    }
    text + &report.spec.to_toml()
}

/// What is needed besides the specification, in entries of one or two sentences; nothing if the specification suffices.
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
    if repetition.rounds.iter().any(|round| round.comparisons > 0) {
        needed.push(format!(
            "The comparisons that campaign {campaign} learned from are needed too: they are in what `murmuration export` writes, \
             and in no CSV file."
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
            "Checkpoint {} is needed, which the campaign adopted with `murmuration adopt`; when it did is not recorded.",
            report.checkpoint
        ));
    }
    needed
}

/// Whether commands reproduce the archive: people's answers were learned from in one round, and a file can hold them, which holds
/// no comparisons.
pub(super) fn is_by_commands(report: &Report) -> bool {
    let repetition = &report.repetition;
    let is_one_round = repetition.attended && !repetition.adopted && repetition.rounds.len() == 1;
    let has_compared = repetition.rounds.iter().any(|round| round.comparisons > 0);
    is_one_round && !has_compared && report.names.named().machine == 0
}
