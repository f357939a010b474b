//! A lease taken in from the wire, and what became of it.

use murmuration_proto::{CapabilityModel, Controller, Evaluation, ImageFormat, Invalid, Replay, World, v1};
use std::num::NonZeroU32;

/// Most tasks in one batch.
const MAX_TASKS: usize = 4096;

/// Validated work under a lease.
#[derive(Debug)]
pub(super) struct Lease {
    pub(super) id: v1::LeaseId,
    pub(super) work: Work,
}

#[derive(Debug)]
pub(super) enum Work {
    Evaluations {
        world: World,
        image: ImageFormat,
        tasks: Vec<(Controller, u64)>,
    },
    Replay {
        world: World,
        controller: Controller,
        seed: u64,
        stride: NonZeroU32,
    },
}

impl Work {
    /// Evaluations that it amounts to.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Evaluations { tasks, .. } => tasks.len(),
            Self::Replay { .. } => 1,
        }
    }
}

/// What became of a lease.
#[derive(Debug)]
pub(super) enum Outcome {
    Evaluations(Vec<Evaluation>),
    Replay(Replay),
    Failure {
        class: v1::FailureClass,
        message: String,
    },
}

impl Outcome {
    /// The work itself is at fault.
    pub(super) fn fatal(message: String) -> Self {
        Self::Failure {
            class: v1::FailureClass::Fatal,
            message,
        }
    }

    /// The message that reports it.
    pub(super) fn message(self, id: v1::LeaseId) -> v1::worker_message::Message {
        use v1::batch_result;
        let outcome = match self {
            Self::Evaluations(evaluations) => batch_result::Outcome::Evaluations(v1::Evaluations {
                evaluations: evaluations.into_iter().map(Into::into).collect(),
            }),
            Self::Replay(replay) => batch_result::Outcome::Replay(replay.into()),
            Self::Failure { class, message } => batch_result::Outcome::Failure(v1::Failure {
                class: class as i32,
                message,
            }),
        };
        v1::worker_message::Message::Result(v1::BatchResult {
            lease: Some(id),
            outcome: Some(outcome),
        })
    }
}

impl TryFrom<v1::Lease> for Lease {
    type Error = Invalid;

    fn try_from(message: v1::Lease) -> Result<Self, Invalid> {
        let id = message
            .id
            .ok_or_else(|| Invalid::new("lease.id", "nothing", "a lease id"))?;
        let world = |world: Option<v1::World>| {
            World::try_from(world.unwrap_or_default()).map_err(|e| e.within("world"))
        };
        let work = match message.work {
            Some(v1::lease::Work::Evaluations(batch)) => {
                let model = CapabilityModel::try_from(batch.model)?;
                let world = world(batch.world)?;
                if !(1..=MAX_TASKS).contains(&batch.tasks.len()) {
                    let allowed = format!("from 1 to {MAX_TASKS} tasks");
                    return Err(Invalid::new(
                        "tasks",
                        format!("{} tasks", batch.tasks.len()),
                        allowed,
                    ));
                }
                let tasks = batch
                    .tasks
                    .iter()
                    .map(|task| self::task(model, task))
                    .collect::<Result<_, _>>()?;
                Work::Evaluations {
                    image: ImageFormat::for_world(batch.image.unwrap_or_default(), &world)?,
                    world,
                    tasks,
                }
            }
            Some(v1::lease::Work::Replay(replay)) => {
                let model = CapabilityModel::try_from(replay.model)?;
                let (controller, seed) = task(model, &replay.task.unwrap_or_default())?;
                let stride =
                    NonZeroU32::new(replay.stride).ok_or_else(|| Invalid::new("stride", 0, "1 or more"))?;
                Work::Replay {
                    world: world(replay.world)?,
                    controller,
                    seed,
                    stride,
                }
            }
            None => {
                return Err(Invalid::new(
                    "work",
                    "nothing",
                    "a kind of work that this worker knows",
                ));
            }
        };
        Ok(Self { id, work })
    }
}

fn task(model: CapabilityModel, task: &v1::EvaluationTask) -> Result<(Controller, u64), Invalid> {
    Ok((Controller::new(model, &task.controller)?, task.seed))
}
