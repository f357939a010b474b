//! The kinds of work: the tasks of a job, their messages, and their results.

use super::job::{
    EmbeddingJob, Evaluated, EvaluationJob, JobError, PoisonedTask, ReplayJob, Submitter, TrainingJob,
};
use crate::WorkKind;
use murmuration_model::{CampaignId, MachineId, Maker, Weight};
use murmuration_proto::v1::{self, batch_result::Outcome};
use murmuration_sim::features::{FeatureBounds, check_positions};
use murmuration_swarm::{
    CheckpointDigest, CompressedImage, Controller, EmbeddingKind, Evaluation, Extras, Invalid, Replay,
    Starts, World, check_embedding, embeddings_agree,
};
use std::fmt::Debug;

/// Cost of embedding a picture, in steps of an agent.
const EMBEDDING_COST: u64 = 1300;

/// The work of a job. Its submitter receives an outcome for each task.
pub(super) trait Work: Debug + Send + 'static {
    /// The result of a task, as a worker sends it.
    type Result: Clone + Send;
    /// Outcome of a task, for the submitter.
    type Outcome: Debug + Send;

    const KIND: WorkKind;

    /// The campaign that the work belongs to, if any.
    fn campaign(&self) -> Option<&CampaignId>;

    /// Campaign or stream for which audits go on after the job; `None` if audits end with the job.
    fn submitter(&self) -> Option<Submitter> {
        self.campaign().cloned().map(Submitter::Campaign)
    }

    /// The campaign's share of the workers.
    fn weight(&self) -> Weight;

    fn tasks(&self) -> usize {
        1
    }

    /// Cost of a task, in steps of an agent.
    fn cost(&self) -> u64;

    /// Whether a second machine repeats some tasks.
    fn is_audited(&self) -> bool {
        false
    }

    /// The work on the tasks at these places alone; `None` if this work is not audited.
    fn only(&self, _places: &[usize]) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// Whether a late lease is also given to a worker that would be idle.
    fn is_speculative(&self) -> bool {
        true
    }

    /// Whether the results are only shown to a person who looks at a page.
    fn is_shown(&self) -> bool {
        false
    }

    /// Whether only workers that embed can do the work.
    fn embeds(&self) -> bool {
        false
    }

    /// Whether the tasks are leased after those of the campaign's earlier jobs of this kind.
    fn is_next(&self) -> bool {
        false
    }

    /// The tasks at these places, as a message.
    fn batch(&self, places: &[usize]) -> v1::lease::Work;

    /// Reads the results of a batch of this many tasks. `kind` is the worker's kind of embedding.
    fn results(
        &self,
        tasks: usize,
        outcome: Outcome,
        kind: EmbeddingKind,
    ) -> Result<Vec<Self::Result>, Invalid>;

    /// Whether two results of one task count as the same.
    fn agree(one: &Self::Result, other: &Self::Result) -> bool;

    /// Outcome of a settled result; `unaudited` is the machine that computed the result, if no other machine confirmed it.
    fn settled(result: Self::Result, unaudited: Option<MachineId>) -> Self::Outcome;

    /// The outcome of a poisoned task, or an error if the job cannot continue without the task.
    fn poisoned(task: PoisonedTask) -> Result<Self::Outcome, JobError> {
        Err(task.into())
    }

    /// The training, if the work is a training.
    fn training(&self) -> Option<&TrainingJob> {
        None
    }
}

/// Cost of a simulation, in steps of an agent.
#[must_use]
pub fn simulation_cost(world: &World) -> u64 {
    u64::from(world.agents()) * u64::from(world.horizon())
}

/// Cost of embedding the pictures of an individual, in steps of an agent.
#[must_use]
pub const fn embedding_cost(starts: Starts) -> u64 {
    EMBEDDING_COST * starts.get() as u64
}

fn task(controller: &Controller, seed: u64) -> v1::EvaluationTask {
    v1::EvaluationTask {
        controller: controller.genes().to_vec(),
        seed,
    }
}

/// Splits the results of a worker by task.
///
/// # Errors
/// If there are not `starts` results for each task.
fn by_task<T>(of: &str, trials: Vec<T>, starts: Starts) -> Result<Vec<Vec<T>>, Invalid> {
    let starts = starts.get();
    if !trials.len().is_multiple_of(starts) {
        let allowed = format!("{starts} for each task");
        return Err(Invalid::new(of, trials.len(), allowed));
    }
    let mut trials = trials.into_iter();
    Ok(std::iter::from_fn(|| {
        let task: Vec<T> = trials.by_ref().take(starts).collect();
        (!task.is_empty()).then_some(task)
    })
    .collect())
}

fn other_work() -> Invalid {
    Invalid::new("outcome", "another kind of work", "the kind of work of the lease")
}

impl Work for EvaluationJob {
    type Result = (Vec<Evaluation<CompressedImage>>, EmbeddingKind);
    type Outcome = Evaluated;

    const KIND: WorkKind = WorkKind::Evaluation;

    fn campaign(&self) -> Option<&CampaignId> {
        self.submitter.as_ref()?.campaign()
    }

    fn submitter(&self) -> Option<Submitter> {
        self.submitter.clone()
    }

