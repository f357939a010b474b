//! The synthetic annotator: answers in a person's place, by what the rule-based judge says of a motion.

use crate::{
    blocking::{Broken, blocking},
    queries::{Queries, QueryError},
};
use murmuration_dispatch::{Dispatch, JobError, JobProgress, ReplayJob};
use murmuration_judge as judge;
use murmuration_judge::judge;
use murmuration_model::{
    CampaignRecord,
    labels::{Action, Annotator, Answer, Change},
};
use murmuration_proto::{Strategy, World};
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{ArchivedIndividual, Store, StoreError};
use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};
use tokio::task::JoinSet;

/// Motions that are simulated and judged at a time, where swarms are not so large that fewer agents fit.
const AT_ONCE: usize = 64;
/// Agents that are judged at a time: the judge compares each of a swarm with each other.
const AGENTS_AT_ONCE: usize = 20_000;

/// Why the synthetic annotator cannot answer.
#[derive(Debug, thiserror::Error)]
pub enum AnnotatorError {
    /// The store could not be read.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// What to ask it could not be found out.
    #[error("{0}")]
    Query(#[from] QueryError),
    /// A motion could not be simulated.
    #[error("{0}")]
    Job(#[from] JobError),
    /// A bug: it broke off.
    #[error("{0}")]
    Broken(#[from] Broken),
}

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
    /// there are not so many; nothing is written to the log. `job_progress` counts the answers; `interrupt` ends a clustering of the archive.
    ///
    /// With the same archive and log they are the same answers.
    ///
    /// # Errors
    /// See [`AnnotatorError`].
    pub async fn answers(
        &self,
        record: &CampaignRecord,
        strategy: Strategy,
        count: usize,
        job_progress: Arc<JobProgress>,
        interrupt: &Interrupt,
    ) -> Result<Vec<Change>, AnnotatorError> {
        let asked = self
            .queries
            .unanswered(record, strategy, count, interrupt)
            .await?;
        let mut answers = Vec::new();
        let agents = record.spec.world().agents() as usize;
        for part in asked.chunks((AGENTS_AT_ONCE / agents).clamp(1, AT_ONCE)) {
            let mut answering = JoinSet::new();
            for (place, &index) in part.iter().enumerate() {
                let (annotator, record, job_progress) = (self.clone(), record.clone(), job_progress.clone());
                answering.spawn(async move {
                    let answer = annotator.answer(&record, index as u64).await?;
                    job_progress.one_more();
                    Ok::<_, AnnotatorError>((place, answer))
                });
            }
            let mut part = Vec::new();
            while let Some(answer) = answering.join_next().await {
                part.push(answer.map_err(|_| Broken)??);
            }
            part.sort_by_key(|&(place, _)| place);
            answers.extend(part.into_iter().map(|(_, answer)| answer));
        }
        Ok(answers)
    }

    async fn answer(&self, record: &CampaignRecord, index: u64) -> Result<Change, AnnotatorError> {
        let (store, id, model) = (self.store.clone(), record.id.clone(), record.spec.model().clone());
        let ArchivedIndividual { controller, seed, .. } =
            blocking(move || store.individual(&id, &model, index)).await??;
        let world: World = record.spec.world().clone();
        let job = ReplayJob {
            campaign: record.id.clone(),
            controller,
            frames: judge::frames(&world),
            world: world.clone(),
            seed,
        };
        let replay = self.dispatch.replay(job).await?;
        let class = blocking(move || judge(&replay, &world).class()).await?;
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
