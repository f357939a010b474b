//! A training as part of a stage: forwards the trainer's reports, and stores its snapshots.

use super::{
    CampaignError,
    context::StageContext,
    run_handle::{ABSENCE_LIMIT, Availability, COUNTING_INTERVAL, RunHandle, held_up_by},
};
use murmuration_dispatch::{ConnectedMachine, FineTuningParams, JobProgress, TrainingJob};
use murmuration_model::{CampaignId, CampaignRecord, SavedTraining, TimeLeft, TrainingPictures};
use murmuration_proto::v1;
use murmuration_search::interrupt::Interrupted;
use murmuration_store::{EpochRecord, Store, StoreError};
use murmuration_swarm::{CheckpointDigest, EmbedderSource, training::Configuration};
use std::{collections::BTreeSet, sync::Arc, time::Instant};
use tokio::sync::watch;

/// The pretrain stage: a trainer makes the embedder, and the campaign moves to it.
pub(super) async fn pretrain(
    context: &StageContext,
    record: CampaignRecord,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let Some(EmbedderSource::Trained { training, .. }) = record.spec.embedder() else {
        return Ok(());
    };
    let configuration = (**training).clone();
    let checkpoint = train(context, &record, configuration, None, handle).await?;
    let begin = move |store: &Store| store.move_to(&record.id, checkpoint);
    context.commit(&handle.commit_handle(), begin).await
}

/// Leases a training to a trainer, which publishes the embedder.
pub(super) async fn train(
    context: &StageContext,
    record: &CampaignRecord,
    configuration: Configuration,
    fine_tuning: Option<FineTuningParams>,
    handle: &mut RunHandle,
) -> Result<CheckpointDigest, CampaignError> {
    let epochs = configuration.recipe().epochs();
    let (progress, mut reports) = watch::channel(None);
    let (saved, snapshots) = watch::channel(None);
    let job = TrainingJob {
        campaign: record.id.clone(),
        weight: record.weight,
        configuration,
        shape: record.spec.image().shape(),
        pictures: TrainingPictures::of(record),
        fine_tuning,
        progress,
        saved,
    };
    let round = match &job.fine_tuning {
        Some(_) => record.rounds.done.saturating_add(1),
        None => 0,
    };
    let epochs_kept = tokio::spawn(keep_epochs(
        context.store.clone(),
        record.id.clone(),
        round,
        epochs,
        job.progress.subscribe(),
    ));
    let keeping = tokio::spawn(keep(context.store.clone(), record.id.clone(), snapshots));
    let trained = {
        let job_progress = Arc::<JobProgress>::default();
        let training = context.trainers.train(job, job_progress.clone());
        tokio::pin!(training);
        let stopped = handle.commit_handle();
        let mut trainers = Availability::trainers(context.trainers.connected());
        let mut tick = tokio::time::interval(COUNTING_INTERVAL);
        let begun = Instant::now();
        let mut has_begun = false;
        loop {
            tokio::select! {
                biased;
                () = stopped.stopped() => break Err(Interrupted.into()),
                checkpoint = &mut training => break checkpoint.map_err(CampaignError::from),
                Ok(()) = reports.changed() => {
                    has_begun = true;
                    let told = *reports.borrow_and_update();
                    handle.training(told.map(|told| v1::TrainingProgress {
                        epoch: told.epoch.min(epochs),
                        epochs,
                        ..told
                    }));
                }
                _ = tick.tick() => {
                    let missing = trainers.missing(Instant::now());
                    let busy = match missing.is_none() && !has_begun && begun.elapsed() > ABSENCE_LIMIT {
                        true => {
                            let left = |other: &CampaignId| context.registry.training_left(other);
                            all_busy(&record.id, &context.trainers.machines().await, left)
                        }
                        false => None,
                    };
                    handle.waiting(held_up_by(missing.or(busy), job_progress.trouble()));
                }
            }
        }
    };
    // No snapshots follow the end of the job. This waits until the last snapshot is on disk.
    if keeping.await.is_err() || epochs_kept.await.is_err() {
        return Err(CampaignError::Broken);
    }
    let checkpoint = trained?;
    // This check precedes the move: with a checkpoint for pictures of another size, the campaign could not continue.
    let embedder = context.checkpoints.embedder(checkpoint, record.spec.image());
    handle.unless_stopped(embedder).await??;
    Ok(checkpoint)
}

