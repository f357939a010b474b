//! A campaign at work: one stage after the other, each begun where the disk says that it was left.

use super::{
    CampaignError,
    context::{Outcome, StageContext, read},
    dataset, embed, fine_tune, label, reverify,
    run_handle::RunHandle,
    search, train,
};
use crate::blocking::blocking;
use murmuration_model::{CampaignId, CampaignState, RunId, Stage};
use murmuration_store::{Store, Suspects};

/// Runs the campaign from where it stands until it is complete, failed or stopped; with the context of the run.
pub(super) async fn run(context: StageContext, run: RunId, mut handle: RunHandle) {
    let id = run.campaign().clone();
    match stages(&context, &run, &mut handle).await {
        Ok(Outcome::Done) => tracing::info!(campaign = %id, "completed"),
        Ok(Outcome::Stopped) => {}
        // A decision has been told to people already; after a shutdown the campaign is to go on with the next coordinator.
        Err(error) if error.is_stop() => {}
        Err(error) => {
            let said = error.to_string();
            tracing::error!(campaign = %id, error = said, "failed");
            handle.failed(&said);
            let store = context.store;
            let recorded = blocking(move || store.set_state(&id, CampaignState::Failed, &said)).await;
            if let Ok(Err(error)) = recorded {
                tracing::warn!(%error, "the failure could not be recorded");
            }
        }
    }
}

async fn stages(
    context: &StageContext,
    run: &RunId,
    handle: &mut RunHandle,
) -> Result<Outcome, CampaignError> {
    let id = run.campaign();
    let mut before = None;
    loop {
        handle.interrupt.check()?;
        let Some((suspects, seen)) = suspects(context, id, handle).await? else {
            return Ok(Outcome::Stopped);
        };
        let record = read(&context.store, id).await?;
        if record.state != CampaignState::Running || record.run_id() != *run {
            return Ok(Outcome::Stopped);
        }
        handle.begin();
        if !suspects.is_empty() {
            match reverify::reverify(context, &record, suspects, handle).await? {
                Outcome::Stopped => return Ok(Outcome::Stopped),
                Outcome::Done => before = None,
            }
            continue;
        }
        // A stage that leaves no trace would be begun for ever.
        if before.replace((record.clone(), seen)).as_ref() == Some(&(record.clone(), seen)) {
            return Err(CampaignError::Broken);
        }
        let stage = Stage::of(&record);
        tracing::info!(campaign = %id, ?stage, "begins");
        let outcome = match stage {
            Stage::Dataset => dataset::collect(context, record, handle).await?,
            Stage::Pretrain => train::pretrain(context, record, handle).await?,
            Stage::Embed => embed::embed(context, record, handle).await?,
            Stage::Label => label::label(context, record, handle).await?,
            Stage::FineTune => fine_tune::fine_tune(context, record, handle).await?,
            Stage::Evolve => search::evolve(context, record, seen, handle).await?,
            Stage::Taxonomy => match search::complete(context, record, handle).await? {
                Some(true) => return Ok(Outcome::Done),
                // A worker was found wrong meanwhile.
                Some(false) => Outcome::Done,
                None => Outcome::Stopped,
            },
        };
        if outcome == Outcome::Stopped {
            return Ok(Outcome::Stopped);
        }
    }
}

/// What of a campaign rests on the word of machines that were found wrong, and how many those are; on disk too. `None` if
/// the campaign is to stop.
async fn suspects(
    context: &StageContext,
    id: &CampaignId,
    handle: &RunHandle,
) -> Result<Option<(Suspects, usize)>, CampaignError> {
    let quarantined = context.dispatch.quarantined().borrow().clone();
    let seen = quarantined.len();
    if seen == 0 {
        return Ok(Some((Suspects::default(), seen)));
    }
    let remember = move |store: &Store| store.quarantine(&quarantined);
    if context.commit(&handle.commit_handle(), remember).await?.is_none() {
        return Ok(None);
    }
    let (store, id) = (context.store.clone(), id.clone());
    let suspects = blocking(move || store.suspects(&id)).await??;
    Ok(Some((suspects, seen)))
}
