//! The embedders that one thread has open, by digest. The most recently used embedders stay open.

use super::{Cache, EmbedError, Embedder, FetchError, Runtime};
use murmuration_onnx::{EmbedderModel, ModelError};
use murmuration_swarm::CheckpointDigest;
use std::{error::Error, sync::Arc};

/// Number of embedders that a thread keeps open: enough for two campaigns that both change to their next checkpoints.
const MOST_OPEN: usize = 4;

/// Opens checkpoints for one thread. Several threads can share the cache.
#[derive(Debug)]
pub struct Embedders {
    runtime: Runtime,
    cache: Arc<Cache>,
    /// Open embedders, most recently used first.
    open: Vec<(CheckpointDigest, Embedder)>,
}

/// Why an embedder is not available.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The checkpoint's bytes are not available.
    #[error(transparent)]
    Fetch(#[from] FetchError),
    /// The bytes are not an embedder.
    #[error("checkpoint {digest}: {error}")]
    Model {
        digest: CheckpointDigest,
        error: ModelError,
    },
    /// ONNX Runtime cannot run the embedder.
    #[error("checkpoint {digest}: {error}")]
    Open {
        digest: CheckpointDigest,
        error: EmbedError,
    },
}

impl Embedders {
    /// Begins without open embedders.
    #[must_use]
    pub const fn new(runtime: Runtime, cache: Arc<Cache>) -> Self {
        Self {
            runtime,
            cache,
            open: Vec::new(),
        }
    }

    /// The embedder of the checkpoint with this digest. [`Cache::get_or_fetch`] describes `fetch`.
    ///
    /// # Errors
    /// Fails if the checkpoint is not available, is not an embedder, or does not run.
    pub fn get<E: Into<Box<dyn Error + Send + Sync>>>(
        &mut self,
        digest: CheckpointDigest,
        fetch: impl FnOnce(CheckpointDigest) -> Result<Vec<u8>, E>,
    ) -> Result<&mut Embedder, OpenError> {
        let embedder = match self.open.iter().position(|(of, _)| *of == digest) {
            Some(at) => self.open.remove(at).1,
            None => self.open_checkpoint(digest, fetch)?,
        };
        self.open.truncate(MOST_OPEN - 1);
        self.open.insert(0, (digest, embedder));
        Ok(&mut self.open[0].1)
    }

    #[cfg(test)]
    pub(super) const fn open(&self) -> usize {
        self.open.len()
    }

    fn open_checkpoint<E: Into<Box<dyn Error + Send + Sync>>>(
        &self,
        digest: CheckpointDigest,
        fetch: impl FnOnce(CheckpointDigest) -> Result<Vec<u8>, E>,
    ) -> Result<Embedder, OpenError> {
        let bytes = self.cache.get_or_fetch(digest, fetch)?;
        let model = EmbedderModel::read(&bytes).map_err(|error| OpenError::Model { digest, error })?;
        Embedder::open(&self.runtime, model).map_err(|error| OpenError::Open { digest, error })
    }
}
