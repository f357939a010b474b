//! The committee stage: a trainer makes the embedders that the campaign's own is compared with, one after the other. Each
//! is trained as that one was, with a seed of its own, and learns in each round what that one learned.

use super::{
    CampaignError,
    fine_tune::on_labels,
    live::Live,
    run::{Means, Outcome, blocking},
    train::train,
};
use crate::store::{CampaignRecord, Store};
use murmuration_proto::{EmbedderSource, Feedback, training::Configuration};

/// Has the next member that is not ready trained, or fine-tuned on what the last round learned from, and seated.
pub(super) async fn train_member(
    means: &Means,
    record: CampaignRecord,
    live: &mut Live,
) -> Result<Outcome, CampaignError> {
    let (Some(EmbedderSource::Trained { training, .. }), Some(feedback)) =
        (record.spec.embedder(), record.spec.feedback())
    else {
        return Ok(Outcome::Done);
    };
    let (store, id) = (means.store.clone(), record.id.clone());
    let members = blocking(move || store.committee(&id)).await??;
    let seated = members.get(record.members_ready as usize).copied();
    let member = record.members_ready + 1;
    let (training, rounds) = match seated.zip(record.learned) {
        Some(lesson) => {
            let training = on_labels(means, &record, feedback, lesson).await?;
            (training, record.rounds_done)
        }
        None => ((without_labels(training, member)?, None), 0),
    };
    let Some(checkpoint) = train(means, &record, training, live).await? else {
        return Ok(Outcome::Stopped);
    };
    let seat = move |store: &Store| store.seat_member(&record.id, member, rounds, checkpoint);
    Ok(Outcome::of(means.commit(live, seat).await?))
}

/// As the campaign's own embedder is trained, with the member's seed.
fn without_labels(own: &Configuration, member: u32) -> Result<Configuration, CampaignError> {
    let seed = Feedback::member_seed(own.seed(), member);
    own.with_seed(seed).map_err(|_| CampaignError::Broken)
}
