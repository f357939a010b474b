//! What is farmed out: its form as a job, as batches on the wire, and as results.

use crate::leases::Agree;
use murmuration_proto::{CapabilityModel, Controller, Evaluation, ImageFormat, Invalid, Replay, World, v1};

/// Controllers to evaluate that share everything but genome and seed.
#[derive(Debug, Clone)]
pub struct EvaluationJob {
    /// The capability model of every controller.
    pub model: CapabilityModel,
    /// The arena.
    pub world: World,
    /// The pictures wanted.
    pub image: ImageFormat,
    /// Controllers with the seeds of their starts; at least one.
    pub tasks: Vec<(Controller, u64)>,
}

/// One simulation to watch.
#[derive(Debug, Clone)]
pub struct ReplayJob {
    /// The controller.
    pub controller: Controller,
    /// The arena.
    pub world: World,
    /// Seed of the start.
    pub seed: u64,
    /// Steps between frames, 1 or more.
    pub stride: u32,
}

/// Why a job has no results.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JobError {
    /// A worker says that it cannot be done by anyone.
    #[error("a worker could not evaluate it: {0}")]
    Fatal(String),
    /// Two workers computed different results for the same evaluation.
    #[error(
        "worker \"{worker}\" and another disagree about evaluation {task} of a generation: one of them is broken"
    )]
    Disagreement {
        /// Place of the task in the job.
        task: usize,
        /// The worker whose result came second.
        worker: String,
    },
    /// The coordinator is stopping.
    #[error("the coordinator is shutting down")]
    ShuttingDown,
}

/// The work of a job.
#[derive(Debug)]
pub(super) enum Work {
    Evaluations(EvaluationJob),
    Replay(ReplayJob),
}

/// The result of one task.
#[derive(Debug)]
pub(super) enum Output {
    Evaluation(Evaluation),
    Replay(Replay),
}

impl Agree for Output {
    fn agrees_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Evaluation(one), Self::Evaluation(other)) => one.same_bits(other),
            (Self::Replay(one), Self::Replay(other)) => one == other,
            _ => false,
        }
    }
}

impl Output {
    pub(super) fn into_evaluation(self) -> Option<Evaluation> {
        match self {
            Self::Evaluation(evaluation) => Some(evaluation),
            Self::Replay(_) => None,
        }
    }

    pub(super) fn into_replay(self) -> Option<Replay> {
        match self {
            Self::Replay(replay) => Some(replay),
            Self::Evaluation(_) => None,
        }
    }
}

impl Work {
    pub(super) fn tasks(&self) -> usize {
        match self {
            Self::Evaluations(job) => job.tasks.len(),
            Self::Replay(_) => 1,
        }
    }

    /// The tasks at these places, as they travel.
    pub(super) fn batch(&self, tasks: &[usize]) -> v1::lease::Work {
        let task = |controller: &Controller, seed| v1::EvaluationTask {
            controller: controller.genes().to_vec(),
            seed,
        };
        match self {
            Self::Evaluations(job) => v1::lease::Work::Evaluations(v1::EvaluationBatch {
                model: v1::CapabilityModel::from(job.model) as i32,
                world: Some(job.world.into()),
                image: Some(job.image.into()),
                tasks: tasks
                    .iter()
                    .map(|&place| &job.tasks[place])
                    .map(|(c, seed)| task(c, *seed))
                    .collect(),
            }),
            Self::Replay(job) => v1::lease::Work::Replay(v1::ReplayTask {
                model: v1::CapabilityModel::from(job.controller.model()) as i32,
                world: Some(job.world.into()),
                task: Some(task(&job.controller, job.seed)),
                stride: job.stride,
            }),
        }
    }

    /// Takes in what a worker made of a batch.
    pub(super) fn outputs(&self, outcome: v1::batch_result::Outcome) -> Result<Vec<Output>, Invalid> {
        use v1::batch_result::Outcome;
        match (self, outcome) {
            (Self::Evaluations(job), Outcome::Evaluations(message)) => message
                .evaluations
                .into_iter()
                .map(|evaluation| Evaluation::for_format(evaluation, &job.image).map(Output::Evaluation))
                .collect(),
            (Self::Replay(job), Outcome::Replay(message)) => {
                let replay = Replay::try_from(message)?;
                if replay.agents() != job.world.agents() as usize {
                    return Err(Invalid::new(
                        "replay.agents",
                        replay.agents(),
                        job.world.agents().to_string(),
                    ));
                }
                Ok(vec![Output::Replay(replay)])
            }
            _ => Err(Invalid::new(
                "outcome",
                "another kind of work",
                "what the lease asked for",
            )),
        }
    }
}
