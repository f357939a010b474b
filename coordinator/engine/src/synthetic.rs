//! The synthetic annotator: answers in place of a person, with the rule-based judge's verdict on a motion.

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
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{ArchivedIndividual, Store, StoreError};
use murmuration_swarm::{Class, Strategy, World};
use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};
use tokio::task::JoinSet;

/// Number of motions that are simulated and judged at a time; fewer if the swarms are large.
const AT_ONCE: usize = 64;
/// Number of agents that are judged at a time: the judge compares each agent of a swarm with every other agent.
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
    /// A bug ended the synthetic annotator.
    #[error(transparent)]
    Broken(#[from] Broken),
}

/// The synthetic annotator of a coordinator; cheap to clone.
#[derive(Debug, Clone)]
pub struct SyntheticAnnotator {
    pub store: Store,
    /// The source of the annotator's questions.
    pub queries: Queries,
    /// The workers that simulate the motions.
    pub dispatch: Dispatch,
}

impl SyntheticAnnotator {
    /// The annotator's answers for the first `count` individuals in the strategy's order that have no answer, or for all such
    /// individuals if there are fewer. Nothing is written to the log. `job_progress` counts the answers; `interrupt` ends the
    /// clustering of the archive.
    ///
    /// The same archive and log give the same answers.
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
            change(Action::Answer {
                index: index as u64,
                answer: Answer::Class(class.into()),
            })
        };
        Ok(asked.into_iter().zip(classes).map(answer).collect())
    }

    /// The class of each individual in `asked`, in that order. `job_progress` counts the classes.
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
        let (id, model) = (record.id.clone(), record.spec.model().clone());
        let read = move |store: &Store| store.individual(&id, &model, index);
        let ArchivedIndividual { controller, seed, .. } = self.store.run(read).await?;
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

/// A change by the synthetic annotator at the present time.
fn change(action: Action) -> Change {
    Change {
        annotator: Annotator::synthetic(),
        time_ms: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_millis() as u64),
        action,
    }
}
