//! The fine-tune stage: a trainer goes on from the campaign's embedder, on labels, and the campaign moves to what comes
//! of it.

use super::{
    CampaignError, CampaignId,
    live::Live,
    run::{Means, Outcome, blocking},
    train::train,
};
use crate::{
    dispatch::Lesson,
    store::{CampaignRecord, Store},
};
use murmuration_proto::{
    CheckpointDigest, Feedback,
    training::{Configuration, ConfigurationError},
};

/// Has the embedder fine-tuned on the labels of the round that was begun, and the campaign move to the checkpoint.
pub(super) async fn fine_tune(
    means: &Means,
    record: CampaignRecord,
    live: &mut Live,
) -> Result<Outcome, CampaignError> {
    let (Some(parent), Some(entries), Some(feedback)) =
        (record.checkpoint, record.lesson, record.spec.feedback())
    else {
        return Ok(Outcome::Done);
    };
    let training = on_labels(means, &record.id, feedback, (parent, entries)).await?;
    let Some(checkpoint) = train(means, &record, training, live).await? else {
        return Ok(Outcome::Stopped);
    };
    let finish = move |store: &Store| store.finish_round(&record.id, checkpoint);
    Ok(Outcome::of(means.commit(live, finish).await?))
}

/// The training that goes on from `parent`, on the first `entries` of the label log.
pub(super) async fn on_labels(
    means: &Means,
    campaign: &CampaignId,
    feedback: &Feedback,
    (parent, entries): (CheckpointDigest, u64),
) -> Result<(Configuration, Option<Lesson>), CampaignError> {
    let (store, id) = (means.store.clone(), campaign.clone());
    let labels = blocking(move || store.lesson(&id, entries)).await??;
    let lesson = Lesson {
        parent,
        labelled: labels.lesson().len() as u32,
    };
    Ok((configuration(means, parent, feedback).await?, Some(lesson)))
}

/// That of the checkpoint to go on from, with the recipe for labels.
async fn configuration(
    means: &Means,
    parent: CheckpointDigest,
    feedback: &Feedback,
) -> Result<Configuration, CampaignError> {
    let untrainable = |error: ConfigurationError| CampaignError::Untrainable {
        checkpoint: parent,
        reason: error.to_string(),
    };
    let lineage = means.checkpoints.describe(parent).await?.lineage;
    let configuration = Configuration::from_toml(&lineage.configuration).map_err(untrainable)?;
    let configuration = configuration.with_recipe(feedback.recipe().clone());
    configuration.map_err(|error| untrainable(error.into()))
}
