//! The steps that led to an archive, from the lineage of its checkpoint and the label log.

use super::{Store, StoreError};
use murmuration_model::{CampaignRecord, Repetition, Round, labels::RequestId};
use murmuration_swarm::{
    CampaignSpec, CheckpointDigest, EmbedderSource, Feedback, Lineage, training::Configuration,
};

impl Store {
    /// The steps that led to the current archive of a campaign.
    pub fn repetition(&self, record: &CampaignRecord) -> Result<Repetition, StoreError> {
        let Some(checkpoint) = record.embedder.checkpoint() else {
            return Ok(Repetition::default());
        };
        let given = match record.spec.embedder() {
            Some(EmbedderSource::Published(digest)) => Some(*digest),
            Some(EmbedderSource::Trained { .. }) | None => None,
        };
        let mut rounds = Vec::new();
        let (mut first, mut lineage) = (checkpoint, self.checkpoint(checkpoint)?.lineage);
        while let Some(parent) = lineage.parent.filter(|_| Some(first) != given) {
            let labels = lineage.metrics.get("labels");
            rounds.push(Round {
                parent,
                checkpoint: first,
                labels: labels.map_or(0, |&labels| labels as u64),
                label_digest: lineage.label_digest,
            });
            (first, lineage) = (parent, self.checkpoint(parent)?.lineage);
        }
        rounds.reverse();
        let leads_there =
            rounds.len() == record.rounds.done as usize && begins(&record.spec, first, &lineage);
        Ok(Repetition {
            rounds,
            attended: is_attended(self, record)?,
            adopted: !leads_there,
        })
    }
}

/// Whether a campaign of this specification begins with `checkpoint`.
fn begins(spec: &CampaignSpec, checkpoint: CheckpointDigest, lineage: &Lineage) -> bool {
    match spec.embedder() {
        Some(EmbedderSource::Published(digest)) => *digest == checkpoint,
        Some(EmbedderSource::Trained { training, .. }) => Configuration::from_toml(&lineage.configuration)
            .is_ok_and(|configuration| lineage.label_digest.is_empty() && configuration == **training),
        None => false,
    }
}

/// Whether a campaign's rounds learned from any labels that its specification's synthetic annotator did not give.
fn is_attended(store: &Store, record: &CampaignRecord) -> Result<bool, StoreError> {
    if record.rounds.done > record.spec.feedback().map_or(0, Feedback::rounds) {
        return Ok(true);
    }
    let mut own = 0;
    for round in 1..=record.rounds.done {
        let message = store.request_entries(&record.id, &RequestId::of_round(round))?;
        if message.is_empty() {
            return Ok(true);
        }
        own += message.len() as u64;
    }
    Ok(own != record.rounds.last_cutoff)
}
