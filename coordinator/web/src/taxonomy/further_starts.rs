//! The rule-based judge's verdicts on further starts of medoids. Workers simulate and judge the motions. The latest verdicts stay
//! in memory; no verdict is stored on disk.

use crate::Web;
use murmuration_dispatch::{Evaluated, EvaluationJob};
use murmuration_model::CampaignRecord;
use murmuration_service::{self as service, OrStatus as _};
use murmuration_store::Store;
use murmuration_swarm::{Controller, Purpose, RandomStream, Starts, Verdict};
use rand::RngExt as _;
use std::{
    collections::{BTreeMap, VecDeque},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};
use tonic::Status;

/// Number of further starts of a medoid.
pub(super) const STARTS: u64 = 20;
/// Maximum number of individuals whose further starts are kept; the pictures of an individual take some 50 kB.
const MOST_STARTS: usize = 64;

/// The latest further starts. A clone is cheap.
#[derive(Debug, Clone, Default)]
pub struct FurtherStarts {
    latest: Arc<Mutex<Latest>>,
    /// Only one request at a time asks the workers about the same individual; the others wait for its starts.
    asking: service::Recent<()>,
}

/// A further start of an individual.
#[derive(Debug)]
pub(super) struct Start {
    pub(super) verdict: Verdict,
    pub(super) image: Vec<u8>,
}

/// The key of an individual: the id and the origin of its campaign, and its index.
type Key = (String, String, u64);

fn key(record: &CampaignRecord, index: u64) -> Key {
    (record.id.to_string(), record.archive_version().origin(), index)
}

/// The newest starts, sorted with the oldest first.
#[derive(Debug, Default)]
struct Latest(VecDeque<(Key, Arc<Vec<Start>>)>);

impl Latest {
    fn get(&self, key: &Key) -> Option<Arc<Vec<Start>>> {
        let found = self.0.iter().find(|(known, _)| known == key);
        found.map(|(_, starts)| Arc::clone(starts))
    }

    fn add(&mut self, key: Key, starts: Arc<Vec<Start>>) {
        self.0.retain(|(known, _)| *known != key);
        self.0.push_back((key, starts));
        while self.0.len() > MOST_STARTS {
            self.0.pop_front();
        }
    }
}

fn lock(mutex: &Mutex<Latest>) -> std::sync::MutexGuard<'_, Latest> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl FurtherStarts {
    /// [`STARTS`] further starts of an individual. These starts are different from those of its trials.
    pub(super) async fn of(
        &self,
        web: &Web,
        record: &CampaignRecord,
        index: u64,
    ) -> Result<Arc<Vec<Start>>, Status> {
        let key = key(record, index);
        if let Some(known) = lock(&self.latest).get(&key) {
            return Ok(known);
        }
        let asking = self.asking.follow(format!("starts of {key:?}"));
        let ask = self.further_starts(web, record, index, &key);
        asking.within(Duration::ZERO, ask).await?;
        lock(&self.latest)
            .get(&key)
            .ok_or_else(|| Status::unavailable("others asked for many starts meanwhile: try again"))
    }

    /// Lets workers simulate and judge the further starts of an individual, unless they are known.
    async fn further_starts(
        &self,
        web: &Web,
        record: &CampaignRecord,
        index: u64,
        key: &Key,
    ) -> Result<(), Status> {
        if lock(&self.latest).get(key).is_some() {
            return Ok(());
        }
        let (id, model) = (record.id.clone(), record.spec.model().clone());
        let read = move |store: &Store| store.individual(&id, &model, index);
        let individual = web.store.run(read).await.or_status()?;
        let seed = |start| RandomStream::derive(individual.seed, Purpose::FurtherTrial, start).random();
        let first = u64::from(Starts::MAX);
        let tasks = (first..first + STARTS).map(|start| (individual.controller.clone(), seed(start)));
        let evaluated = evaluated(web, record, tasks.collect()).await?;
        let starts: Arc<Vec<Start>> = Arc::new(evaluated.into_iter().flatten().collect());
        lock(&self.latest).add(key.clone(), starts);
        Ok(())
    }
}

/// The result of each task, simulated in the world of a campaign; `None` if the task was given up.
async fn evaluated(
    web: &Web,
    record: &CampaignRecord,
    tasks: Vec<(Controller, u64)>,
) -> Result<Vec<Option<Start>>, Status> {
    if tasks.is_empty() {
        return Ok(Vec::new());
    }
    let dispatch = &web.archive.dispatch;
    dispatch.check_staffed().or_status()?;
    let job = EvaluationJob {
        submitter: None,
        judges: true,
        ..EvaluationJob::of(record, None, tasks)
    };
    let evaluated = dispatch
        .while_staffed(dispatch.evaluate(job, Arc::default()))
        .await;
    let evaluated = evaluated.or_status()?.or_status()?;
    let start = |evaluated| match evaluated {
        Evaluated::Done { mut trials, .. } => {
            let trial = trials.pop()?;
            Some(Start {
                verdict: trial.verdict()?,
                image: trial.into_image().pixels().ok()?,
            })
        }
        Evaluated::Poisoned(_) => None,
    };
    Ok(evaluated.into_iter().map(start).collect())
}

/// The most frequent verdict; if several verdicts are equally frequent, the first of them.
pub(super) fn most_frequent(verdicts: impl Iterator<Item = Verdict>) -> Option<Verdict> {
    counted(verdicts).first().map(|(verdict, _)| *verdict)
}

/// The distinct verdicts with their counts, most frequent first.
pub(super) fn counted(verdicts: impl Iterator<Item = Verdict>) -> Vec<(Verdict, usize)> {
    let mut counts: BTreeMap<Verdict, usize> = BTreeMap::new();
    for verdict in verdicts {
        *counts.entry(verdict).or_default() += 1;
    }
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::{Class, Pattern};

    #[test]
    fn the_most_frequent_is_first() {
        let (milling, chain) = (Verdict::Class(Class::Milling), Verdict::Pattern(Pattern::Chain));
        let message = [chain, milling, chain, milling, chain];
        assert_eq!(counted(message.into_iter()), [(chain, 3), (milling, 2)]);
        assert_eq!(most_frequent(message.into_iter()), Some(chain));
        assert_eq!(most_frequent(std::iter::empty()), None);
    }

    #[test]
    fn the_oldest_starts_are_forgotten_first_and_newer_ones_take_their_place() {
        let of = |index| ("small-1".to_owned(), "5".to_owned(), index);
        let mut latest = Latest::default();
        let starts = || Arc::new(Vec::new());
        for index in 0..MOST_STARTS as u64 {
            latest.add(of(index), starts());
        }
        let newer = starts();
        latest.add(of(0), Arc::clone(&newer));
        latest.add(of(99), starts());
        assert!(latest.get(&of(0)).is_some_and(|kept| Arc::ptr_eq(&kept, &newer)));
        assert!(latest.get(&of(1)).is_none() && latest.get(&of(2)).is_some());
    }
}
