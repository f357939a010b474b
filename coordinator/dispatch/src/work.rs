//! The work of a job as the lease table, the wire and the dispatcher have it: parameters, batches, results.

use super::job::{EmbeddingJob, Evaluated, EvaluationJob, ReplayJob, TrainingJob};
use crate::{
    WorkKind,
    leases::{Agree, JobParams},
};
use murmuration_model::{CampaignId, Maker, Weight};
use murmuration_proto::{
    CheckpointDigest, Controller, EmbeddingKind, Evaluation, Invalid, Replay, World, check_embedding,
    embeddings_agree, v1,
};
use murmuration_worker::features::{FeatureBounds, check_positions};
use std::collections::BTreeSet;

/// What embedding a picture costs, in steps of an agent.
const EMBEDDING_EFFORT: u64 = 1300;

/// The work of a job.
#[derive(Debug)]
pub(super) enum Work {
    Evaluations(EvaluationJob),
    Replay(ReplayJob),
    Embeddings(EmbeddingJob),
    Training(Box<TrainingJob>),
}

/// The result of one task.
#[derive(Debug)]
pub(super) enum Output {
    Evaluation(Evaluation, EmbeddingKind),
    /// What became of an evaluation once nothing can change it any more.
    Evaluated(Evaluated),
    Replay(Replay),
    Embedding(Vec<f32>, EmbeddingKind),
    /// An embedding once nothing can change it any more, and who made it.
    Embedded(Vec<f32>, Maker),
    Checkpoint(CheckpointDigest),
}

impl Agree for Output {
    fn agrees_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Evaluation(one, kind), Self::Evaluation(other, others)) => {
                one.same_simulation(other)
                    && embeddings_agree((one.embedding(), *kind), (other.embedding(), *others))
            }
            (Self::Replay(one), Self::Replay(other)) => one == other,
            (Self::Embedding(one, kind), Self::Embedding(other, others)) => {
                embeddings_agree((one, *kind), (other, *others))
            }
            (Self::Checkpoint(one), Self::Checkpoint(other)) => one == other,
            _ => false,
        }
    }
}

impl Output {
    pub(super) fn into_evaluated(self) -> Option<Evaluated> {
        match self {
            Self::Evaluated(evaluated) => Some(evaluated),
            _ => None,
        }
    }

    pub(super) fn into_replay(self) -> Option<Replay> {
        match self {
            Self::Replay(replay) => Some(replay),
            _ => None,
        }
    }

    pub(super) fn into_embedded(self) -> Option<(Vec<f32>, Maker)> {
        match self {
            Self::Embedded(embedding, maker) => Some((embedding, maker)),
            _ => None,
        }
    }

    pub(super) fn into_checkpoint(self) -> Option<CheckpointDigest> {
        match self {
            Self::Checkpoint(checkpoint) => Some(checkpoint),
            _ => None,
        }
    }
}

impl Work {
    pub(super) fn tasks(&self) -> usize {
        match self {
            Self::Evaluations(job) => job.tasks.len(),
            Self::Embeddings(job) => job.images.len(),
            Self::Replay(_) | Self::Training(_) => 1,
        }
    }

    /// How it is to be leased: `audited` says of which tasks a second machine is asked, if of any.
    pub(super) fn params(&self, audited: impl FnMut() -> bool) -> JobParams {
        let tasks = self.tasks();
        let mut audited = audited;
        let mut some = || (0..tasks).filter(|_| audited()).collect();
        let simulation = |world: &World| u64::from(world.agents()) * u64::from(world.horizon());
        let (weight, effort, audited, speculative) = match self {
            Self::Evaluations(job) => (job.weight, simulation(&job.world), some(), true),
            Self::Embeddings(job) => (job.weight, EMBEDDING_EFFORT, some(), true),
            // Somebody waits for it.
            Self::Replay(job) => (Weight::default(), simulation(&job.world), BTreeSet::new(), true),
            // Two at once would cost minutes of a machine each.
            Self::Training(job) => (job.weight, 1, BTreeSet::new(), false),
        };
        JobParams {
            tasks,
            effort: weight.charge(effort),
            audited,
            embeds: self.embeds(),
            speculative,
        }
    }

    /// Whether it takes a worker that embeds.
    pub(super) const fn embeds(&self) -> bool {
        match self {
            Self::Evaluations(job) => job.embedder.is_some(),
            Self::Embeddings(_) => true,
            // A trainer embeds to check what it publishes; that is its own affair.
            Self::Replay(_) | Self::Training(_) => false,
        }
    }

    /// The campaign that it is for.
    pub(super) fn campaign(&self) -> &CampaignId {
        match self {
            Self::Evaluations(job) => &job.campaign,
            Self::Embeddings(job) => &job.campaign,
            Self::Replay(job) => &job.campaign,
            Self::Training(job) => &job.campaign,
        }
    }

