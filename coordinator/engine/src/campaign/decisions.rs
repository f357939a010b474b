//! Decisions of people about a campaign. A decision is written to disk before it is carried out. Once the decision is on disk,
//! the former run can no longer change the campaign, so no caller waits for the end of that run.

use super::{
    CampaignError, CampaignStatus, Campaigns,
    preconditions::{check_classes, check_simulator},
    registry::Deciding,
};
use murmuration_dispatch::Submitter;
use murmuration_model::{CampaignId, CampaignRecord, CampaignState, Change, NotAllowed, NotesChange};
use murmuration_store::{Decision, DecisionError, Deletion, DeletionError, Store};
use murmuration_swarm::{CampaignName, CheckpointDigest};
use tracing::Instrument as _;

impl Campaigns {
    /// Pauses a campaign; the decision is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign, or its state does not allow a pause.
    pub async fn pause(&self, id: &str) -> Result<CampaignStatus, CampaignError> {
        let record = self.record(id).await?;
        self.decide(record.id, Decision::Pause).await
    }

    /// Continues a campaign; the decision is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign, its state does not allow it to resume, or another version of the simulator began it.
    pub async fn resume(&self, id: &str) -> Result<CampaignStatus, CampaignError> {
        let record = self.record(id).await?;
        // If the state does not allow the campaign to resume, the error should name the state, not the simulator.
        if record.state.after(Change::Resume).is_some() {
            check_simulator(&record)?;
        }
        self.decide(record.id, Decision::Resume).await
    }

    /// Ends a campaign for good; the decision is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign, or its state does not allow it to be cancelled.
    pub async fn cancel(&self, id: &str) -> Result<CampaignStatus, CampaignError> {
        let record = self.record(id).await?;
        let cancelled = self.decide(record.id.clone(), Decision::Cancel).await;
        let is_stored = match &cancelled {
            Ok(_) => true,
            Err(CampaignError::Store(error)) => error.is_stored(),
            Err(_) => false,
        };
        if is_stored {
            let submitter = Submitter::Campaign(record.id);
            self.context.dispatch.withdraw_audits(submitter).await;
        }
        cancelled
    }

    /// Moves a campaign to a stored checkpoint, with which it continues; the decision is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign or checkpoint, the checkpoint does not fit the campaign, or the campaign is cancelled.
    pub async fn adopt(
        &self,
        id: &str,
        checkpoint: CheckpointDigest,
    ) -> Result<CampaignStatus, CampaignError> {
        let record = self.movable(id, Change::Adopt).await?;
        let image = record.spec.image();
        self.context.checkpoints.embedder(checkpoint, image).await?;
        self.decide(record.id, Decision::Adopt(checkpoint)).await
    }

    /// Begins a round of feedback: the campaign is fine-tuned on its current labels, then continues its search. The decision is
    /// on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign, it is cancelled or has no embedder (yet), or its labels name fewer than two classes.
    pub async fn refine(&self, id: &str) -> Result<CampaignStatus, CampaignError> {
        let record = self.movable(id, Change::Refine).await?;
        if record.embedder.checkpoint().is_none() {
            return Err(CampaignError::NoEmbedder(record.id));
        }
        let labelled = record.id.clone();
        let labels = self
            .context
            .store
            .run(move |store| store.labels(&labelled))
            .await?;
        check_classes(&record.id, &labels)?;
        self.decide(record.id, Decision::Refine(labels.entries())).await
    }

    /// Gives the search of a completed campaign `generations` generations, more than before, and continues it; the decision is on
    /// disk when this returns. The campaign's taxonomy stays as a former version.
    ///
    /// The archive becomes that of a campaign that asked for so many generations from the start, unless the campaign has adopted
    /// another checkpoint: its stored generations were selected in the space of the former one.
    ///
    /// # Errors
    /// If there is no such campaign, it is not completed, belongs to a study, has learned from feedback, cannot have so many
    /// generations, or was begun by another version of the simulator.
    pub async fn extend(&self, id: &str, generations: u32) -> Result<CampaignStatus, CampaignError> {
        let record = self.record(id).await?;
        if let Some(study) = record.study {
            let id = record.id;
            return Err(CampaignError::OfStudy { id, study });
        }
        if record.rounds.done > 0 {
            return Err(CampaignError::AfterFeedback(record.id));
        }
        if record.state.after(Change::Extend).is_some() {
            check_simulator(&record)?;
        }
        self.decide(record.id, Decision::Extend(generations)).await
    }

    /// Changes the tags and the note of a campaign, whatever its state; the change is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign, or it would have too many tags.
    pub async fn note(&self, id: &str, change: NotesChange) -> Result<CampaignStatus, CampaignError> {
        let id = self.record(id).await?.id;
        let noted = id.clone();
        let store = &self.context.store;
        store.run(move |store| store.change_notes(&noted, change)).await?;
        self.status(id.as_str()).await
    }

