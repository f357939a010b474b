//! Jobs of all kinds of work. The lease table counts votes, and each job keeps the results that the votes stand for.

use super::{
    DispatchMetrics, JobError, WorkKind,
    job::{PoisonedTask, Submitter, TrainingJob},
    leases::{Agree, JobParams, Refused, Settled, WorkerProcessId},
    work::Work,
};
use murmuration_model::CampaignId;
use murmuration_proto::v1::{self, batch_result::Outcome};
use murmuration_swarm::{EmbeddingKind, Invalid};
use std::fmt;
use tokio::sync::oneshot;

/// A result as the lease table counts it: a vote without the result's content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Vote {
    /// Index of the result among the results of its task.
    number: usize,
    /// Indices of the task's earlier results that count as the same result.
    agrees_with: Vec<usize>,
}

impl Agree for Vote {
    fn agrees_with(&self, other: &Self) -> bool {
        self.number == other.number
            || self.agrees_with.contains(&other.number)
            || other.agrees_with.contains(&self.number)
    }
}

/// A result that no sound worker sends.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unsound {
    #[error(transparent)]
    Result(#[from] Invalid),
    #[error(transparent)]
    Count(#[from] Refused),
}

/// Context for the end of a job: names of processes, and metrics.
pub(super) struct Closing<'a> {
    pub(super) names: &'a dyn Fn(&[WorkerProcessId]) -> Vec<String>,
    pub(super) metrics: &'a DispatchMetrics,
}

/// A job, whatever its work.
pub(super) trait AnyJob: fmt::Debug + Send {
    fn kind(&self) -> WorkKind;
    fn campaign(&self) -> Option<&CampaignId>;
    fn submitter(&self) -> Option<Submitter>;
    /// Parameters for the lease table. If the work is audited, `audited` decides for each task whether a second machine repeats
    /// the task.
    fn params(&self, audited: &mut dyn FnMut() -> bool) -> JobParams;
    /// Cost of a task in steps of an agent, whatever the weight of its campaign.
    fn cost(&self) -> u64;
    fn embeds(&self) -> bool;
    /// Whether the tasks are leased after those of the campaign's earlier jobs of this kind.
    fn is_next(&self) -> bool;
    fn batch(&self, places: &[usize]) -> v1::lease::Work;
    fn training(&self) -> Option<&TrainingJob>;

    /// Whether the submitter no longer waits for the job.
    fn is_withdrawn(&self) -> bool;

    /// The audits of the tasks at these places, with their results, as a job for which nobody waits; `None` if this work is not
    /// audited.
    fn audits(&self, places: &[usize]) -> Option<Box<dyn AnyJob>>;

    /// Keeps a worker's results of the tasks at these places, and returns a vote for each result.
    fn keep(&mut self, places: &[usize], outcome: Outcome, kind: EmbeddingKind)
    -> Result<Vec<Vote>, Unsound>;

    /// Sends the outcomes to the submitter. Sends an error if a task was poisoned and this kind of work has no outcome for a
    /// poisoned task.
    fn finish(self: Box<Self>, settled: Vec<Settled<Vote>>, closing: &Closing<'_>);

    /// Sends the error to the submitter.
    fn fail(self: Box<Self>, error: JobError);
}

/// Outcomes of the tasks of a job, or why the job failed.
pub(super) type Outcomes<W> = Result<Vec<<W as Work>::Outcome>, JobError>;

/// A job of one kind of work, whose submitter waits for outcomes of that kind.
pub(super) struct Submitted<W: Work> {
    work: W,
    /// The results of each task, in the order of their arrival.
    results: Vec<Vec<W::Result>>,
    /// `None` for audits that go on after their job.
    reply: Option<oneshot::Sender<Outcomes<W>>>,
}

impl<W: Work> Submitted<W> {
    pub(super) fn new(work: W) -> (Self, oneshot::Receiver<Outcomes<W>>) {
        let (reply, answer) = oneshot::channel();
        let results = (0..work.tasks()).map(|_| Vec::new()).collect();
        let reply = Some(reply);
        let submitted = Self { work, results, reply };
        (submitted, answer)
    }

