//! When a machine is quarantined, other machines repeat the results that only this machine has computed. A result that differs by
//! the criteria of audits is rolled back, with everything that depends on it.
//!
//! Limits: once a campaign has learned from labels, or moved to another embedder, a rollback would lose people's labels. Such a
//! campaign fails with an error.

use super::{
    CampaignError,
    context::{StageContext, individuals_at_once, pictures_at_once},
    evaluate::{Done, evaluate},
    run_handle::RunHandle,
};
use murmuration_dispatch::{EmbeddingJob, EvaluationJob};
use murmuration_model::{ArchiveEmbedder, CampaignId, CampaignRecord};
use murmuration_store::{ArchivedIndividual, Store, StoreError, Suspect, Suspects};
use murmuration_swarm::{CompressedImage, Controller, EmbedderSource, counted, embeddings_agree};

/// Maximum number of results that are repeated at a time.
const CHUNK: usize = 1024;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wrong {
    Picture(u64),
    Individual { index: u64, generation: u32 },
    Embedding(u64),
}

/// The part of a campaign that is rolled back. The campaign then computes this part again by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rollback {
    /// All but the first `pictures` pictures.
    Dataset { pictures: u64 },
    /// The generation `generation` and all later generations.
    Generations { generation: u32 },
    /// All embeddings, and the generations after the first `kept` individuals, which the archive had when it moved to its
    /// embedder.
    Embeddings { kept: u64 },
}

/// Repeats the results that only quarantined machines have computed.
pub(super) async fn reverify(
    context: &StageContext,
    record: &CampaignRecord,
    suspects: Suspects,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let names: Vec<_> = suspects
        .machines
        .iter()
        .map(|machine| machine.name.as_str())
        .collect();
    let begins = format!(
        "worker {} returned wrong results and is quarantined; results that it alone had computed were computed again",
        names.join(", ")
    );
    tracing::warn!(campaign = %record.id, results = suspects.len(), "{begins}");
    let wrong = first_wrong(context, record, &suspects, handle).await?;
    let id = record.id.clone();
    let Some(wrong) = wrong else {
        let results = counted(suspects.len() as u64, "result");
        let message = format!("{begins}: no error was found in {results}");
        let confirm = move |store: &Store| store.confirm(&id, &suspects.machines, &message);
        return context.commit(&handle.commit_handle(), confirm).await;
    };
    let rollback = rollback(context, record, wrong, names.join(", ")).await?;
    let message = format!("{begins}: {}", rollback.because_of(wrong));
    tracing::warn!(campaign = %record.id, "{message}");
    let apply = move |store: &Store| rollback.apply(store, &id, &message);
    context.commit(&handle.commit_handle(), apply).await
}

/// Finds the first result for which other machines compute a different value.
async fn first_wrong(
    context: &StageContext,
    record: &CampaignRecord,
    suspects: &Suspects,
    handle: &mut RunHandle,
) -> Result<Option<Wrong>, CampaignError> {
    // Each result takes twice the memory: for the stored evaluation and for the repeated evaluation.
    let at_once = pictures_at_once(record.spec.image(), 2 * CHUNK).div_ceil(2);
    let individuals_at_once = individuals_at_once(&record.spec, 2 * CHUNK).div_ceil(2);
    for chunk in suspects.pictures.chunks(at_once) {
        if let Some(wrong) = wrong_picture(context, record, chunk, handle).await? {
            return Ok(Some(wrong));
        }
    }
    // Embeddings are checked before individuals: if an individual was embedded again later, a wrong embedding does not make its
    // evaluation wrong.
    for chunk in suspects.embeddings.chunks(individuals_at_once) {
        if let Some(wrong) = wrong_embedding(context, record, chunk, handle).await? {
            return Ok(Some(wrong));
        }
    }
    for chunk in suspects.individuals.chunks(individuals_at_once) {
        if let Some(wrong) = wrong_individual(context, record, chunk, handle).await? {
            return Ok(Some(wrong));
        }
    }
    Ok(None)
}

