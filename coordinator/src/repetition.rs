//! What it takes to get an archive again, besides its specification: the rounds that taught it, and whether somebody
//! intervened.

use crate::{
    labels::RequestId,
    model::CampaignRecord,
    store::{Store, StoreError},
};
use murmuration_proto::{
    CampaignSpec, CheckpointDigest, EmbedderSource, Feedback, Invalid, Lineage, Text, counted,
    training::Configuration, v1,
};

/// What led to an archive and to the checkpoint that it rests on.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Repetition {
    /// The rounds in which the checkpoint was fine-tuned on labels, the first one first.
    pub rounds: Vec<Round>,
    /// Whether the rounds learned from anything but the labels that the specification has the synthetic annotator give.
    pub attended: bool,
    /// Whether the specification and the rounds do not lead to the checkpoint: somebody moved the campaign to it.
    pub adopted: bool,
}

/// A round in which a checkpoint was fine-tuned on labels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Round {
    /// The checkpoint that it went on from.
    pub parent: CheckpointDigest,
    /// The checkpoint that it made.
    pub checkpoint: CheckpointDigest,
    /// Individuals whose classes it learned from.
    pub labels: u64,
    /// Digest of the labelled pictures.
    pub label_digest: String,
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
    /// What led to the archive of a campaign as it stands.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub fn read(store: &Store, record: &CampaignRecord) -> Result<Self, StoreError> {
        let Some(checkpoint) = record.checkpoint else {
            return Ok(Self::default());
        };
        let given = match record.spec.embedder() {
            Some(EmbedderSource::Published(digest)) => Some(*digest),
            Some(EmbedderSource::Trained { .. }) | None => None,
        };
        let mut rounds = Vec::new();
        let (mut first, mut lineage) = (checkpoint, store.checkpoint(checkpoint)?.lineage);
        while let Some(parent) = lineage.parent.filter(|_| Some(first) != given) {
            rounds.push(Round {
                parent,
                checkpoint: first,
                labels: lineage.metrics.get("labels").map_or(0, |&labels| labels as u64),
                label_digest: lineage.label_digest,
            });
            (first, lineage) = (parent, store.checkpoint(parent)?.lineage);
        }
        rounds.reverse();
        let leads_there =
            rounds.len() == record.rounds_done as usize && begins(&record.spec, first, &lineage);
        Ok(Self {
            rounds,
            attended: is_attended(store, record)?,
            adopted: !leads_there,
        })
    }

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

/// Whether a campaign begins with that checkpoint.
fn begins(spec: &CampaignSpec, checkpoint: CheckpointDigest, lineage: &Lineage) -> bool {
    match spec.embedder() {
        Some(EmbedderSource::Published(digest)) => *digest == checkpoint,
        Some(EmbedderSource::Trained { training, .. }) => Configuration::from_toml(&lineage.configuration)
            .is_ok_and(|configuration| lineage.label_digest.is_empty() && configuration == **training),
        None => false,
    }
}

/// Whether the rounds of a campaign learned from anything but what its specification has the synthetic annotator say.
fn is_attended(store: &Store, record: &CampaignRecord) -> Result<bool, StoreError> {
    if record.rounds_done > record.spec.feedback().map_or(0, Feedback::rounds) {
        return Ok(true);
    }
    let mut own = 0;
    for round in 1..=record.rounds_done {
        let said = store.request_entries(&record.id, &RequestId::of_round(round))?;
        if said.is_empty() {
            return Ok(true);
        }
        own += said.len() as u64;
    }
    Ok(own != record.learned.unwrap_or(0))
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