    pub(super) const fn kind(&self) -> WorkKind {
        match self {
            Self::Evaluations(_) => WorkKind::Evaluation,
            Self::Embeddings(_) => WorkKind::Embedding,
            Self::Replay(_) => WorkKind::Replay,
            Self::Training(_) => WorkKind::Training,
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
                checkpoint: job
                    .embedder
                    .map(|embedder| embedder.checkpoint.to_string())
                    .unwrap_or_default(),
            }),
            Self::Embeddings(job) => v1::lease::Work::Embeddings(v1::EmbeddingBatch {
                checkpoint: job.embedder.checkpoint.to_string(),
                images: tasks.iter().map(|&place| job.images[place].clone()).collect(),
            }),
            Self::Training(job) => v1::lease::Work::Training(v1::TrainingTask {
                configuration: job.configuration.to_toml(),
                side: job.side,
                views: job.pictures.views,
                behaviours: job.pictures.behaviours,
                parent: job
                    .lesson
                    .map(|lesson| lesson.parent.to_string())
                    .unwrap_or_default(),
                labelled: job.lesson.map_or(0, |lesson| lesson.labelled),
                labels: job.lesson.map_or(0, |lesson| lesson.labels),
            }),
            Self::Replay(job) => v1::lease::Work::Replay(v1::ReplayTask {
                model: v1::CapabilityModel::from(job.controller.model()) as i32,
                world: Some(job.world.into()),
                task: Some(task(&job.controller, job.seed)),
                stride: job.frames.stride().get(),
                first: job.frames.first(),
            }),
        }
    }

    /// Takes in what a worker made of a batch, which embeds like others of its kind.
    pub(super) fn outputs(
        &self,
        outcome: v1::batch_result::Outcome,
        kind: EmbeddingKind,
    ) -> Result<Vec<Output>, Invalid> {
        use v1::batch_result::Outcome;
        match (self, outcome) {
            (Self::Evaluations(job), Outcome::Evaluations(message)) => {
                let dimensions = job.embedder.map(|embedder| embedder.dimensions);
                let bounds = FeatureBounds::of(&job.world);
                let take = |evaluation| {
                    let evaluation = Evaluation::for_format(evaluation, &job.image, dimensions)?;
                    bounds.check(evaluation.features())?;
                    Ok(Output::Evaluation(evaluation, kind))
                };
                message.evaluations.into_iter().map(take).collect()
            }
            (Self::Embeddings(job), Outcome::Embeddings(message)) => {
                let take = |embedding: v1::Embedding| {
                    let embedding = check_embedding(embedding.values, job.embedder.dimensions)?;
                    Ok(Output::Embedding(embedding, kind))
                };
                message.embeddings.into_iter().map(take).collect()
            }
            (Self::Training(_), Outcome::Checkpoint(digest)) => Ok(vec![Output::Checkpoint(digest.parse()?)]),
            (Self::Replay(job), Outcome::Replay(message)) => {
                let replay = Replay::try_from(message)?;
                if !job.frames.steps(&job.world).eq(replay.steps().iter().copied()) {
                    let value = format!("{} frames", replay.steps().len());
                    return Err(Invalid::new("replay.steps", value, "those that were asked for"));
                }
                if replay.agents() != job.world.agents() as usize {
                    return Err(Invalid::new(
                        "replay.agents",
                        replay.agents(),
                        job.world.agents().to_string(),
                    ));
                }
                let poses = replay.frames().flatten();
                check_positions(&job.world, poses.map(|&[x, y, _]| [x.into(), y.into()]))?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_model::Embedder;

    #[test]
    fn machines_of_one_kind_agree_to_the_bit_and_others_nearly() {
        let (one, other) = (EmbeddingKind::of("one"), EmbeddingKind::of("other"));
        let agree = |a: f32, kind, b: f32, others| {
            let embedding = |value, kind| Output::Embedding(vec![value, -20.0], kind);
            embedding(a, kind).agrees_with(&embedding(b, others))
        };
        assert!(agree(1.0, one, 1.0, one));
        assert!(!agree(1.0, one, 1.0 + f32::EPSILON, one));
        assert!(agree(1.0, one, 1.01, other));
        assert!(!agree(1.0, one, 1.03, other), "a thousandth of 20 apart at most");
        let unknown = EmbeddingKind::UNKNOWN;
        assert!(
            agree(1.0, unknown, 1.0 + f32::EPSILON, unknown),
            "nobody knows that they are alike"
        );
    }

    #[test]
    fn a_job_of_twice_the_weight_pays_half_for_its_tasks() {
        let effort = |weight: u32| {
            let job = EmbeddingJob {
                campaign: CampaignId::from_store("heavy-1".to_owned()),
                weight: Weight::try_from(weight).unwrap(),
                embedder: Embedder {
                    checkpoint: CheckpointDigest::of(b"model"),
                    dimensions: 5,
                },
                images: vec![Vec::new()],
            };
            Work::Embeddings(job).params(|| false).effort
        };
        assert_eq!(effort(100), 2 * effort(200));
    }
}
