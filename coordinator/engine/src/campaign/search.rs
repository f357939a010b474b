//! The evolve stage proposes, evaluates, absorbs and commits generations. The taxonomy stage then clusters the archive.

use super::{
    CampaignError,
    context::StageContext,
    evaluate::{Done, evaluate},
    run_handle::{CommitHandle, RunHandle},
};
use crate::{blocking::blocking, space::SpaceError, taxonomy};
use futures_util::{FutureExt as _, StreamExt as _, future::BoxFuture, stream::FuturesOrdered};
use murmuration_dispatch::{Dispatch, EvaluationJob, JobProgress, Submitter};
use murmuration_model::{CampaignId, CampaignRecord, EmbedderRef};
use murmuration_search::{
    breeding::{self, Parent, Proposal, ProposeError},
    interrupt::{Interrupt, Interrupted},
    medoids::{self, Clustering},
    novelty::{Behaviours, Index},
    projection,
};
use murmuration_store::{
    ArchivedIndividual, ClusterMeasures, GenerationRecord, Provenance, Store, StoreError, Trial,
};
use murmuration_swarm::{BehaviourSpace, CompressedImage, Controller, Evaluation, Scale, Starts};
use std::{collections::VecDeque, sync::Arc, time::Instant};

/// Number of individuals that are read from the store at a time.
const CHUNK: u64 = 4096;

/// An evaluated generation that is not committed yet.
struct Generation {
    record: GenerationRecord,
    individuals: Vec<ArchivedIndividual<CompressedImage>>,
    provenance: Provenance,
}

/// The state of a campaign's search between two generations. It depends only on the campaign's specification, embedder and
/// archive. If the campaign has a sample, `behaviours` are those of the sample.
struct Search {
    store: Store,
    interrupt: Interrupt,
    campaign: Arc<CampaignRecord>,
    embedder: Option<EmbedderRef>,
    behaviours: Behaviours,
    /// The scale of `behaviours`, computed from the first generation.
    scale: Scale,
    /// Index of neighbours in `behaviours`, kept from generation to generation.
    index: Index,
    /// The generations from which later generations are bred, in order.
    parents: VecDeque<Vec<Parent>>,
    /// Number of generations in `behaviours`.
    next_generation: u32,
}

/// A generation that the workers evaluate.
struct Evaluating {
    /// Number of controllers that the filter discarded while the generation was proposed.
    filtered: u64,
    job_progress: Arc<JobProgress>,
}

/// Runs all generations that are not archived yet. Stops early if more than `seen` workers are quarantined. A generation is
/// committed while the next generation is evaluated; commits are in order. If a generation is not bred from the generation
/// before, both are evaluated at the same time, so that no worker waits for the last results of a generation.
pub(super) async fn evolve(
    context: &StageContext,
    record: CampaignRecord,
    seen: usize,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let mut search = restore(context, record, handle).await?;
    let quarantined = context.dispatch.quarantined();
    let mut uncommitted = None;
    let (mut evaluated, mut evaluating) = (FuturesOrdered::new(), VecDeque::new());
    loop {
        let id = search.campaign.id.clone();
        let committed = commit(context.clone(), handle.commit_handle(), id, uncommitted.take());
        // Results of newly quarantined workers may be in this archive. They are verified between stages.
        if quarantined.borrow().len() != seen {
            return committed.await;
        }
        let submitter = Submitter::Campaign(search.campaign.id.clone());
        if let Some(error) = context.dispatch.take_disagreement(&submitter) {
            committed.await?;
            return Err(error.into());
        }
        search = match begin_evaluations(search, context, &mut evaluated, &mut evaluating).await {
            Ok(search) => search,
            Err(error) => {
                committed.await?;
                return Err(error);
            }
        };
        let Some(first) = evaluating.pop_front() else {
            return committed.await;
        };
        let done = handle.until_done(&first.job_progress, evaluated.next());
        let (committed, done) = tokio::join!(committed, done);
        committed?;
        let done = done?.ok_or(CampaignError::Broken)??;
        handle.done(done.evaluations.len() as u64);
        let (absorbed, generation) = blocking(move || search.absorb(first.filtered, done)).await??;
        search = absorbed;
        uncommitted = Some(generation);
    }
}

