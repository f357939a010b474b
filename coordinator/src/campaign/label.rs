//! The label stage of a round that nobody attends: the synthetic annotator labels in a person's place.

use super::{
    CampaignError,
    live::Live,
    run::{Means, Outcome},
};
use crate::{blocking::blocking, labels::RequestId, model::CampaignRecord, store::Store};

/// Has the synthetic annotator label as many individuals as a round asks for, and begins to learn from the labels.
pub(super) async fn label(
    means: &Means,
    record: CampaignRecord,
    live: &mut Live,
) -> Result<Outcome, CampaignError> {
    let Some(feedback) = record.spec.feedback() else {
        return Ok(Outcome::Done);
    };
    let (strategy, count) = (feedback.strategy(), feedback.labels() as usize);
    let interrupt = live.interrupt().clone();
    let answers = |headway| {
        let annotator = &means.annotator;
        annotator.answers(&record, strategy, count, headway, &interrupt)
    };
    let answered = live.until_stopped(answers).await;
    let Some(answers) = answered else {
        return Ok(Outcome::Stopped);
    };
    let answers = answers?;
    let request = RequestId::of_round(record.rounds_done + 1);
    let id = record.id.clone();
    let answer = move |store: &Store| store.answer_round(&id, &request, answers.clone());
    if means.commit(live, answer).await?.is_none() {
        return Ok(Outcome::Stopped);
    }
    let store = means.store.clone();
    blocking(move || {
        let labels = store.labels(&record.id)?;
        super::decisions::check_lesson(&record.id, &labels)
    })
    .await??;
    Ok(Outcome::Done)
}
