//! What it takes to get an archive again, besides its specification: the rounds that taught it, and whether somebody
//! intervened.

use murmuration_proto::{CampaignSpec, CheckpointDigest, Invalid, Text, counted, v1};

/// What led to an archive and to the checkpoint that it rests on.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repetition {
    /// The rounds in which the checkpoint was fine-tuned on labels and comparisons, the first one first.
    pub rounds: Vec<Round>,
    /// Whether the rounds learned from anything but the labels that the specification has the synthetic annotator give.
    pub attended: bool,
    /// Whether the specification and the rounds do not lead to the checkpoint: somebody moved the campaign to it.
    pub adopted: bool,
}

/// A round in which a checkpoint was fine-tuned on labels and comparisons.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Round {
    /// The checkpoint that it went on from.
    pub parent: CheckpointDigest,
    /// The checkpoint that it made.
    pub checkpoint: CheckpointDigest,
    /// Individuals whose classes it learned from.
    pub labels: u64,
    /// Comparisons that it learned from.
    pub comparisons: u64,
    /// Digest of the labelled and compared pictures.
    pub label_digest: String,
}

impl Round {
    /// What it learned from, as in `the classes of 20 individuals and 3 comparisons`.
    #[must_use]
    pub fn learned_from(&self) -> String {
        let classes = format!("the classes of {}", counted(self.labels, "individual"));
        let comparisons = counted(self.comparisons, "comparison");
        match (self.labels, self.comparisons) {
            (_, 0) => classes,
            (0, _) => comparisons,
            _ => format!("{classes} and {comparisons}"),
        }
    }
}

/// How many generations are the specification's and how many came with rounds, as in `20 of the search, 20 for 1 round of
/// feedback`; `None` where no round has added any.
pub fn generations_in_words(spec: &CampaignSpec, generations: u32, rounds: u32) -> Option<String> {
    let search = spec.search().generations();
    let further = generations.checked_sub(search).filter(|&further| further > 0)?;
    let rounds = counted(rounds.into(), "round");
    Some(format!(
        "{search} of the search, {further} for {rounds} of feedback"
    ))
}

impl Repetition {
    /// Whether the specification alone gives the archive again.
    #[must_use]
    pub const fn is_by_specification(&self) -> bool {
        !self.attended && !self.adopted
    }

    /// Whether the archive was embedded by another checkpoint before, so that its novelty was measured again.
    #[must_use]
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
            comparisons: round.comparisons,
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
            comparisons: message.comparisons,
            label_digest: Text::line(&message.label_digest).into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_round_learned_from_is_told() {
        let learned_from = |labels, comparisons| {
            let checkpoint = CheckpointDigest::of(b"round");
            let round = Round {
                parent: checkpoint,
                checkpoint,
                labels,
                comparisons,
                label_digest: String::new(),
            };
            round.learned_from()
        };
        assert_eq!(learned_from(20, 0), "the classes of 20 individuals");
        assert_eq!(learned_from(0, 1), "1 comparison");
        assert_eq!(
            learned_from(1, 3),
            "the classes of 1 individual and 3 comparisons"
        );
    }

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
