//! What people decide about a campaign's behaviour space: another checkpoint, or a round of feedback.

use super::{
    CampaignError, CampaignId, CampaignState, CampaignStatus, Campaigns, Change, NotAllowed, run::blocking,
};
use crate::{labels::Labels, store::CampaignRecord};
use murmuration_proto::CheckpointDigest;
use std::collections::BTreeSet;

impl Campaigns {
    /// Has a campaign move to a stored checkpoint, and go on from there; the decision is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign or checkpoint, the two do not go together, or the campaign is cancelled.
    pub async fn adopt(
        &self,
        id: &str,
        checkpoint: CheckpointDigest,
    ) -> Result<CampaignStatus, CampaignError> {
        let mut at_work = self.at_work.lock().await;
        let record = self.movable(id, Change::Adopt).await?;
        let image = record.spec.image();
        self.means.checkpoints.embedder(checkpoint, image).await?;
        let id = record.id.clone();
        self.decide(&mut at_work, record, move |store, id| {
            store.move_to(id, checkpoint)
        })
        .await?;
        drop(at_work);
        self.status(id.as_str()).await
    }

    /// Begins a round of feedback: has a campaign fine-tuned on its labels as they stand, and its search go on after
    /// that; the decision is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign, it is cancelled or has no embedder (yet), or its labels name fewer than two classes.
    pub async fn refine(&self, id: &str) -> Result<CampaignStatus, CampaignError> {
        let mut at_work = self.at_work.lock().await;
        let record = self.movable(id, Change::Refine).await?;
        if record.checkpoint.is_none() {
            return Err(CampaignError::NoEmbedder(record.id));
        }
        let (store, labelled) = (self.means.store.clone(), record.id.clone());
        let labels = blocking(move || store.labels(&labelled)).await??;
        check_lesson(&record.id, &labels)?;
        let id = record.id.clone();
        self.decide(&mut at_work, record, move |store, id| {
            store.begin_round(id, labels.entries())
        })
        .await?;
        drop(at_work);
        self.status(id.as_str()).await
    }

    /// A campaign that may move to another space.
    async fn movable(&self, id: &str, change: Change) -> Result<CampaignRecord, CampaignError> {
        let record = self.record(id).await?;
        let CampaignRecord { id, spec, state, .. } = &record;
        if *state == CampaignState::Cancelled {
            let (id, state) = (id.clone(), *state);
            return Err(NotAllowed { id, change, state }.into());
        }
        if !spec.method().embeds() {
            let (id, method) = (id.clone(), spec.method());
            return Err(CampaignError::NoEmbedding { id, method });
        }
        Ok(record)
    }
}

/// Whether there is something to learn from labels.
pub(super) fn check_lesson(id: &CampaignId, labels: &Labels) -> Result<(), CampaignError> {
    let classes: BTreeSet<u32> = labels.lesson().into_iter().map(|(_, class)| class).collect();
    match classes.len() {
        2.. => Ok(()),
        classes => Err(CampaignError::TooFewClasses {
            id: id.clone(),
            classes,
        }),
    }
}
