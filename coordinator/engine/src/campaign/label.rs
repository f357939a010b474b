//! The label stage of an unattended round: the synthetic annotator labels in place of a person.

use super::{CampaignError, context::StageContext, run_handle::RunHandle};
use murmuration_model::{CampaignRecord, labels::RequestId};
use murmuration_store::Store;

/// Stores the synthetic annotator's labels of a round, and begins the round's training.
pub(super) async fn label(
    context: &StageContext,
    record: CampaignRecord,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let Some(feedback) = record.spec.feedback() else {
        return Ok(());
    };
    let (strategy, count) = (feedback.strategy(), feedback.labels() as usize);
    let interrupt = handle.interrupt.clone();
    let answers = |job_progress| {
        let annotator = &context.annotator;
        annotator.answers(&record, strategy, count, job_progress, &interrupt)
    };
    let answers = handle.until_stopped(answers).await??;
    let request = RequestId::of_round(record.rounds.done + 1);
    let id = record.id.clone();
    let answer = move |store: &Store| store.answer_round(&id, &request, answers.clone());
    context.commit(&handle.commit_handle(), answer).await?;
    let check = move |store: &Store| {
        let labels = store.labels(&record.id)?;
        super::preconditions::check_classes(&record.id, &labels)
    };
    context.store.run(check).await
}