async fn wrong_picture(
    context: &StageContext,
    record: &CampaignRecord,
    suspects: &[Suspect],
    handle: &mut RunHandle,
) -> Result<Option<Wrong>, CampaignError> {
    let (id, model) = (record.id.clone(), record.spec.model().clone());
    let pictures = read_all(context, suspects, move |store, place| {
        store.picture(&id, &model, place)
    })
    .await?;
    let tasks = pictures
        .iter()
        .map(|old| (old.controller.clone(), old.seed))
        .collect();
    let job = EvaluationJob::of(record, None, tasks);
    let again = evaluated_again(context, job, handle).await?;
    let new = again.evaluations.iter().flatten();
    let mut both = suspects.iter().zip(pictures.iter().zip(new));
    let differs = both.find(|(_, (old, new))| {
        let features = old.features.as_ref();
        !is_picture(new.image(), &old.image) || features.is_some_and(|features| features != new.features())
    });
    Ok(differs.map(|(suspect, _)| Wrong::Picture(suspect.place)))
}

async fn wrong_individual(
    context: &StageContext,
    record: &CampaignRecord,
    suspects: &[Suspect],
    handle: &mut RunHandle,
) -> Result<Option<Wrong>, CampaignError> {
    let archived = archived(context, record, suspects).await?;
    let embedder = handle.unless_stopped(context.embedder(record)).await??;
    let moved = moved(context, record).await?;
    let tasks = archived
        .iter()
        .map(|old| (old.controller.clone(), old.seed))
        .collect();
    let job = EvaluationJob::of_individuals(record, embedder, tasks);
    let again = evaluated_again(context, job, handle).await?;
    let new = again.evaluations.iter().zip(&again.makers);
    let mut both = suspects.iter().zip(&archived).zip(new);
    let differs = both.find(|((suspect, old), (new, maker))| {
        // When an archive moves to another embedder, all its individuals are embedded again, perhaps by other workers.
        let embedded = embedder.is_some() && old.index >= moved;
        old.trials.iter().zip(*new).any(|(old, new)| {
            old.features.map(f64::to_bits) != new.features().map(f64::to_bits)
                || !old
                    .image
                    .as_ref()
                    .is_some_and(|image| is_picture(new.image(), image))
                || old.verdict != new.verdict()
                || (embedded
                    && !embeddings_agree((&old.embedding, suspect.kind), (new.embedding(), maker.kind)))
        })
    });
    Ok(differs.map(|((_, old), _)| Wrong::Individual {
        index: old.index,
        generation: old.generation,
    }))
}

/// Whether the compressed picture has these grey values.
fn is_picture(compressed: &CompressedImage, image: &[u8]) -> bool {
    compressed.pixels().is_ok_and(|pixels| pixels == image)
}

async fn wrong_embedding(
    context: &StageContext,
    record: &CampaignRecord,
    suspects: &[Suspect],
    handle: &mut RunHandle,
) -> Result<Option<Wrong>, CampaignError> {
    // If a move to another embedder is unfinished, all its embeddings are computed again without a comparison.
    let ArchiveEmbedder::Checkpoint(checkpoint) = record.embedder else {
        return Ok(suspects.first().map(|suspect| Wrong::Embedding(suspect.place)));
    };
    let archived = archived(context, record, suspects).await?;
    let embedder = context.checkpoints.embedder(checkpoint, record.spec.image());
    let job = EmbeddingJob {
        campaign: record.id.clone(),
        weight: record.weight,
        embedder: handle.unless_stopped(embedder).await??,
        starts: record.spec.starts(),
        images: archived.iter().map(|old| old.clone().into_images()).collect(),
    };
    let embed = |job_progress| context.dispatch.embed(job, job_progress);
    let again = handle.until_stopped(embed).await??;
    let mut both = suspects.iter().zip(&archived).zip(&again);
    let differs = both.find(|((suspect, old), (new, maker))| {
        let mut trials = old.trials.iter().zip(new);
        trials.any(|(old, new)| !embeddings_agree((&old.embedding, suspect.kind), (new, maker.kind)))
    });
    Ok(differs.map(|((_, old), _)| Wrong::Embedding(old.index)))
}

async fn archived(
    context: &StageContext,
    record: &CampaignRecord,
    suspects: &[Suspect],
) -> Result<Vec<ArchivedIndividual>, CampaignError> {
    let (id, model) = (record.id.clone(), record.spec.model().clone());
    read_all(context, suspects, move |store, index| {
        store.individual(&id, &model, index)
    })
    .await
}

/// Reads the stored results of the suspects, each with `read`.
async fn read_all<T: Send + 'static>(
    context: &StageContext,
    suspects: &[Suspect],
    read: impl Fn(&Store, u64) -> Result<T, StoreError> + Send + 'static,
) -> Result<Vec<T>, CampaignError> {
    let suspects = suspects.to_vec();
    let read = move |store: &Store| -> Result<_, StoreError> {
        let read = |suspect: Suspect| read(store, suspect.place);
        suspects.into_iter().map(read).collect()
    };
    Ok(context.store.run(read).await?)
}

