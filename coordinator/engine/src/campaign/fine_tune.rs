//! The fine-tune stage: a trainer trains the campaign's embedder further on labels, and the campaign moves to the new checkpoint.

use super::{
    CampaignError,
    context::{StageContext, pictures_at_once},
    evaluate::evaluate,
    run_handle::RunHandle,
    train::train,
};
use murmuration_dispatch::{EvaluationJob, FineTuningParams};
use murmuration_model::{CampaignRecord, NextTraining};
use murmuration_store::{FurtherStart, RoundPictures, Store};
use murmuration_swarm::{
    CheckpointDigest, Feedback,
    training::{Configuration, ConfigurationError},
};

/// Maximum number of pictures from further starts that are simulated and committed together.
const CHUNK: usize = 1000;

/// Fine-tunes the embedder on the labels of the current round, on a trainer, and moves the campaign to the new checkpoint.
pub(super) async fn fine_tune(
    context: &StageContext,
    record: CampaignRecord,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let (Some(NextTraining::FineTuning { parent, cutoff }), Some(feedback)) =
        (NextTraining::of(&record), record.spec.feedback())
    else {
        return Ok(());
    };
    further_starts(context, &record, cutoff, handle).await?;
    let pictures = read(context, &record, cutoff).await?;
    let fine_tuning = FineTuningParams {
        parent,
        labelled: pictures.pictures.len() as u32,
        labels: pictures.labels,
    };
    let configuration = configuration(context, parent, feedback).await?;
    let checkpoint = train(context, &record, configuration, Some(fine_tuning), handle).await?;
    let finish = move |store: &Store| store.finish_round(&record.id, checkpoint);
    context.commit(&handle.commit_handle(), finish).await
}

async fn read(
    context: &StageContext,
    record: &CampaignRecord,
    cutoff: u64,
) -> Result<RoundPictures, CampaignError> {
    let record = record.clone();
    let read = move |store: &Store| store.round_pictures(&record, cutoff);
    Ok(context.store.run(read).await?)
}

/// Simulates labelled controllers from further starts on the workers, if the pictures are not on disk yet. A controller keeps its
/// class from every start.
async fn further_starts(
    context: &StageContext,
    record: &CampaignRecord,
    cutoff: u64,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let missing = read(context, record, cutoff).await?.missing;
    let mut place = record.pictures_done;
    for starts in missing.chunks(pictures_at_once(record.spec.image(), CHUNK)) {
        let tasks = starts
            .iter()
            .map(|start| (start.controller.clone(), start.seed))
            .collect();
        let job = EvaluationJob::of(record, None, tasks);
        // If the task of a further start is poisoned, the labelled start replaces it: the labelled start has already been
        // simulated.
        let labelled = |place: usize, _| {
            let FurtherStart {
                controller, labelled, ..
            } = &starts[place];
            Ok(vec![(place, (controller.clone(), *labelled))])
        };
        let evaluated = |progress| evaluate(&context.dispatch, progress, job, labelled);
        let done = handle.until_stopped(evaluated).await??;
        let (pictures, provenance) = done.into_pictures(|_, reason| {
            format!(
                "the task of a labelled controller's additional start was poisoned, and its labelled start was used \
                 instead: {reason}"
            )
        });
        let (id, count) = (record.id.clone(), pictures.len() as u64);
        let add = move |store: &Store| store.add_pictures(&id, place, &pictures, &provenance);
        context.commit(&handle.commit_handle(), add).await?;
        place += count;
    }
    Ok(())
}

/// The configuration of the parent checkpoint, with the recipe for labels.
async fn configuration(
    context: &StageContext,
    parent: CheckpointDigest,
    feedback: &Feedback,
) -> Result<Configuration, CampaignError> {
    let untrainable = |error: ConfigurationError| CampaignError::Untrainable {
        checkpoint: parent,
        reason: error.to_string(),
    };
    let lineage = context.checkpoints.describe(parent).await?.lineage;
    let configuration = Configuration::from_toml(&lineage.configuration).map_err(untrainable)?;
    let configuration = configuration.with_recipe(feedback.recipe().clone());
    configuration.map_err(|error| untrainable(error.into()))
}