    /// Reports what a deletion of the campaign would delete.
    ///
    /// # Errors
    /// If there is no such campaign.
    pub async fn deletion(&self, id: &CampaignId) -> Result<Deletion, CampaignError> {
        let id = id.clone();
        Ok(self.context.store.run(move |store| store.deletion(&id)).await?)
    }

    /// Deletes a campaign that does not run, with all data that belong only to it, and reports what was deleted. The campaign is
    /// gone from the disk when this returns. A campaign of a study is only deleted if the request names the study.
    ///
    /// # Errors
    /// If there is no such campaign, it runs, or it belongs to a study that the request does not name.
    pub async fn delete(
        &self,
        id: CampaignId,
        study: Option<CampaignName>,
    ) -> Result<Deletion, CampaignError> {
        let campaigns = self.clone();
        let deleting = async move {
            let deciding = campaigns.context.registry.deciding(&id).await;
            let has_failed = campaigns.context.registry.snapshot(&id).progress.failed.is_some();
            let deletion = campaigns.deletion(&id).await?;
            let deleted = id.clone();
            let delete = move |store: &Store| store.delete_campaign(&deleted, study.as_ref(), has_failed);
            // A stored decision is carried out even if the mirror lacks it.
            let unmirrored = match campaigns.context.store.run(delete).await {
                Err(DeletionError::Store(error)) if error.is_stored() => Some(error),
                deleted => deleted.map(|()| None)?,
            };
            tracing::info!(campaign = %id, "deleted");
            campaigns.context.registry.stop(&deciding);
            let submitter = Submitter::Campaign(id);
            campaigns.context.dispatch.withdraw_audits(submitter).await;
            unmirrored.map_or(Ok(deletion), |error| Err(error.into()))
        };
        let deleted = tokio::spawn(deleting.in_current_span()).await;
        deleted.map_err(|_| CampaignError::Broken)?
    }

    /// The campaign's record, if the campaign can move to another behaviour space.
    async fn movable(&self, id: &str, change: Change) -> Result<CampaignRecord, CampaignError> {
        let record = self.record(id).await?;
        let CampaignRecord { id, spec, state, .. } = &record;
        if *state == CampaignState::Cancelled {
            let (id, state) = (id.clone(), *state);
            return Err(NotAllowed { id, change, state }.into());
        }
        if !spec.space().embeds() {
            let (id, space) = (id.clone(), spec.space());
            return Err(CampaignError::NoEmbedding { id, space });
        }
        check_simulator(&record)?;
        Ok(record)
    }

    /// Writes a decision, ends the current run, and begins a new run if the campaign's state is now `Running`. Returns the new
    /// status.
    async fn decide(&self, id: CampaignId, decision: Decision) -> Result<CampaignStatus, CampaignError> {
        let campaigns = self.clone();
        // This runs in a separate task, so that the decision is carried out even if the client has disconnected.
        let deciding = async move {
            let deciding = campaigns.context.registry.deciding(&id).await;
            campaigns.decide_alone(&deciding, decision).await?;
            drop(deciding);
            campaigns.status(id.as_str()).await
        };
        let decided = tokio::spawn(deciding.in_current_span()).await;
        decided.map_err(|_| CampaignError::Broken)?
    }

    async fn decide_alone(&self, deciding: &Deciding, decision: Decision) -> Result<(), CampaignError> {
        let run = self.context.registry.snapshot(&deciding.id);
        let has_failed = run.progress.failed.is_some();
        if decision == Decision::Resume && run.active && !has_failed {
            // The first request may have been refused only because the mirror did not have its decision.
            return Ok(self.context.store.reach_mirror().await?);
        }
        let id = deciding.id.clone();
        let decide = move |store: &Store| store.decide(&id, decision, has_failed);
        // A stored decision is carried out even if the mirror lacks it.
        let unmirrored = match self.context.store.run(decide).await {
            Err(DecisionError::Store(error)) if error.is_stored() => Some(error),
            Err(error) => return Err(CampaignError::undecided(deciding.id.clone(), error)),
            Ok(()) => None,
        };
        tracing::info!(campaign = %deciding.id, change = decision.change().name(), "decided");
        self.context.registry.stop(deciding);
        self.go_on(deciding).await?;
        unmirrored.map_or(Ok(()), |error| Err(error.into()))
    }

    /// Starts a run of a campaign whose state is `Running`, unless this process already runs it. Returns whether a run started.
    pub(super) async fn go_on(&self, deciding: &Deciding) -> Result<bool, CampaignError> {
        let record = self.record(deciding.id.as_str()).await?;
        if record.state != CampaignState::Running || self.context.registry.snapshot(&deciding.id).active {
            return Ok(false);
        }
        self.start(deciding, &record)?;
        Ok(true)
    }
}
