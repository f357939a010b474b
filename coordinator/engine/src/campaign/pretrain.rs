//! The pretrain stage: a trainer makes the embedder, and the campaign moves to it.

use super::{
    CampaignError,
    context::{Outcome, StageContext},
    run_handle::RunHandle,
    train::train,
};
use murmuration_model::CampaignRecord;
use murmuration_proto::EmbedderSource;
use murmuration_store::Store;

/// Has the embedder trained, and the campaign move to the checkpoint.
pub(super) async fn pretrain(
    context: &StageContext,
    record: CampaignRecord,
    handle: &mut RunHandle,
) -> Result<Outcome, CampaignError> {
    let Some(EmbedderSource::Trained { training, .. }) = record.spec.embedder() else {
        return Ok(Outcome::Done);
    };
    let configuration = (**training).clone();
    let Some(checkpoint) = train(context, &record, (configuration, None), handle).await? else {
        return Ok(Outcome::Stopped);
    };
    let begin = move |store: &Store| store.move_to(&record.id, checkpoint);
    Ok(Outcome::of(context.commit(&handle.commit_handle(), begin).await?))
}
