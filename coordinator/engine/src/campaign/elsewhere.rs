//! Swarms that are not of a campaign, evaluated as it evaluates its own.

use super::{CampaignError, Campaigns};
use murmuration_dispatch::{Evaluated, EvaluationJob, JobError};
use murmuration_model::CampaignRecord;
use murmuration_proto::{Controller, Evaluation, World};
use std::sync::Arc;

impl Campaigns {
    /// Has a worker evaluate a controller in a world of its own, with the picture and the embedder of a campaign: somebody waits
    /// for it. Nothing of it is stored.
    ///
    /// # Errors
    /// If no worker is connected for a while, the evaluation fails, or the campaign's checkpoint cannot be read.
    pub async fn evaluate_elsewhere(
        &self,
        record: &CampaignRecord,
        (controller, seed): (Controller, u64),
        world: World,
    ) -> Result<Evaluation, CampaignError> {
        let job = EvaluationJob {
            model: controller.model().clone(),
            world,
            ..EvaluationJob::of(
                record,
                self.context.embedder(record).await?,
                vec![(controller, seed)],
            )
        };
        let dispatch = &self.context.dispatch;
        let evaluated = dispatch.while_staffed(dispatch.evaluate(job, Arc::default()));
        match evaluated.await??.pop() {
            Some(Evaluated::Done { trials, .. }) => trials.into_iter().next().ok_or(CampaignError::Broken),
            Some(Evaluated::Poisoned(reason)) => Err(JobError::Poisoned(reason).into()),
            None => Err(CampaignError::Broken),
        }
    }
}
