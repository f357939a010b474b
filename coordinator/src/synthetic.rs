//! The synthetic annotator: answers in a person's place, by what the rule-based judge says of a motion.

use crate::{
    campaign::{CampaignError, blocking},
    dispatch::{Dispatch, Headway, ReplayJob},
    judge::judge,
    labels::{Action, Annotator, Answer, Change},
    queries::Queries,
    store::{ArchivedIndividual, CampaignRecord, Store},
};
use murmuration_proto::{Strategy, World};
use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};
use tokio::task::JoinSet;

/// Motions that are simulated and judged at a time.
const AT_ONCE: usize = 64;
/// Steps between the frames that are judged: the judge looks at every fourth step.
const STRIDE: u32 = 4;

/// The synthetic annotator of a coordinator; cheap to clone.
#[derive(Debug, Clone)]
pub struct SyntheticAnnotator {
    /// Where the individuals are.
    pub store: Store,
    /// What says about which of them it is asked.
    pub queries: Queries,
    /// Who simulates their motion.
    pub dispatch: Dispatch,
}

impl SyntheticAnnotator {
    /// What it says of the first `count` individuals in the strategy's order that nobody has answered about, fewer where
    /// there are not so many; nothing is written to the log. `headway` counts the answers.
    ///
    /// With the same archive and log they are the same answers.
    ///
    /// # Errors
    /// If the store cannot be read, the strategy has not what it needs, or a motion cannot be simulated.
    pub async fn answers(
        &self,
        record: &CampaignRecord,
        strategy: Strategy,
        count: usize,
        headway: Arc<Headway>,
    ) -> Result<Vec<Change>, CampaignError> {
        let asked = self.queries.unanswered(record, strategy, count).await?;
        let mut answers = Vec::new();
        for part in asked.chunks(AT_ONCE) {
            let mut answering = JoinSet::new();
            for (place, &index) in part.iter().enumerate() {
                let (annotator, record, headway) = (self.clone(), record.clone(), headway.clone());
                answering.spawn(async move {
                    let answer = annotator.answer(&record, index as u64).await?;
                    headway.one_more();
                    Ok::<_, CampaignError>((place, answer))
                });
            }
            let mut part = Vec::new();
            while let Some(answer) = answering.join_next().await {
                part.push(answer.map_err(|_| CampaignError::Broken)??);
            }
            part.sort_by_key(|&(place, _)| place);
            answers.extend(part.into_iter().map(|(_, answer)| answer));
        }
        Ok(answers)
    }

    async fn answer(&self, record: &CampaignRecord, index: u64) -> Result<Change, CampaignError> {
        let (store, id, model) = (self.store.clone(), record.id.clone(), record.spec.model());
        let ArchivedIndividual { controller, seed, .. } =
            blocking(move || store.individual(&id, model, index)).await??;
        let world: World = *record.spec.world();
        let job = ReplayJob {
            campaign: record.id.clone(),
            controller,
            world,
            seed,
            stride: STRIDE,
        };
        let replay = self.dispatch.replay(job).await?;
        let class = blocking(move || judge(&replay, &world).class).await?;
        Ok(Change {
            annotator: Annotator::synthetic(),
            time_ms: SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .map_or(0, |age| age.as_millis() as u64),
            action: Action::Answer {
                index,
                answer: Answer::Class(class.into()),
            },
        })
    }
}
