//! A validated lease, and its outcome.

use murmuration_proto::v1;
use murmuration_swarm::{
    CapabilityModel, CheckpointDigest, Controller, Frames, ImageFormat, Invalid, Replay, Starts, World,
};

/// Maximum number of tasks or pictures in one batch.
const MAX_BATCH: usize = 4096;

/// Validated work under a lease.
#[derive(Debug)]
pub(super) struct Lease {
    pub(super) id: v1::LeaseId,
    /// Name of the campaign, for the log.
    pub(super) campaign: String,
    pub(super) trace_parent: String,
    pub(super) work: Work,
}

#[derive(Debug)]
pub(super) enum Work {
    Evaluations {
        world: World,
        image: ImageFormat,
        /// Number of trials per task.
        starts: Starts,
        /// Controllers with the seeds of their first starts.
        tasks: Vec<(Controller, u64)>,
        /// The checkpoint to embed the pictures with, if any.
        checkpoint: Option<CheckpointDigest>,
        /// Whether each trial is judged.
        judges: bool,
    },
    Embeddings {
        checkpoint: CheckpointDigest,
        /// Number of pictures per task.
        starts: Starts,
        images: Vec<Vec<u8>>,
    },
    Replay {
        world: World,
        controller: Controller,
        seed: u64,
        frames: Frames,
    },
}

impl Work {
    /// Number of credits that the work uses.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Evaluations { tasks, .. } => tasks.len(),
            Self::Embeddings { images, starts, .. } => images.len() / starts.get(),
            Self::Replay { .. } => 1,
        }
    }
}

/// The outcome of a lease.
#[derive(Debug)]
pub(super) enum Outcome {
    Evaluations(v1::Evaluations),
    Embeddings(Vec<Vec<f32>>),
    Replay(Replay),
    Failure {
        class: v1::FailureClass,
        message: String,
    },
}

impl Outcome {
    /// A failure because the work itself seems to be invalid. The coordinator tries another worker.
    pub(super) fn fatal(message: String) -> Self {
        Self::Failure {
            class: v1::FailureClass::Fatal,
            message,
        }
    }

    /// A failure after which another worker, or a later attempt, may succeed.
    pub(super) fn retryable(message: String) -> Self {
        Self::Failure {
            class: v1::FailureClass::Retryable,
            message,
        }
    }

    /// The message about a lease, with room for `credits` more evaluations.
    pub(super) fn message(self, id: v1::LeaseId, credits: u32) -> v1::worker_message::Message {
        use v1::batch_result;
        let outcome = match self {
            Self::Evaluations(evaluations) => batch_result::Outcome::Evaluations(evaluations),
            Self::Embeddings(embeddings) => {
                let embeddings = embeddings.into_iter().map(|values| v1::Embedding { values });
                batch_result::Outcome::Embeddings(v1::Embeddings {
                    embeddings: embeddings.collect(),
                })
            }
            Self::Replay(replay) => batch_result::Outcome::Replay(replay.into()),
            Self::Failure { class, message } => batch_result::Outcome::Failure(v1::Failure {
                class: class as i32,
                message,
            }),
        };
        v1::worker_message::Message::Result(v1::BatchResult {
            lease: Some(id),
            outcome: Some(outcome),
            credits,
        })
    }
}

impl TryFrom<v1::Lease> for Lease {
    type Error = Invalid;

    fn try_from(message: v1::Lease) -> Result<Self, Invalid> {
        let id = message
            .id
            .ok_or_else(|| Invalid::missing("lease.id", "a lease id"))?;
        let work = match message.work {
            Some(v1::lease::Work::Evaluations(batch)) => evaluations(batch)?,
            Some(v1::lease::Work::Embeddings(batch)) => embeddings(batch)?,
            Some(v1::lease::Work::Replay(task)) => replay(task)?,
            Some(v1::lease::Work::Training(_)) => return Err(unknown("a training")),
            None => return Err(Invalid::missing("work", KNOWN_WORK)),
        };
        Ok(Self {
            id,
            campaign: message.campaign,
            trace_parent: message.trace_parent,
            work,
        })
    }
}

const KNOWN_WORK: &str = "a kind of work that this worker knows";

fn unknown(found: &str) -> Invalid {
    Invalid::new("work", found, KNOWN_WORK)
}

fn evaluations(batch: v1::EvaluationBatch) -> Result<Work, Invalid> {
    let model = CapabilityModel::try_from(batch.model.unwrap_or_default())?;
    let world = world(batch.world)?;
    check_number("tasks", batch.tasks.len())?;
    let tasks = batch
        .tasks
        .iter()
        .map(|task| self::task(&model, task))
        .collect::<Result<_, _>>()?;
    let checkpoint = match batch.checkpoint.as_str() {
        "" => None,
        digest => Some(digest.parse()?),
    };
    Ok(Work::Evaluations {
        image: ImageFormat::for_swarm(batch.image.unwrap_or_default(), &world, &model)?,
        world,
        starts: Starts::new("starts", batch.starts)?,
        tasks,
        checkpoint,
        judges: batch.judge,
    })
}

fn embeddings(batch: v1::EmbeddingBatch) -> Result<Work, Invalid> {
    let starts = Starts::new("starts", batch.starts)?;
    if !batch.images.len().is_multiple_of(starts.get()) {
        let allowed = format!("{} for each task", starts.get());
        return Err(Invalid::new("images", batch.images.len(), allowed));
    }
    check_number("images", batch.images.len() / starts.get())?;
    Ok(Work::Embeddings {
        checkpoint: batch.checkpoint.parse()?,
        starts,
        images: batch.images,
    })
}

