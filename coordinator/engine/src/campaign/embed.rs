//! The embed stage: the workers embed every stored picture with the next checkpoint, then the archive switches to that checkpoint
//! in one step.

use super::{
    CampaignError,
    context::{StageContext, individuals_at_once},
    run_handle::RunHandle,
};
use murmuration_dispatch::EmbeddingJob;
use murmuration_model::{ArchiveEmbedder, CampaignId, CampaignRecord};
use murmuration_search::{
    interrupt::Interrupt,
    novelty::{Behaviours, Index},
};
use murmuration_store::{ArchivedIndividual, GenerationRecord, Provenance, Store, Switch};
use murmuration_swarm::{CampaignSpec, Scale};

/// Maximum number of individuals whose pictures are embedded and committed together.
const CHUNK: usize = 2048;

/// Embeds the pictures that the next checkpoint has not embedded yet, recomputes novelty, and moves the campaign to that
/// checkpoint.
pub(super) async fn embed(
    context: &StageContext,
    record: CampaignRecord,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let CampaignRecord {
        id,
        spec,
        weight,
        embedder:
            ArchiveEmbedder::Switching {
                to: checkpoint,
                mut embedded,
                ..
            },
        ..
    } = record
    else {
        return Ok(());
    };
    let found = context.checkpoints.embedder(checkpoint, spec.image());
    let embedder = handle.unless_stopped(found).await??;
    let at_once = individuals_at_once(&spec, CHUNK) as u64;
    loop {
        let (of, model) = (id.clone(), spec.model().clone());
        let range = embedded..embedded + at_once;
        let read = move |store: &Store| store.individuals(&of, &model, range, true);
        let individuals = context.store.run(read).await?;
        if individuals.is_empty() {
            break;
        }
        let images = individuals
            .into_iter()
            .map(ArchivedIndividual::into_images)
            .collect();
        let job = EmbeddingJob {
            campaign: id.clone(),
            weight,
            embedder,
            starts: spec.starts(),
            images,
        };
        let embeddings = handle
            .until_stopped(|job_progress| context.dispatch.embed(job, job_progress))
            .await?;
        let (embeddings, makers): (Vec<_>, Vec<_>) = embeddings?.into_iter().unzip();
        let provenance = Provenance {
            makers,
            notices: Vec::new(),
        };
        let count = embeddings.len() as u64;
        let of = id.clone();
        let add = move |store: &Store| store.add_embeddings(&of, embedded, &embeddings, &provenance);
        context.commit(&handle.commit_handle(), add).await?;
        embedded += count;
        handle.done(count);
    }
    let (of, interrupt) = (id.clone(), handle.interrupt.clone());
    let measured = move |store: &Store| measure(store, &of, &spec, embedder.dimensions, &interrupt);
    let measured = context.store.run(measured).await?;
    let switch = move |store: &Store| store.switch(&id, &measured);
    context.commit(&handle.commit_handle(), switch).await
}

/// Recomputes the novelty of every individual, in the archive as it was after the individual's generation.
fn measure(
    store: &Store,
    id: &CampaignId,
    spec: &CampaignSpec,
    dimensions: usize,
    interrupt: &Interrupt,
) -> Result<Switch, CampaignError> {
    let embeddings = store.next_embeddings(id, dimensions)?;
    let mut behaviours = Behaviours::new(super::search::dimensions(spec.space(), Some(dimensions)));
    let mut index = Index::new();
    let mut measured = Switch {
        novelty: Vec::new(),
        generations: Vec::new(),
    };
    let population = spec.search().population() as usize;
    let mut scale = Scale::unscaled(spec.space());
    let generations = store.generations(id)?;
    for (generation, record) in embeddings.chunks(population).zip(generations) {
        let first = behaviours.len();
        let range = first as u64..(first + generation.len()) as u64;
        let individuals = store.individuals(id, spec.model(), range, false)?;
        let parts = individuals.iter().zip(generation);
        let parts: Vec<_> = parts
            .map(|(individual, embedding)| (individual.features(), embedding.clone()))
            .collect();
        if first == 0 {
            scale = Scale::of(spec.space(), &parts);
        }
        for (features, embedding) in &parts {
            behaviours.push(&scale.behaviour(features, embedding))?;
        }
        let neighbours = spec.search().neighbours() as usize;
        let novelty = index.novelty(&behaviours, first..behaviours.len(), neighbours, interrupt)?;
        measured
            .generations
            .push(GenerationRecord::of(record.generation, &novelty, record.filtered));
        measured.novelty.extend(novelty);
    }
    Ok(measured)
}
