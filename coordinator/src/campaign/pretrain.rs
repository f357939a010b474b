//! The pretrain stage: a trainer makes the embedder, and the campaign moves to it.

use super::{
    CampaignError,
    live::Live,
    run::{Means, Outcome},
    train::train,
};
use crate::{model::CampaignRecord, store::Store};
use murmuration_proto::EmbedderSource;

/// Has the embedder trained, and the campaign move to the checkpoint.
pub(super) async fn pretrain(
    means: &Means,
    record: CampaignRecord,
    live: &mut Live,
) -> Result<Outcome, CampaignError> {
    let Some(EmbedderSource::Trained { training, .. }) = record.spec.embedder() else {
        return Ok(Outcome::Done);
    };
    let configuration = (**training).clone();
    let Some(checkpoint) = train(means, &record, (configuration, None), live).await? else {
        return Ok(Outcome::Stopped);
    };
    let begin = move |store: &Store| store.move_to(&record.id, checkpoint);
    Ok(Outcome::of(means.commit(live, begin).await?))
}
