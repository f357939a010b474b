//! A run of a campaign: one stage after the other, each continued from its state on disk.

use super::{
    CampaignError,
    context::{StageContext, read},
    dataset, embed, fine_tune, label, reverify,
    run_handle::RunHandle,
    search, train,
};
use murmuration_model::{CampaignId, CampaignState, RunId, Stage};
use murmuration_search::interrupt::Interrupted;
use murmuration_store::{Store, Suspects};

/// Runs the campaign from its state on disk until it is complete, failed or stopped, with the context of the run.
pub(super) async fn run(context: StageContext, run: RunId, mut handle: RunHandle) {
    let id = run.campaign().clone();
    match stages(&context, &run, &mut handle).await {
        Ok(()) => tracing::info!(campaign = %id, "completed"),
        // The client already knows of a decision. After a shutdown, the next coordinator continues the campaign.
        Err(error) if error.is_stop() => {}
        Err(error) => {
            let message = error.to_string();
            tracing::error!(campaign = %id, error = message, "failed");
            handle.failed(&message);
            let record = move |store: &Store| store.set_state(&id, CampaignState::Failed, &message);
            if let Err(error) = context.store.run(record).await {
                tracing::warn!(%error, "the failure could not be recorded");
            }
        }
    }
}

async fn stages(context: &StageContext, run: &RunId, handle: &mut RunHandle) -> Result<(), CampaignError> {
    let id = run.campaign();
    let mut before = None;
    loop {
        handle.interrupt.check()?;
        let (suspects, seen) = suspects(context, id, handle).await?;
        let record = read(&context.store, id).await?;
        if record.state != CampaignState::Running || record.run_id() != *run {
            return Err(Interrupted.into());
        }
        handle.begin();
        if !suspects.is_empty() {
            reverify::reverify(context, &record, suspects, handle).await?;
            before = None;
            continue;
        }
        // A stage that changes nothing would repeat for ever.
        if before.replace((record.clone(), seen)).as_ref() == Some(&(record.clone(), seen)) {
            return Err(CampaignError::Broken);
        }
        let stage = Stage::of(&record);
        tracing::info!(campaign = %id, ?stage, "begins");
        match stage {
            Stage::Dataset => dataset::collect(context, record, handle).await?,
            Stage::Pretrain => train::pretrain(context, record, handle).await?,
            Stage::Embed => embed::embed(context, record, handle).await?,
            Stage::Label => label::label(context, record, handle).await?,
            Stage::FineTune => fine_tune::fine_tune(context, record, handle).await?,
            Stage::Evolve => search::evolve(context, record, seen, handle).await?,
            // If `complete` returns false, a worker was quarantined meanwhile.
            Stage::Taxonomy if search::complete(context, record, seen, handle).await? => return Ok(()),
            Stage::Taxonomy => {}
        }
    }
}

/// Results of a campaign that only quarantined machines have computed, and the number of these machines. The machines are also
/// recorded on disk.
async fn suspects(
    context: &StageContext,
    id: &CampaignId,
    handle: &RunHandle,
) -> Result<(Suspects, usize), CampaignError> {
    let quarantined = context.dispatch.quarantined().borrow().clone();
    let seen = quarantined.len();
    if seen == 0 {
        return Ok((Suspects::default(), seen));
    }
    let remember = move |store: &Store| store.quarantine(&quarantined);
    context.commit(&handle.commit_handle(), remember).await?;
    let id = id.clone();
    let suspects = context.store.run(move |store| store.suspects(&id)).await?;
    Ok((suspects, seen))
}