/// Proposes all generations that can be proposed now, and begins to evaluate each once `evaluated` is polled.
async fn begin_evaluations(
    mut search: Search,
    context: &StageContext,
    evaluated: &mut FuturesOrdered<BoxFuture<'static, Result<Done, CampaignError>>>,
    evaluating: &mut VecDeque<Evaluating>,
) -> Result<Search, CampaignError> {
    loop {
        let next = search.next_generation + evaluating.len() as u32;
        if !search.can_propose(next) {
            return Ok(search);
        }
        let (unchanged, proposal) = blocking(move || {
            let proposal = search.propose(next);
            (search, proposal)
        })
        .await?;
        search = unchanged;
        let Proposal {
            controllers,
            filtered,
        } = proposal?;
        let job_progress = Arc::<JobProgress>::default();
        let evaluation = search.evaluate(&context.dispatch, next, controllers, job_progress.clone());
        evaluated.push_back(evaluation.boxed());
        evaluating.push_back(Evaluating {
            filtered,
            job_progress,
        });
    }
}

/// Waits for the audits that were too slow for their generations. Returns false if there are other than `seen` quarantined
/// machines before all audits are over.
async fn audited(
    context: &StageContext,
    campaign: &CampaignId,
    seen: usize,
    handle: &mut RunHandle,
) -> Result<bool, CampaignError> {
    let submitter = Submitter::Campaign(campaign.clone());
    let (dispatch, of) = (&context.dispatch, &submitter);
    let waits =
        |job_progress: Arc<JobProgress>| async move { dispatch.audited(of, seen, &job_progress).await };
    let are_over = handle.until_stopped(waits).await?;
    match dispatch.take_disagreement(&submitter) {
        Some(error) => Err(error.into()),
        None => Ok(are_over),
    }
}

/// Commits a generation, if there is one.
async fn commit(
    context: StageContext,
    handle: CommitHandle,
    campaign: CampaignId,
    generation: Option<Generation>,
) -> Result<(), CampaignError> {
    let Some(generation) = generation else {
        return Ok(());
    };
    let metrics = context.metrics.clone();
    let commit = move |store: &Store| {
        let begun = Instant::now();
        let Generation {
            record,
            individuals,
            provenance,
        } = &generation;
        store.commit_generation(&campaign, record, individuals, provenance)?;
        metrics.generation_committed(begun.elapsed());
        Ok::<_, StoreError>(())
    };
    context.commit(&handle, commit).await
}

/// Waits for audits, then clusters the archive and completes the campaign. Returns whether the campaign is complete, see
/// [`Store::complete`]; it is not if there are other than `seen` quarantined machines.
pub(super) async fn complete(
    context: &StageContext,
    record: CampaignRecord,
    seen: usize,
    handle: &mut RunHandle,
) -> Result<bool, CampaignError> {
    if !audited(context, &record.id, seen, handle).await? {
        return Ok(false);
    }
    let search = restore(context, record, handle).await?;
    let id = search.campaign.id.clone();
    let clustered = move || -> Result<_, CampaignError> {
        let (taxonomy, measures) = search.taxonomy()?;
        let robust_trials = search.robust_trials(&taxonomy)?;
        let points = search.points()?;
        Ok((taxonomy, measures, robust_trials, points))
    };
    let (taxonomy, measures, robust_trials, points) = blocking(clustered).await??;
    let complete = move |store: &Store| store.complete(&id, &taxonomy, &measures, &robust_trials, &points);
    context.commit(&handle.commit_handle(), complete).await
}

/// A trial in the form in which it is stored.
fn trial(evaluation: Evaluation<CompressedImage>) -> Trial<CompressedImage> {
    Trial {
        features: *evaluation.features(),
        embedding: evaluation.embedding().to_vec(),
        verdict: evaluation.verdict(),
        image: Some(evaluation.into_image()),
    }
}

/// Number of dimensions of a behaviour vector.
pub(super) const fn dimensions(space: BehaviourSpace, embedding: Option<usize>) -> usize {
    let features = if space.has_features() { 5 } else { 0 };
    match embedding {
        Some(embedding) => embedding + features,
        None => features,
    }
}