    fn tasks(&self) -> usize {
        self.tasks.len()
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn cost(&self) -> u64 {
        simulation_cost(&self.world).saturating_mul(self.starts.get() as u64)
    }

    fn is_audited(&self) -> bool {
        self.submitter.is_some()
    }

    fn is_shown(&self) -> bool {
        self.submitter.is_none()
    }

    fn only(&self, places: &[usize]) -> Option<Self> {
        Some(Self {
            tasks: places.iter().map(|&place| self.tasks[place].clone()).collect(),
            ..self.clone()
        })
    }

    fn embeds(&self) -> bool {
        self.embedder.is_some()
    }

    fn is_next(&self) -> bool {
        self.next
    }

    fn batch(&self, places: &[usize]) -> v1::lease::Work {
        let tasks = places.iter().map(|&place| &self.tasks[place]);
        let checkpoint = self.embedder.map(|embedder| embedder.checkpoint.to_string());
        v1::lease::Work::Evaluations(v1::EvaluationBatch {
            model: Some((&self.model).into()),
            world: Some(self.world.clone().into()),
            image: Some(self.image.into()),
            tasks: tasks.map(|(controller, seed)| task(controller, *seed)).collect(),
            checkpoint: checkpoint.unwrap_or_default(),
            starts: self.starts.into(),
            judge: self.judges,
        })
    }

    fn results(
        &self,
        tasks: usize,
        outcome: Outcome,
        kind: EmbeddingKind,
    ) -> Result<Vec<Self::Result>, Invalid> {
        let Outcome::Evaluations(message) = outcome else {
            return Err(other_work());
        };
        let extras = Extras {
            dimensions: self.embedder.map(|embedder| embedder.dimensions),
            judge: self.judges,
        };
        let bounds = FeatureBounds::of(&self.model, &self.world);
        let trials = bounds.received(&message, tasks * self.starts.get(), &self.image, extras)?;
        let tasks = by_task("evaluations", trials, self.starts)?;
        Ok(tasks.into_iter().map(|trials| (trials, kind)).collect())
    }

    fn agree((one, kind): &Self::Result, (other, others): &Self::Result) -> bool {
        let agree = |one: &Evaluation<_>, other: &Evaluation<_>| {
            one.same_simulation(other)
                && embeddings_agree((one.embedding(), *kind), (other.embedding(), *others))
        };
        one.iter().zip(other).all(|(one, other)| agree(one, other))
    }

    fn settled((trials, kind): Self::Result, unaudited: Option<MachineId>) -> Evaluated {
        let maker = Maker { kind, unaudited };
        Evaluated::Done { trials, maker }
    }

    fn poisoned(task: PoisonedTask) -> Result<Evaluated, JobError> {
        Ok(Evaluated::Poisoned(task))
    }
}

impl Work for EmbeddingJob {
    type Result = (Vec<Vec<f32>>, EmbeddingKind);
    type Outcome = (Vec<Vec<f32>>, Maker);

    const KIND: WorkKind = WorkKind::Embedding;

    fn campaign(&self) -> Option<&CampaignId> {
        Some(&self.campaign)
    }

    fn tasks(&self) -> usize {
        self.images.len()
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    fn cost(&self) -> u64 {
        embedding_cost(self.starts)
    }

    fn is_audited(&self) -> bool {
        true
    }

    fn only(&self, places: &[usize]) -> Option<Self> {
        Some(Self {
            campaign: self.campaign.clone(),
            weight: self.weight,
            embedder: self.embedder,
            starts: self.starts,
            images: places.iter().map(|&place| self.images[place].clone()).collect(),
        })
    }

    fn embeds(&self) -> bool {
        true
    }

    fn batch(&self, places: &[usize]) -> v1::lease::Work {
        v1::lease::Work::Embeddings(v1::EmbeddingBatch {
            checkpoint: self.embedder.checkpoint.to_string(),
            images: places
                .iter()
                .flat_map(|&place| self.images[place].iter().cloned())
                .collect(),
            starts: self.starts.into(),
        })
    }

    fn results(
        &self,
        _tasks: usize,
        outcome: Outcome,
        kind: EmbeddingKind,
    ) -> Result<Vec<Self::Result>, Invalid> {
        let Outcome::Embeddings(message) = outcome else {
            return Err(other_work());
        };
        let take = |embedding: v1::Embedding| {
            check_embedding(&embedding.values, self.embedder.dimensions)?;
            Ok(embedding.values)
        };
        let trials: Result<Vec<_>, Invalid> = message.embeddings.into_iter().map(take).collect();
        let tasks = by_task("embeddings", trials?, self.starts)?;
        Ok(tasks.into_iter().map(|trials| (trials, kind)).collect())
    }

    fn agree((one, kind): &Self::Result, (other, others): &Self::Result) -> bool {
        let mut both = one.iter().zip(other);
        both.all(|(one, other)| embeddings_agree((one, *kind), (other, *others)))
    }

    fn settled((embeddings, kind): Self::Result, unaudited: Option<MachineId>) -> Self::Outcome {
        (embeddings, Maker { kind, unaudited })
    }
}

impl Work for ReplayJob {
    type Result = Replay;
    type Outcome = Replay;

