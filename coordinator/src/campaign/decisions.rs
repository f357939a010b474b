//! What people decide about a campaign: stopped, the decision written, going on from there.

use super::{
    CampaignError, CampaignId, CampaignState, CampaignStatus, Campaigns, Change, NotAllowed,
    campaigns::{AtWork, AtWorkById},
    run::blocking,
};
use crate::store::{CampaignRecord, Store, StoreError};

impl Campaigns {
    /// Pauses, resumes or cancels a campaign; its new status is on disk when this returns.
    ///
    /// # Errors
    /// If there is no such campaign or its state does not allow the change.
    pub async fn change(&self, id: &str, change: Change) -> Result<CampaignStatus, CampaignError> {
        let mut at_work = self.at_work.lock().await;
        let record = self.record(id).await?;
        let id = record.id.clone();
        let failed = at_work
            .get(&id)
            .is_some_and(|work| work.progress.borrow().failed.is_some());
        let from = if failed {
            CampaignState::Failed
        } else {
            record.state
        };
        let state = from.after(change).ok_or_else(|| NotAllowed {
            id: id.clone(),
            change,
            state: from,
        })?;
        let busy = at_work.get(&id).is_some_and(AtWork::is_busy);
        if change == Change::Resume && busy {
            drop(at_work);
            return self.status(id.as_str()).await;
        }
        let decision = move |store: &Store, id: &CampaignId| {
            // It may have completed while it was being stopped.
            if store.campaign(id.as_str())?.state != CampaignState::Completed {
                store.set_state(id, state, "")?;
            }
            Ok(())
        };
        self.decide(&mut at_work, record, decision).await?;
        drop(at_work);
        tracing::info!(campaign = %id, change = change.name(), "changed");
        self.status(id.as_str()).await
    }

    /// Stops a campaign, writes the decision about it, and has it go on if it is running then. Where the decision cannot
    /// be written, it goes on as if there had been none.
    pub(super) async fn decide(
        &self,
        at_work: &mut AtWorkById,
        record: CampaignRecord,
        decision: impl FnOnce(&Store, &CampaignId) -> Result<(), StoreError> + Send + 'static,
    ) -> Result<(), CampaignError> {
        let id = record.id.clone();
        let busy = at_work.get(&id).is_some_and(AtWork::is_busy);
        if busy && let Some(work) = at_work.remove(&id) {
            work.end().await;
        }
        let store = self.means.store.clone();
        let decided = blocking(move || {
            decision(&store, &id)?;
            store.campaign(id.as_str())
        })
        .await?;
        match decided {
            Ok(record) => {
                // What was left of a search that had ended.
                at_work.remove(&record.id);
                if record.state == CampaignState::Running {
                    self.start(at_work, record)?;
                }
                Ok(())
            }
            Err(error) => {
                if busy {
                    self.go_on(at_work, &record.id).await?;
                }
                Err(error.into())
            }
        }
    }

    /// Has a campaign that was stopped go on, unless it has ended.
    async fn go_on(&self, at_work: &mut AtWorkById, id: &CampaignId) -> Result<(), CampaignError> {
        let record = self.record(id.as_str()).await?;
        match record.state {
            CampaignState::Running => self.start(at_work, record),
            _ => Ok(()),
        }
    }
}
