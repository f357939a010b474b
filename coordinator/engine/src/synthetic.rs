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
use murmuration_proto::{Class, Strategy, World};
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
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Query(#[from] QueryError),
    #[error(transparent)]
    Job(#[from] JobError),
    /// A bug: it broke off.
    #[error(transparent)]
    Broken(#[from] Broken),
}

/// The synthetic annotator of a coordinator; cheap to clone.
#[derive(Debug, Clone)]
pub struct SyntheticAnnotator {
    pub store: Store,
    /// The order in which it is asked about them.
    pub queries: Queries,
    /// The workers that simulate their motion.
    pub dispatch: Dispatch,
}

impl SyntheticAnnotator {
    /// Its answers for the first `count` individuals in the strategy's order that nobody has answered about, fewer where
    /// there are not so many; nothing is written to the log. `job_progress` counts the answers; `interrupt` ends a clustering of the archive.
    ///
    /// With the same archive and log they are the same answers.
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
        let classes = self.classes(record, &asked, &job_progress).await?;
        let answer = |(index, class): (usize, Class)| {
            said(Action::Answer {
                index: index as u64,
                answer: Answer::Class(class.into()),
            })
        };
        Ok(asked.into_iter().zip(classes).map(answer).collect())
    }

    /// The classes of individuals, in their order; `job_progress` counts them.
    async fn classes(
        &self,
        record: &CampaignRecord,
        asked: &[usize],
        job_progress: &Arc<JobProgress>,
    ) -> Result<Vec<Class>, AnnotatorError> {
        let mut classes = Vec::with_capacity(asked.len());
        let agents = record.spec.world().agents() as usize;
        for part in asked.chunks((AGENTS_AT_ONCE / agents).clamp(1, AT_ONCE)) {
            let mut judging = JoinSet::new();
            for (place, &index) in part.iter().enumerate() {
                let (annotator, record, job_progress) = (self.clone(), record.clone(), job_progress.clone());
                judging.spawn(async move {
                    let class = annotator.class(&record, index as u64).await?;
                    job_progress.one_more();
                    Ok::<_, AnnotatorError>((place, class))
                });
            }
            let mut part = Vec::new();
            while let Some(class) = judging.join_next().await {
                part.push(class.map_err(|_| Broken)??);
            }
            part.sort_by_key(|&(place, _)| place);
            classes.extend(part.into_iter().map(|(_, class)| class));
        }
        Ok(classes)
    }

    async fn class(&self, record: &CampaignRecord, index: u64) -> Result<Class, AnnotatorError> {
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
        Ok(blocking(move || judge(&replay, &world).class()).await?)
    }
}

/// A change by the synthetic annotator, now.
fn said(action: Action) -> Change {
    Change {
        annotator: Annotator::synthetic(),
        time_ms: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_millis() as u64),
        action,
    }
}
