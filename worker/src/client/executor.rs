//! Executes leases on one thread, with an evaluator and embedders that it keeps from lease to lease.

use super::{
    checkpoints::{Checkpoints, Unavailable},
    lease::{Lease, Outcome, Work},
};
use murmuration_embed::{EmbedError, Embedder, Embedders};
use murmuration_proto::v1;
use murmuration_sim::{evaluate::Evaluator, replay::replay_frames, simulate::Start};
use murmuration_swarm::{
    CheckpointDigest, Compressor, Controller, Evaluation, ImageFormat, Invalid, Starts, World,
};
use std::{io, sync::Arc};

pub(super) struct Executor {
    checkpoints: Arc<Checkpoints>,
    /// The evaluator of the last batch, and its parameters.
    evaluator: Option<(EvaluatorParams, Evaluator)>,
    /// `None` until a lease has evaluations.
    compressor: Option<Compressor>,
    /// `None` until a lease needs a checkpoint, because workers without ONNX Runtime can evaluate too.
    embedders: Option<Embedders>,
}

#[derive(Debug, Clone, PartialEq)]
struct EvaluatorParams {
    world: World,
    image: ImageFormat,
    judges: bool,
}

/// Why a lease failed.
#[derive(Debug, thiserror::Error)]
enum Undone {
    #[error(transparent)]
    Work(#[from] Invalid),
    #[error(transparent)]
    Checkpoint(#[from] Unavailable),
    #[error(transparent)]
    Embed(#[from] EmbedError),
    #[error("pictures cannot be compressed: {0}")]
    Compression(#[from] io::Error),
}

impl Executor {
    pub(super) const fn new(checkpoints: Arc<Checkpoints>) -> Self {
        Self {
            checkpoints,
            evaluator: None,
            compressor: None,
            embedders: None,
        }
    }

    /// The outcome of a lease.
    pub(super) fn outcome(&mut self, lease: Lease) -> Outcome {
        self.work(lease).unwrap_or_else(|undone| {
            let message = undone.to_string();
            tracing::warn!(message, "not done");
            match undone {
                Undone::Checkpoint(unavailable) if unavailable.may_be_had_elsewhere() => {
                    Outcome::retryable(message)
                }
                Undone::Compression(_) | Undone::Embed(EmbedError::Card { .. }) => {
                    Outcome::retryable(message)
                }
                _ => Outcome::fatal(message),
            }
        })
    }

    fn work(&mut self, Lease { id, work, .. }: Lease) -> Result<Outcome, Undone> {
        Ok(match work {
            Work::Evaluations {
                world,
                image,
                starts,
                tasks,
                checkpoint,
                judges,
            } => {
                let params = EvaluatorParams { world, image, judges };
                let evaluations = self.evaluate(params, starts, &tasks)?;
                let evaluations = match checkpoint {
                    Some(checkpoint) => embedded(self.embedder(checkpoint, id)?, evaluations)?,
                    None => evaluations,
                };
                // Each worker compresses its own pictures, because the coordinator has many workers' pictures to keep.
                let compressor = match self.compressor.take() {
                    Some(compressor) => compressor,
                    None => Compressor::new()?,
                };
                let compressor = self.compressor.insert(compressor);
                Outcome::Evaluations(Evaluation::message(&evaluations, compressor)?)
            }
            Work::Embeddings {
                checkpoint, images, ..
            } => {
                let images: Vec<&[u8]> = images.iter().map(Vec::as_slice).collect();
                Outcome::Embeddings(self.embedder(checkpoint, id)?.embed(&images)?)
            }
            Work::Replay {
                world,
                controller,
                seed,
                frames,
            } => Outcome::Replay(replay_frames(&controller, &world, &Start::seeded(seed), &frames)?),
        })
    }

    /// Returns one evaluation per trial; the trials of a task are adjacent.
    fn evaluate(
        &mut self,
        params: EvaluatorParams,
        starts: Starts,
        tasks: &[(Controller, u64)],
    ) -> Result<Vec<Evaluation>, Invalid> {
        let evaluator = match self.evaluator.take() {
            Some((of, evaluator)) if of == params => evaluator,
            _ => Evaluator::new(&params.world, &params.image)?.judging(params.judges),
        };
        let evaluator = &mut self.evaluator.insert((params, evaluator)).1;
        let trials = |(controller, seed): &(Controller, u64)| -> Vec<_> {
            let trial = |seed| (controller.clone(), Start::seeded(seed));
            starts.seeds(*seed).map(trial).collect()
        };
        evaluator.evaluate_all(&tasks.iter().flat_map(trials).collect::<Vec<_>>())
    }

    fn embedder(
        &mut self,
        digest: CheckpointDigest,
        lease: v1::LeaseId,
    ) -> Result<&mut Embedder, Unavailable> {
        let embedders = match self.embedders.take() {
            Some(embedders) => embedders,
            None => self.checkpoints.embedders()?,
        };
        let checkpoints = &self.checkpoints;
        let embedder = self
            .embedders
            .insert(embedders)
            .get(digest, |digest| checkpoints.fetch(digest, lease))?;
        Ok(embedder)
    }
}

fn embedded(embedder: &mut Embedder, evaluations: Vec<Evaluation>) -> Result<Vec<Evaluation>, Undone> {
    let images: Vec<&[u8]> = evaluations.iter().map(Evaluation::<Vec<u8>>::image).collect();
    let embeddings = embedder.embed(&images)?;
    let dimensions = embedder.model().dimensions();
    let pairs = evaluations.into_iter().zip(embeddings);
    let embedded = pairs.map(|(evaluation, embedding)| evaluation.embedded(embedding, dimensions));
    Ok(embedded.collect::<Result<_, _>>()?)
}