    const KIND: WorkKind = WorkKind::Replay;

    fn campaign(&self) -> Option<&CampaignId> {
        Some(&self.campaign)
    }

    /// The weight of a replay is the same for all campaigns, because a person waits for the replay.
    fn weight(&self) -> Weight {
        Weight::default()
    }

    fn cost(&self) -> u64 {
        simulation_cost(&self.world)
    }

    fn batch(&self, _places: &[usize]) -> v1::lease::Work {
        v1::lease::Work::Replay(v1::ReplayTask {
            model: Some(self.controller.model().into()),
            world: Some(self.world.clone().into()),
            task: Some(task(&self.controller, self.seed)),
            stride: self.frames.stride().get(),
            first: self.frames.first(),
        })
    }

    fn results(
        &self,
        _tasks: usize,
        outcome: Outcome,
        _kind: EmbeddingKind,
    ) -> Result<Vec<Self::Result>, Invalid> {
        let Outcome::Replay(message) = outcome else {
            return Err(other_work());
        };
        let replay = Replay::try_from(message)?;
        if !self.frames.steps(&self.world).eq(replay.steps().iter().copied()) {
            let value = format!("{} frames", replay.steps().len());
            return Err(Invalid::new("replay.steps", value, "the requested steps"));
        }
        let agents = self.world.agents();
        if replay.agents() != agents as usize {
            return Err(Invalid::new("replay.agents", replay.agents(), agents.to_string()));
        }
        let poses = replay.frames().flatten();
        let positions = poses.map(|&[x, y, _]| [x.into(), y.into()]);
        check_positions(self.controller.model(), &self.world, positions)?;
        Ok(vec![replay])
    }

    fn agree(one: &Replay, other: &Replay) -> bool {
        one == other
    }

    fn settled(replay: Replay, _unaudited: Option<MachineId>) -> Replay {
        replay
    }
}

impl Work for TrainingJob {
    type Result = CheckpointDigest;
    type Outcome = CheckpointDigest;

    const KIND: WorkKind = WorkKind::Training;

    fn campaign(&self) -> Option<&CampaignId> {
        Some(&self.campaign)
    }

    fn weight(&self) -> Weight {
        self.weight
    }

    /// Every training costs the same, because trainings compete only with other trainings.
    fn cost(&self) -> u64 {
        1
    }

    /// A training is not speculative: a second trainer would also spend minutes on it.
    fn is_speculative(&self) -> bool {
        false
    }

    fn batch(&self, _places: &[usize]) -> v1::lease::Work {
        let parent = self.fine_tuning.map(|fine_tuning| fine_tuning.parent.to_string());
        v1::lease::Work::Training(v1::TrainingTask {
            configuration: self.configuration.to_toml(),
            channels: self.shape.channels() as u32,
            side: self.shape.side() as u32,
            views: self.pictures.views,
            behaviours: self.pictures.behaviours,
            parent: parent.unwrap_or_default(),
            labelled: self.fine_tuning.map_or(0, |fine_tuning| fine_tuning.labelled),
            labels: self.fine_tuning.map_or(0, |fine_tuning| fine_tuning.labels),
        })
    }

    fn results(
        &self,
        _tasks: usize,
        outcome: Outcome,
        _kind: EmbeddingKind,
    ) -> Result<Vec<Self::Result>, Invalid> {
        let Outcome::Checkpoint(digest) = outcome else {
            return Err(other_work());
        };
        Ok(vec![digest.parse()?])
    }

    fn agree(one: &CheckpointDigest, other: &CheckpointDigest) -> bool {
        one == other
    }

    fn settled(checkpoint: CheckpointDigest, _unaudited: Option<MachineId>) -> CheckpointDigest {
        checkpoint
    }

    fn training(&self) -> Option<&TrainingJob> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machines_of_one_kind_agree_to_the_bit_and_others_nearly() {
        let (one, other) = (EmbeddingKind::of("one"), EmbeddingKind::of("other"));
        let agree = |a: f32, kind, b: f32, others| {
            let embedding = |value, kind| (vec![vec![value, -20.0]], kind);
            EmbeddingJob::agree(&embedding(a, kind), &embedding(b, others))
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
    fn every_task_has_the_trials_that_were_asked_for() {
        let three = Starts::new("starts", 3).unwrap();
        assert_eq!(
            by_task("evaluations", vec![1, 2, 3, 4, 5, 6], three).unwrap(),
            [[1, 2, 3], [4, 5, 6]]
        );
        let refused = by_task("evaluations", vec![1, 2, 3, 4], three).unwrap_err();
        assert_eq!(refused.to_string(), "evaluations = 4: must be 3 for each task");
    }

    #[test]
    fn machines_agree_about_a_task_if_they_do_about_each_trial() {
        let kind = EmbeddingKind::of("one");
        let result = |second: f32| (vec![vec![1.0], vec![second]], kind);
        assert!(EmbeddingJob::agree(&result(2.0), &result(2.0)));
        assert!(!EmbeddingJob::agree(&result(2.0), &result(2.5)));
    }
}