/// The message about trainers that all work for other campaigns than `campaign`; `None` if one is free, or works for it. `left` is
/// the time that a campaign's training still takes, if known.
fn all_busy(
    campaign: &CampaignId,
    trainers: &[ConnectedMachine],
    left: impl Fn(&CampaignId) -> Option<TimeLeft>,
) -> Option<String> {
    let of_others = |trainer: &ConnectedMachine| {
        let others = trainer
            .work
            .iter()
            .map(|work| work.campaign.clone().filter(|other| other != campaign));
        others
            .collect::<Option<Vec<CampaignId>>>()
            .filter(|others| !others.is_empty())
    };
    let others: Option<Vec<Vec<CampaignId>>> = trainers.iter().map(of_others).collect();
    let others: BTreeSet<CampaignId> = others?.concat().into_iter().collect();
    let in_words = |other: CampaignId| match left(&other) {
        Some(left) => format!("{other} ({})", left.in_words()),
        None => other.to_string(),
    };
    let others: Vec<String> = others.into_iter().map(in_words).collect();
    (!others.is_empty()).then(|| {
        let are = if trainers.len() == 1 {
            "the only trainer is"
        } else {
            "all trainers are"
        };
        format!("waits for a trainer: {are} at work for {}", others.join(" and "))
    })
}

/// Writes the metrics of each epoch to disk, for the curve of the training. If the disk is slower than the training, some epochs
/// are left out of the curve.
async fn keep_epochs(
    store: Store,
    id: CampaignId,
    round: u32,
    epochs: u64,
    mut reports: watch::Receiver<Option<v1::TrainingProgress>>,
) {
    while reports.changed().await.is_ok() {
        let Some(report) = *reports.borrow_and_update() else {
            continue;
        };
        let epoch = EpochRecord {
            round,
            epoch: report.epoch,
            loss: report.loss,
            accuracy: report.triplet_accuracy,
        };
        if !(1..=epochs).contains(&epoch.epoch) {
            continue;
        }
        let id = id.clone();
        match store.run(move |store| store.add_epoch(&id, &epoch)).await {
            Ok(()) | Err(StoreError::Superseded(_)) => {}
            // Only a point of the curve is lost.
            Err(error) => tracing::warn!(%error, "an epoch could not be kept"),
        }
    }
}

/// Writes the newest snapshot to disk, repeatedly, until no more snapshots arrive.
async fn keep(store: Store, id: CampaignId, mut snapshots: watch::Receiver<Option<SavedTraining>>) {
    while snapshots.changed().await.is_ok() {
        let Some(training) = snapshots.borrow_and_update().clone() else {
            continue;
        };
        let id = id.clone();
        match store.run(move |store| store.save_training(&id, &training)).await {
            // If the run is over, the next run continues from the previous snapshot.
            Ok(()) | Err(StoreError::Superseded(_)) => {}
            // A lost snapshot only costs time: the training continues, and the disk may have room for a later snapshot.
            Err(error) => tracing::warn!(%error, "a training could not be put aside"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_dispatch::{WorkInHand, WorkKind};

    fn trainer(campaigns: &[&str]) -> ConnectedMachine {
        let work = |id: &&str| WorkInHand {
            kind: WorkKind::Training,
            campaign: Some(id.parse().unwrap()),
            tasks: 1,
        };
        ConnectedMachine {
            name: "t".to_owned(),
            capacity: 1,
            work: campaigns.iter().map(work).collect(),
        }
    }

    #[test]
    fn a_training_that_waits_for_others_names_them() {
        let own = "own-1".parse().unwrap();
        let left = |id: &CampaignId| (id.as_str() == "a-1").then_some(TimeLeft::about(90.0));
        let busy = |trainers: &[ConnectedMachine]| all_busy(&own, trainers, left);
        let one = busy(&[trainer(&["other-3"])]).unwrap();
        assert_eq!(
            one,
            "waits for a trainer: the only trainer is at work for other-3"
        );
        let two = busy(&[trainer(&["other-3"]), trainer(&["a-1"])]).unwrap();
        assert_eq!(
            two,
            "waits for a trainer: all trainers are at work for a-1 (about 2 minutes) and other-3"
        );
        for free in [
            &[][..],
            &[trainer(&[])],
            &[trainer(&["own-1"])],
            &[trainer(&["a-1"]), trainer(&[])],
        ] {
            assert_eq!(busy(free), None);
        }
    }
}