fn replay(task: v1::ReplayTask) -> Result<Work, Invalid> {
    let model = CapabilityModel::try_from(task.model.unwrap_or_default())?;
    let (controller, seed) = self::task(&model, &task.task.unwrap_or_default())?;
    let world = world(task.world)?;
    Ok(Work::Replay {
        // Refuse too many frames before any frame is computed.
        frames: Frames::new(task.first, task.stride, &world)?,
        world,
        controller,
        seed,
    })
}

fn world(message: Option<v1::World>) -> Result<World, Invalid> {
    World::try_from(message.unwrap_or_default()).map_err(|error| error.within("world"))
}

fn check_number(of: &str, number: usize) -> Result<(), Invalid> {
    if (1..=MAX_BATCH).contains(&number) {
        return Ok(());
    }
    Err(Invalid::new(
        of,
        format!("{number} {of}"),
        format!("from 1 to {MAX_BATCH} {of}"),
    ))
}

fn task(model: &CapabilityModel, task: &v1::EvaluationTask) -> Result<(Controller, u64), Invalid> {
    Ok((Controller::new(model, &task.controller)?, task.seed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::Preset;

    fn taken_in(work: v1::lease::Work) -> Result<Work, String> {
        let lease = v1::Lease {
            id: Some(v1::LeaseId::default()),
            campaign: "small-1".to_owned(),
            trace_parent: String::new(),
            work: Some(work),
        };
        let lease = Lease::try_from(lease).map_err(|invalid| invalid.to_string())?;
        Ok(lease.work)
    }

    fn embedding_batch(checkpoint: &str, images: usize) -> v1::lease::Work {
        v1::lease::Work::Embeddings(v1::EmbeddingBatch {
            checkpoint: checkpoint.to_owned(),
            images: vec![vec![0; 4]; images],
            starts: 1,
        })
    }

    fn evaluation_batch(checkpoint: &str) -> v1::lease::Work {
        let task = v1::EvaluationTask {
            controller: vec![0.1, 0.2, 0.3, 0.4],
            seed: 1,
        };
        v1::lease::Work::Evaluations(v1::EvaluationBatch {
            model: Some((&CapabilityModel::from(Preset::SingleSensor)).into()),
            tasks: vec![task; 3],
            checkpoint: checkpoint.to_owned(),
            starts: 2,
            ..v1::EvaluationBatch::default()
        })
    }

    #[test]
    fn pictures_are_embedded_by_the_checkpoint_named() {
        let digest = CheckpointDigest::of(b"embedder");
        let work = taken_in(embedding_batch(&digest.to_string(), 7)).unwrap();
        assert_eq!(work.len(), 7);
        assert!(matches!(work, Work::Embeddings { checkpoint, .. } if checkpoint == digest));
    }

    #[test]
    fn evaluations_are_embedded_where_a_checkpoint_is_named() {
        let digest = CheckpointDigest::of(b"embedder");
        for (text, expected) in [("", None), (digest.to_string().as_str(), Some(digest))] {
            let work = taken_in(evaluation_batch(text)).unwrap();
            assert_eq!(work.len(), 3);
            assert!(matches!(work, Work::Evaluations { checkpoint, .. } if checkpoint == expected));
        }
    }

    fn replay_task(stride: u32) -> v1::lease::Work {
        v1::lease::Work::Replay(v1::ReplayTask {
            model: Some((&CapabilityModel::from(Preset::SingleSensor)).into()),
            world: Some(v1::World {
                agents: Some(10_000),
                ..v1::World::default()
            }),
            task: Some(v1::EvaluationTask {
                controller: vec![0.1, 0.2, 0.3, 0.4],
                seed: 1,
            }),
            stride,
            first: 0,
        })
    }

    #[track_caller]
    fn check_refused(work: v1::lease::Work, expected: &str) {
        let error = taken_in(work).unwrap_err();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        let digest = CheckpointDigest::of(b"embedder").to_string();
        check_refused(embedding_batch("", 1), "checkpoint = \"\"");
        check_refused(embedding_batch(&digest[1..], 1), "must be 64 hexadecimal digits");
        check_refused(
            embedding_batch(&digest, 0),
            "images = 0 images: must be from 1 to 4096",
        );
        check_refused(embedding_batch(&digest, 4097), "4097 images");
        let without_starts = v1::lease::Work::Embeddings(v1::EmbeddingBatch {
            checkpoint: digest.clone(),
            images: vec![vec![0; 4]],
            starts: 0,
        });
        check_refused(without_starts, "starts = 0: must be a whole number from 1 to 16");
        let odd = v1::lease::Work::Embeddings(v1::EmbeddingBatch {
            checkpoint: digest.clone(),
            images: vec![vec![0; 4]; 3],
            starts: 2,
        });
        check_refused(odd, "images = 3: must be 2 for each task");
        check_refused(evaluation_batch("compact"), "checkpoint = \"compact\"");
        check_refused(replay_task(0), "stride = 0: must be 1 or more");
        check_refused(replay_task(1), "1201 frames of 10000 agents are 12010000 poses");
        assert!(matches!(taken_in(replay_task(4)), Ok(Work::Replay { .. })));
        let training = v1::lease::Work::Training(v1::TrainingTask::default());
        check_refused(
            training,
            "work = a training: must be a kind of work that this worker knows",
        );
    }
}