/// Restores the search from the store.
async fn restore(
    context: &StageContext,
    record: CampaignRecord,
    handle: &RunHandle,
) -> Result<Search, CampaignError> {
    let space = record.spec.space();
    let embedder = handle.unless_stopped(context.embedder(&record)).await??;
    let search = Search {
        behaviours: Behaviours::new(dimensions(space, embedder.map(|embedder| embedder.dimensions))),
        scale: Scale::unscaled(space),
        index: Index::new(),
        parents: VecDeque::new(),
        next_generation: record.generations_done,
        store: context.store.clone(),
        interrupt: handle.interrupt.clone(),
        campaign: Arc::new(record),
        embedder,
    };
    blocking(move || search.restored()).await?
}

impl Search {
    /// Reads the archive on disk into the search.
    fn restored(self) -> Result<Self, CampaignError> {
        let mut search = self;
        let population = u64::from(search.campaign.spec.search().population());
        let len = search.campaign.sampled();
        let first_parent = len.saturating_sub(population * search.kept_generations() as u64);
        search.scale = search.store.scale(&search.campaign)?;
        for start in (0..len).step_by(CHUNK as usize) {
            search.interrupt.check()?;
            let range = start..len.min(start + CHUNK);
            for individual in
                search
                    .store
                    .individuals(&search.campaign.id, search.campaign.spec.model(), range, false)?
            {
                search.behaviours.push(&individual.behaviour(&search.scale))?;
                if individual.index >= first_parent {
                    let ArchivedIndividual {
                        index,
                        controller,
                        novelty,
                        ..
                    } = individual;
                    if index % population == 0 {
                        search.parents.push_back(Vec::new());
                    }
                    if let Some(generation) = search.parents.back_mut() {
                        generation.push(Parent { controller, novelty });
                    }
                }
            }
        }
        if search.behaviours.len() as u64 != len {
            let reason = format!(
                "campaign {} lacks individuals of its complete generations",
                search.campaign.id
            );
            return Err(StoreError::Damaged {
                path: Store::FILE.into(),
                reason,
            }
            .into());
        }
        Ok(search)
    }

    /// Number of generations that later ones are bred from.
    fn kept_generations(&self) -> usize {
        1 + self.campaign.spec.search().lag() as usize
    }

    /// Whether a generation can be proposed, so that it is evaluated now: at most two generations are evaluated at a time.
    fn can_propose(&self, generation: u32) -> bool {
        let parents = breeding::parents_of(&self.campaign.spec, generation);
        let has_parents = parents.is_none_or(|parents| parents < self.next_generation);
        has_parents && generation <= self.next_generation + 1 && generation < self.campaign.generations()
    }

    fn propose(&self, generation: u32) -> Result<Proposal, ProposeError> {
        let spec = &self.campaign.spec;
        let parents = breeding::parents_of(spec, generation).and_then(|parents| {
            let age = self.next_generation.checked_sub(parents + 1)? as usize;
            self.parents.get(self.parents.len().checked_sub(age + 1)?)
        });
        breeding::propose(spec, generation, parents.map_or(&[], Vec::as_slice))
    }

    /// Starts the evaluation of a generation once the future is polled.
    fn evaluate(
        &self,
        dispatch: &Dispatch,
        generation: u32,
        controllers: Vec<Controller>,
        job_progress: Arc<JobProgress>,
    ) -> impl Future<Output = Result<Done, CampaignError>> + use<> {
        let (dispatch, campaign) = (dispatch.clone(), self.campaign.clone());
        let first = u64::from(generation) * u64::from(campaign.spec.search().population());
        let seeds = (first..).map(|index| breeding::start_seed(&self.campaign.spec, index));
        let job = EvaluationJob {
            next: true,
            ..EvaluationJob::of_individuals(
                &campaign,
                self.embedder,
                controllers.into_iter().zip(seeds).collect(),
            )
        };
        async move {
            let substitute = |place: usize, attempt| {
                let index = first + place as u64;
                Ok(vec![(
                    place,
                    breeding::substitute(&campaign.spec, index, attempt)?,
                )])
            };
            evaluate(&dispatch, job_progress, job, substitute).await
        }
    }