/// Number of individuals in the archive when it moved to its current embedder; 0 while the archive moves to another embedder.
async fn moved(context: &StageContext, record: &CampaignRecord) -> Result<u64, CampaignError> {
    if record.embedder.next().is_some() {
        return Ok(0);
    }
    let id = record.id.clone();
    let read = move |store: &Store| store.embedded_when_moved(&id);
    Ok(context.store.run(read).await?)
}

/// Repeats the evaluations of a job on machines that are not quarantined.
async fn evaluated_again(
    context: &StageContext,
    job: EvaluationJob,
    handle: &mut RunHandle,
) -> Result<Done, CampaignError> {
    let tasks: Vec<(Controller, u64)> = job.tasks.clone();
    let same = |place: usize, _| Ok(vec![(place, tasks[place].clone())]);
    let evaluated = |progress| evaluate(&context.dispatch, progress, job, same);
    handle.until_stopped(evaluated).await?
}

/// The part of the campaign that must be rolled back because of a wrong result.
async fn rollback(
    context: &StageContext,
    record: &CampaignRecord,
    wrong: Wrong,
    workers: String,
) -> Result<Rollback, CampaignError> {
    let id = record.id.clone();
    let read = move |store: &Store| -> Result<_, StoreError> {
        Ok((store.label_entries(&id)?, store.embedded_when_moved(&id)?))
    };
    let (labels, moved) = context.store.run(read).await?;
    Rollback::of(record, wrong, labels, moved).ok_or_else(|| CampaignError::Tainted {
        id: record.id.clone(),
        wrong: wrong.to_string(),
        workers,
    })
}

impl Rollback {
    /// The part of the campaign that must be rolled back because of a wrong result; `None` if no rollback is possible. `labels`
    /// is the length of the campaign's label log. `moved` is the number of individuals when the archive moved to its embedder.
    fn of(record: &CampaignRecord, wrong: Wrong, labels: u64, moved: u64) -> Option<Self> {
        let moves = matches!(record.embedder, ArchiveEmbedder::Switching { from: Some(_), .. });
        let starts = match record.spec.embedder() {
            Some(EmbedderSource::Trained { dataset, .. }) => u64::from(dataset.starts()),
            Some(EmbedderSource::Published(_)) | None => 1,
        };
        match wrong {
            _ if record.rounds.current_cutoff.is_some() => None,
            Wrong::Picture(place) if labels == 0 && record.rounds.done == 0 && moved == 0 => {
                let pictures = place - place % starts;
                Some(Self::Dataset { pictures })
            }
            Wrong::Individual { index, generation } if index >= moved && !moves => {
                Some(Self::Generations { generation })
            }
            // No generation was bred with embeddings by the next embedder yet.
            Wrong::Embedding(_) if record.embedder.next().is_some() => Some(Self::Embeddings {
                kept: record.individuals(),
            }),
            Wrong::Embedding(_) => Some(Self::Embeddings { kept: moved }),
            Wrong::Picture(_) | Wrong::Individual { .. } => None,
        }
    }

    fn apply(self, store: &Store, id: &CampaignId, why: &str) -> Result<(), StoreError> {
        match self {
            Self::Dataset { pictures } => store.roll_back_dataset(id, pictures, why),
            Self::Generations { generation } => store.roll_back_generations(id, generation, why),
            Self::Embeddings { kept } => store.roll_back_embeddings(id, kept, why),
        }
    }

    fn because_of(self, wrong: Wrong) -> String {
        match self {
            Self::Dataset { .. } => {
                format!(
                    "{wrong} was wrong; all pictures from this picture on, and the embedder, are computed again"
                )
            }
            Self::Generations { generation } => {
                format!("{wrong} was wrong; the generations from {generation} on are evaluated again")
            }
            Self::Embeddings { .. } => format!("{wrong} was wrong; the archive is embedded again"),
        }
    }
}

impl std::fmt::Display for Wrong {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Picture(place) => write!(f, "picture {place} of the dataset"),
            Self::Individual { index, .. } => write!(f, "individual {index}"),
            Self::Embedding(index) => write!(f, "the embedding of individual {index}"),
        }
    }
}

#[cfg(test)]
mod tests;
