//! The steps that led to an archive, besides its specification: the rounds of feedback, and whether a person intervened.

use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, CheckpointDigest, Invalid, Text, counted};

/// The rounds that led to an archive and its checkpoint.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repetition {
    /// The rounds in which the checkpoint was fine-tuned on labels, the first round first.
    pub rounds: Vec<Round>,
    /// Whether the rounds learned from any labels that the specification's synthetic annotator did not give.
    pub attended: bool,
    /// Whether a person moved the campaign to the checkpoint, so that the specification and the rounds do not lead to it.
    pub adopted: bool,
}

/// A round in which a checkpoint was fine-tuned on labels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Round {
    /// The checkpoint that was fine-tuned.
    pub parent: CheckpointDigest,
    pub checkpoint: CheckpointDigest,
    /// Number of individuals whose classes the round learned from.
    pub labels: u64,
    /// Digest of the labelled pictures.
    pub label_digest: String,
}

impl Round {
    /// The labels of the round in words, such as `the classes of 20 individuals`.
    pub fn learned_from(&self) -> String {
        format!("the classes of {}", counted(self.labels, "individual"))
    }
}

/// The numbers of generations of the specification and of the rounds, in words such as
/// `20 of the search, 20 for 1 round of feedback`; `None` if no round has added generations.
pub fn generations_in_words(spec: &CampaignSpec, generations: u32, rounds: u32) -> Option<String> {
    let search = spec.search().generations();
    let further = generations.checked_sub(search).filter(|&further| further > 0)?;
    let rounds = counted(rounds.into(), "round");
    Some(format!(
        "{search} of the search, {further} for {rounds} of feedback"
    ))
}

impl Repetition {
    /// Whether the specification alone reproduces the archive.
    pub const fn is_by_specification(&self) -> bool {
        !self.attended && !self.adopted
    }

    /// Whether another checkpoint embedded the archive before, so that its novelty was recomputed.
    pub const fn has_moved(&self) -> bool {
        self.adopted || !self.rounds.is_empty()
    }
}

impl From<Round> for v1::TaughtRound {
    fn from(round: Round) -> Self {
        Self {
            parent: round.parent.to_string(),
            checkpoint: round.checkpoint.to_string(),
            labels: round.labels,
            label_digest: round.label_digest,
        }
    }
}

impl TryFrom<v1::TaughtRound> for Round {
    type Error = Invalid;

    fn try_from(message: v1::TaughtRound) -> Result<Self, Invalid> {
        Ok(Self {
            parent: message.parent.parse()?,
            checkpoint: message.checkpoint.parse()?,
            labels: message.labels,
            label_digest: Text::line(&message.label_digest).into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generations_that_rounds_added_are_told_apart() {
        let text = "model = \"single-sensor\"\nmethod = \"latent\"\n[search]\ngenerations = 20\n[feedback]\ngenerations = 10";
        let spec = CampaignSpec::from_toml(text).unwrap();
        let words = generations_in_words(&spec, 40, 2);
        assert_eq!(
            words.as_deref(),
            Some("20 of the search, 20 for 2 rounds of feedback")
        );
        for generations in [0, 20] {
            assert_eq!(generations_in_words(&spec, generations, 0), None);
        }
    }
}