    /// Adds an evaluated generation to the archive in memory, and returns the generation.
    fn absorb(mut self, filtered: u64, done: Done) -> Result<(Self, Generation), CampaignError> {
        let spec = &self.campaign.spec;
        let first = u64::from(self.next_generation) * u64::from(spec.search().population());
        let mut individuals: Vec<_> = (first..)
            .zip(done.tasks.iter().zip(done.evaluations))
            .map(|(index, ((controller, seed), evaluations))| ArchivedIndividual {
                index,
                generation: self.next_generation,
                controller: controller.clone(),
                seed: *seed,
                trials: evaluations.into_iter().map(trial).collect(),
                novelty: 0.0,
            })
            .collect();
        if first == 0 {
            let parts = individuals.iter().map(|one| (one.features(), one.embedding()));
            self.scale = Scale::of(spec.space(), &parts.collect::<Vec<_>>());
        }
        let before = self.behaviours.len();
        let most = spec.sample().map_or(usize::MAX, |sample| sample as usize);
        for individual in individuals.iter().take(most.saturating_sub(before)) {
            self.behaviours.push(&individual.behaviour(&self.scale))?;
        }
        let neighbours = spec.search().neighbours() as usize;
        let new = before..self.behaviours.len();
        let novelty = match spec.has_novelty() {
            true => self
                .index
                .novelty(&self.behaviours, new, neighbours, &self.interrupt)?,
            false => vec![0.0; individuals.len()],
        };
        let record = GenerationRecord::of(self.next_generation, &novelty, filtered);
        let notice = |(place, reason): &(usize, _)| {
            format!(
                "the task of individual {} was poisoned, and another controller took its place: {reason}",
                first + *place as u64
            )
        };
        let provenance = Provenance {
            makers: done.makers,
            notices: done.poisoned.iter().map(notice).collect(),
        };
        for (individual, &novelty) in individuals.iter_mut().zip(&novelty) {
            individual.novelty = novelty;
        }
        let parent = |(controller, novelty)| Parent { controller, novelty };
        let controllers = done.tasks.into_iter().map(|(controller, _)| controller);
        self.parents
            .push_back(controllers.zip(novelty).map(parent).collect());
        while self.parents.len() > self.kept_generations() {
            self.parents.pop_front();
        }
        self.next_generation += 1;
        let generation = Generation {
            record,
            individuals,
            provenance,
        };
        Ok((self, generation))
    }

    /// The number of robust trials of each individual, see [`taxonomy::robust_trials`]; empty if individuals have one trial.
    fn robust_trials(&self, taxonomy: &Clustering) -> Result<Vec<u8>, CampaignError> {
        let (spec, len) = (&self.campaign.spec, self.campaign.sampled());
        if spec.starts() == Starts::ONE {
            return Ok(Vec::new());
        }
        let mut robust = Vec::with_capacity(taxonomy.clusters.len());
        for start in (0..len).step_by(CHUNK as usize) {
            self.interrupt.check()?;
            let range = start..len.min(start + CHUNK);
            let individuals = self
                .store
                .individuals(&self.campaign.id, spec.model(), range, false)?;
            for (individual, &own) in individuals.iter().zip(&taxonomy.clusters[start as usize..]) {
                robust.push(taxonomy::robust_trials(
                    individual,
                    &self.scale,
                    &self.behaviours,
                    &taxonomy.medoids,
                    own,
                ));
            }
        }
        Ok(robust)
    }

    /// The place of each individual on the map. The taxonomy stores these places, because the embeddings change when the campaign
    /// learns from labels.
    fn points(&self) -> Result<Vec<[f32; 2]>, Interrupted> {
        let axes = projection::principal_axes(&self.behaviours, &self.interrupt)?;
        Ok(axes
            .points
            .iter()
            .map(|point| point.map(|at| at as f32))
            .collect())
    }

    /// Clusters the archive, and measures the clusters.
    fn taxonomy(&self) -> Result<(Clustering, Vec<ClusterMeasures>), SpaceError> {
        let interrupt = &self.interrupt;
        let told = |progress: medoids::Progress| {
            tracing::debug!(campaign = %self.campaign.id, ?progress, "the archive is being clustered");
        };
        let clustering = taxonomy::cluster(&self.store, &self.campaign, &self.behaviours, interrupt, &told)?;
        let neighbours = self.campaign.spec.search().neighbours() as usize;
        let measures = taxonomy::measure(&self.behaviours, &clustering, neighbours, interrupt)?;
        Ok((clustering, measures))
    }
}