    fn reply(self, outcomes: Outcomes<W>) {
        // The waiting task may have been cancelled.
        let _ = self.reply.map(|reply| reply.send(outcomes));
    }
}

impl<W: Work> fmt::Debug for Submitted<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Submitted")
            .field("work", &self.work)
            .finish_non_exhaustive()
    }
}

impl<W: Work> AnyJob for Submitted<W> {
    fn kind(&self) -> WorkKind {
        W::KIND
    }

    fn campaign(&self) -> Option<&CampaignId> {
        self.work.campaign()
    }

    fn submitter(&self) -> Option<Submitter> {
        self.work.submitter()
    }

    fn params(&self, audited: &mut dyn FnMut() -> bool) -> JobParams {
        let tasks = self.work.tasks();
        let chosen = |_: &usize| self.work.is_audited() && audited();
        JobParams {
            tasks,
            cost: self.work.weight().charge(self.work.cost()),
            audited: (0..tasks).filter(chosen).collect(),
            embeds: self.work.embeds(),
            speculative: self.work.is_speculative(),
            after: None,
            is_shown: self.work.is_shown(),
        }
    }

    fn cost(&self) -> u64 {
        self.work.cost()
    }

    fn embeds(&self) -> bool {
        self.work.embeds()
    }

    fn is_next(&self) -> bool {
        self.work.is_next()
    }

    fn batch(&self, places: &[usize]) -> v1::lease::Work {
        self.work.batch(places)
    }

    fn training(&self) -> Option<&TrainingJob> {
        self.work.training()
    }

    fn is_withdrawn(&self) -> bool {
        self.reply.as_ref().is_some_and(oneshot::Sender::is_closed)
    }

    fn audits(&self, places: &[usize]) -> Option<Box<dyn AnyJob>> {
        Some(Box::new(Self {
            work: self.work.only(places)?,
            results: places.iter().map(|&place| self.results[place].clone()).collect(),
            reply: None,
        }))
    }

    fn keep(
        &mut self,
        places: &[usize],
        outcome: Outcome,
        kind: EmbeddingKind,
    ) -> Result<Vec<Vote>, Unsound> {
        let came = self.work.results(places.len(), outcome, kind)?;
        if came.len() != places.len() {
            let (got, wanted) = (came.len(), places.len());
            return Err(Refused::WrongCount { got, wanted }.into());
        }
        let votes = places.iter().zip(came).map(|(&place, result)| {
            let earlier = &mut self.results[place];
            let agrees = |&number: &usize| W::agree(&earlier[number], &result);
            let vote = Vote {
                number: earlier.len(),
                agrees_with: (0..earlier.len()).filter(agrees).collect(),
            };
            earlier.push(result);
            vote
        });
        Ok(votes.collect())
    }

    fn finish(mut self: Box<Self>, settled: Vec<Settled<Vote>>, closing: &Closing<'_>) {
        let results = std::mem::take(&mut self.results);
        let outcome = |(settled, mut results): (Settled<Vote>, Vec<W::Result>)| match settled {
            Settled::Result { value, by, audited } => {
                if audited && W::KIND == WorkKind::Evaluation {
                    closing.metrics.audited();
                }
                let result = results.swap_remove(value.number);
                Ok(W::settled(result, (!audited).then_some(by.machine)))
            }
            Settled::Poisoned { lost } => {
                let poisoned = PoisonedTask {
                    workers: (closing.names)(&lost),
                };
                closing.metrics.poisoned(1);
                tracing::error!(%poisoned, "a task was poisoned");
                W::poisoned(poisoned)
            }
        };
        let outcomes = settled.into_iter().zip(results).map(outcome).collect();
        self.reply(outcomes);
    }

