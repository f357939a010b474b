//! The pretrain stage: a trainer makes the embedder, and the campaign moves to it.

use super::{
    CampaignError, CampaignId,
    live::Live,
    run::{Means, Outcome, blocking},
};
use crate::{
    dispatch::TrainingJob,
    store::{CampaignRecord, SavedTraining, Store},
};
use murmuration_proto::EmbedderSource;
use tokio::sync::watch;

/// Has the embedder trained, keeping what the trainer puts aside, and has the campaign move to the checkpoint.
pub(super) async fn pretrain(
    means: &Means,
    record: CampaignRecord,
    live: &mut Live,
) -> Result<Outcome, CampaignError> {
    let Some(EmbedderSource::Trained { dataset, training }) = record.spec.embedder() else {
        return Ok(Outcome::Done);
    };
    let (progress, mut reports) = watch::channel(None);
    let (saved, snapshots) = watch::channel(None);
    let job = TrainingJob {
        campaign: record.id.clone(),
        configuration: (**training).clone(),
        side: record.spec.image().resolution(),
        views: dataset.starts(),
        behaviours: dataset.controllers(),
        progress,
        saved,
    };
    let keeping = tokio::spawn(keep(means.store.clone(), record.id.clone(), snapshots));
    let trained = {
        let training = means.trainers.train(job);
        tokio::pin!(training);
        loop {
            tokio::select! {
                biased;
                () = live.stopped() => break None,
                checkpoint = &mut training => break Some(checkpoint),
                Ok(()) = reports.changed() => live.training(*reports.borrow_and_update()),
            }
        }
    };
    // The job is over, so there are no further snapshots: the last is on disk when this ends.
    if keeping.await.is_err() {
        return Err(CampaignError::Broken);
    }
    let Some(checkpoint) = trained else {
        return Ok(Outcome::Stopped);
    };
    let checkpoint = checkpoint?;
    means.checkpoints.describe(checkpoint).await?;
    let (store, id) = (means.store.clone(), record.id);
    blocking(move || store.move_to(&id, checkpoint)).await??;
    Ok(Outcome::Done)
}

/// Writes the newest snapshot to disk, again and again until there will be no more.
async fn keep(store: Store, id: CampaignId, mut snapshots: watch::Receiver<Option<SavedTraining>>) {
    while snapshots.changed().await.is_ok() {
        let Some(training) = snapshots.borrow_and_update().clone() else {
            continue;
        };
        let (store, id) = (store.clone(), id.clone());
        match blocking(move || store.save_training(&id, &training)).await {
            Ok(Ok(())) => {}
            // Only time would be lost: the training goes on, and a later snapshot may fit.
            Ok(Err(error)) => tracing::warn!(%error, "a training could not be put aside"),
            Err(error) => tracing::warn!(%error, "a training could not be put aside"),
        }
    }
}
