//! What the members of a campaign's committee see in its archive: the workers embed all of it with each of them, whenever
//! an order of questions is made. Nothing of that is stored: no result rests on it but which questions are asked.

use super::committee::{Committee, NoCommittee};
use crate::{
    campaign::{CampaignId, blocking},
    checkpoints::{CheckpointError, Checkpoints},
    dispatch::{Dispatch, Embedder, EmbeddingJob, JobError},
    novelty::{Behaviours, Misfit},
    space::{Space, SpaceError},
    store::{ArchivedIndividual, CampaignRecord, Edition, Store, StoreError},
};
use murmuration_proto::CheckpointDigest;
use std::{ops::Range, sync::Arc};

/// Pictures embedded at a time.
const CHUNK: u64 = 2048;

/// Who embeds archives for committees; cheap to clone.
#[derive(Debug, Clone)]
pub struct Viewers {
    /// Where archives and members are.
    pub store: Store,
    /// Where the members' bytes are.
    pub checkpoints: Checkpoints,
    /// Who has the workers embed.
    pub dispatch: Dispatch,
}

/// An archive as its committee sees it.
#[derive(Debug)]
pub(super) struct Viewed {
    pub(super) committee: Committee,
    /// What they look at, and what the first of them is.
    pub(super) edition: Edition,
}

/// Why an archive is not seen by a committee.
#[derive(Debug, thiserror::Error)]
pub enum UnviewedError {
    /// It has none.
    #[error("campaign {0} has a single embedder; submit it with `committee = 3` in its [feedback]")]
    Alone(CampaignId),
    /// Members are still to be trained, or to learn what the campaign's own embedder has learned.
    #[error("the committee of campaign {0} is not trained yet; ask by medoids until it is")]
    Unready(CampaignId),
    /// The store could not be read.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The archive cannot be read as behaviours.
    #[error("{0}")]
    Space(#[from] SpaceError),
    /// A member cannot be used.
    #[error("{0}")]
    Checkpoint(#[from] CheckpointError),
    /// The workers could not embed.
    #[error("{0}")]
    Job(#[from] JobError),
    /// A worker returned embeddings that cannot be compared.
    #[error("a worker returned an impossible embedding: {0}")]
    Misfit(#[from] Misfit),
    /// What the members see cannot be compared.
    #[error("{0}")]
    Committee(#[from] NoCommittee),
    /// A bug: something broke off.
    #[error("an archive could not be looked at; the log says where it broke off (this is a bug)")]
    Broken,
}

impl Viewers {
    /// The archive as far as `record` says that it goes, as the campaign's own embedder and every further member see it.
    /// Waits until there are workers.
    pub(super) async fn view(&self, record: &CampaignRecord) -> Result<Viewed, UnviewedError> {
        let wanted = record.members_wanted();
        if wanted == 0 {
            return Err(UnviewedError::Alone(record.id.clone()));
        }
        if record.members_ready < wanted {
            return Err(UnviewedError::Unready(record.id.clone()));
        }
        let (store, own) = (self.store.clone(), record.clone());
        let (space, members) = read(move || {
            let members = store.committee(&own.id)?;
            Ok::<_, UnviewedError>((Space::read(&store, &own)?, members))
        })
        .await?;
        let mut views = vec![space.behaviours];
        for member in members {
            views.push(self.view_of(record, member).await?);
        }
        Ok(Viewed {
            committee: Committee::new(views)?,
            edition: space.edition,
        })
    }

    /// The archive as one further member sees it.
    async fn view_of(
        &self,
        record: &CampaignRecord,
        member: CheckpointDigest,
    ) -> Result<Behaviours, UnviewedError> {
        let method = record.spec.method();
        let embedder = self.checkpoints.embedder(member, record.spec.image()).await?;
        let mut view: Option<Behaviours> = None;
        let individuals = record.individuals();
        for start in (0..individuals).step_by(CHUNK as usize) {
            let range = start..individuals.min(start + CHUNK);
            for (features, embedding) in self.embedded(record, embedder, range).await? {
                let behaviour = method.behaviour(&features, &embedding);
                view.get_or_insert_with(|| Behaviours::new(behaviour.len()))
                    .push(&behaviour)?;
            }
        }
        Ok(view.unwrap_or_else(|| Behaviours::new(0)))
    }

    /// Features and embeddings of some individuals.
    async fn embedded(
        &self,
        record: &CampaignRecord,
        embedder: Embedder,
        range: Range<u64>,
    ) -> Result<Vec<([f64; 5], Vec<f32>)>, UnviewedError> {
        let (store, id, model) = (self.store.clone(), record.id.clone(), record.spec.model());
        let individuals = read(move || store.individuals(&id, model, range, true)).await?;
        let (features, images) = individuals.into_iter().map(seen).unzip();
        let job = EmbeddingJob {
            campaign: record.id.clone(),
            weight: record.weight,
            embedder,
            images,
        };
        let embeddings = self.dispatch.embed(job, Arc::default()).await?;
        let embeddings = embeddings.into_iter().map(|(embedding, _)| embedding);
        Ok(Vec::into_iter(features).zip(embeddings).collect())
    }
}

fn seen(individual: ArchivedIndividual) -> ([f64; 5], Vec<u8>) {
    (individual.features, individual.image.unwrap_or_default())
}

/// Reads where it does not hold up the network.
async fn read<T: Send + 'static, E: Into<UnviewedError> + Send + 'static>(
    work: impl FnOnce() -> Result<T, E> + Send + 'static,
) -> Result<T, UnviewedError> {
    match blocking(work).await {
        Ok(read) => read.map_err(Into::into),
        Err(_) => Err(UnviewedError::Broken),
    }
}