    fn fail(self: Box<Self>, error: JobError) {
        self.reply(Err(error));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{EmbeddingJob, embedding_cost};
    use murmuration_model::{EmbedderRef, MachineId, Weight};
    use murmuration_swarm::{CheckpointDigest, Starts};
    use prometheus_client::registry::Registry;

    const KIND: EmbeddingKind = EmbeddingKind::UNKNOWN;

    fn submitted(
        weight: Weight,
    ) -> (
        Box<Submitted<EmbeddingJob>>,
        oneshot::Receiver<Outcomes<EmbeddingJob>>,
    ) {
        let (submitted, answer) = Submitted::new(EmbeddingJob {
            campaign: CampaignId::from_store("small-1".to_owned()),
            weight,
            embedder: EmbedderRef {
                checkpoint: CheckpointDigest::of(b"model"),
                dimensions: 1,
            },
            starts: Starts::ONE,
            images: vec![vec![Vec::new()]; 2],
        });
        (Box::new(submitted), answer)
    }

    fn embeddings(values: &[f32]) -> Outcome {
        let embedding = |&value: &f32| v1::Embedding { values: vec![value] };
        Outcome::Embeddings(v1::Embeddings {
            embeddings: values.iter().map(embedding).collect(),
        })
    }

    #[test]
    fn votes_agree_as_the_results_that_they_are_for() {
        let (mut job, _answer) = submitted(Weight::default());
        let mut keep = |places: &[usize], values: &[f32]| job.keep(places, embeddings(values), KIND).unwrap();
        let first = keep(&[0, 1], &[1.0, 5.0]);
        let second = keep(&[1], &[5.001]);
        let third = keep(&[1], &[7.0]);
        assert!(first[1].agrees_with(&second[0]) && second[0].agrees_with(&first[1]));
        assert!(!third[0].agrees_with(&first[1]) && !first[1].agrees_with(&third[0]));
        assert!(third[0].agrees_with(&third[0].clone()));
    }

    #[test]
    fn each_task_comes_to_the_result_that_was_voted_for() {
        let (mut job, mut answer) = submitted(Weight::default());
        let first = job.keep(&[1, 0], embeddings(&[5.0, 1.0]), KIND).unwrap();
        let second = job.keep(&[1], embeddings(&[7.0]), KIND).unwrap();
        let by = WorkerProcessId {
            machine: MachineId(3),
            instance: 0,
        };
        let settled = |value: &Vote, audited| Settled::Result {
            value: value.clone(),
            by,
            audited,
        };
        let closing = Closing {
            names: &|_| Vec::new(),
            metrics: &crate::Families::register(&mut Registry::default()).of(crate::PeerKind::Worker),
        };
        job.finish(
            vec![settled(&first[1], false), settled(&second[0], true)],
            &closing,
        );
        let outcomes = answer.try_recv().unwrap().unwrap();
        let told: Vec<_> = outcomes
            .into_iter()
            .map(|(value, maker)| (value, maker.unaudited))
            .collect();
        assert_eq!(
            told,
            [(vec![vec![1.0]], Some(MachineId(3))), (vec![vec![7.0]], None)]
        );
    }

    #[test]
    fn whoever_sends_too_few_results_is_unsound() {
        let (mut job, _answer) = submitted(Weight::default());
        let refused = job.keep(&[0, 1], embeddings(&[1.0]), KIND).unwrap_err();
        assert_eq!(refused.to_string(), "1 results for a lease of 2 tasks");
    }

    #[test]
    fn a_job_of_twice_the_weight_pays_half_for_its_tasks() {
        let cost = |weight: u32| {
            let (job, _answer) = submitted(Weight::try_from(weight).unwrap());
            (job.params(&mut || false).cost, job.cost())
        };
        let ((light, cost_of_light), (heavy, cost_of_heavy)) = (cost(100), cost(200));
        assert_eq!(light, 2 * heavy);
        // The time of a task does not depend on the weight.
        assert_eq!(
            (cost_of_light, cost_of_heavy),
            (embedding_cost(Starts::ONE), cost_of_light)
        );
    }
}
