//! The services that every stage uses, and the sizes of its chunks.

use super::{CampaignError, metrics::CampaignMetrics, registry::Registry};
use crate::synthetic::SyntheticAnnotator;
use murmuration_dispatch::{Dispatch, Trainers};
use murmuration_model::{CampaignId, CampaignRecord, EmbedderRef, RunId};
use murmuration_store::{Store, checkpoints::Checkpoints};
use murmuration_swarm::{CampaignSpec, ImageFormat};

/// The services that the stages of a campaign work with.
#[derive(Debug, Clone)]
pub(super) struct StageContext {
    /// The run's store, which refuses changes after the end of the run.
    pub(super) store: Store,
    pub(super) dispatch: Dispatch,
    pub(super) trainers: Trainers,
    pub(super) checkpoints: Checkpoints,
    pub(super) annotator: SyntheticAnnotator,
    pub(super) metrics: CampaignMetrics,
    /// The runs of all campaigns.
    pub(super) registry: Registry,
}

impl StageContext {
    /// A copy of this context whose store refuses changes after the end of `run`.
    pub(super) fn during(&self, run: RunId) -> Self {
        Self {
            store: self.store.during(run),
            ..self.clone()
        }
    }

    pub(super) async fn embedder(
        &self,
        record: &CampaignRecord,
    ) -> Result<Option<EmbedderRef>, CampaignError> {
        Ok(match record.embedder.checkpoint() {
            Some(checkpoint) => Some(self.checkpoints.embedder(checkpoint, record.spec.image()).await?),
            None => None,
        })
    }
}

/// Maximum size in bytes of the pictures that a stage holds at a time, if it can work in parts.
const PICTURE_BYTES: usize = 256 << 20;

/// Number of pictures that a stage handles at a time: as many as fit in `PICTURE_BYTES`, but at most `most`.
pub(super) fn pictures_at_once(image: &ImageFormat, most: usize) -> usize {
    (PICTURE_BYTES / image.bytes()).clamp(1, most)
}

/// Number of individuals whose pictures a stage handles at a time: as many as fit in `PICTURE_BYTES`, but at most `most`.
pub(super) fn individuals_at_once(spec: &CampaignSpec, most: usize) -> usize {
    (PICTURE_BYTES / spec.individual_bytes()).clamp(1, most)
}

/// Reads a campaign's current record from disk.
pub(super) async fn read(store: &Store, id: &CampaignId) -> Result<CampaignRecord, CampaignError> {
    let id = id.clone();
    Ok(store.run(move |store| store.campaign(id.as_str())).await?)
}
