//! Published embedders for the evaluation threads: fetched from the coordinator, kept on disk.

use murmuration_embed::{
    Cache, CacheError, CheckpointError, Embedders, FetchError, Runtime as OnnxRuntime, RuntimeError,
};
use murmuration_link::{Coordinator, fetch_checkpoint, may_pass_elsewhere};
use murmuration_proto::{CheckpointDigest, v1};
use std::{
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};
use tokio::{runtime::Handle, sync::oneshot};
use tonic::Status;
use tracing::Instrument as _;

/// Most bytes of checkpoints on disk (1 GiB: thousands of them).
const MAX_CACHE_BYTES: u64 = 1 << 30;

/// Where all threads of a worker have their checkpoints from.
pub(super) struct Checkpoints {
    coordinator: Coordinator,
    /// Where fetching runs: the threads themselves only wait.
    runtime: Handle,
    folder: PathBuf,
    /// Opened when it is first wanted.
    cache: Mutex<Option<Arc<Cache>>>,
}

/// Why there is no embedder.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unavailable {
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    #[error(transparent)]
    Cache(#[from] CacheError),
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

impl Unavailable {
    /// Whether another machine may have it, or this one later: ONNX Runtime or the cache's disk is this machine's affair, as
    /// is what it may fetch; or the coordinator was away.
    pub(super) fn may_be_had_elsewhere(&self) -> bool {
        match self {
            Self::Runtime(_) | Self::Cache(_) => true,
            Self::Checkpoint(CheckpointError::Fetch(error)) => match error {
                FetchError::Cache(_) => true,
                FetchError::Source { error, .. } => error
                    .downcast_ref()
                    .is_some_and(|NotFetched(status)| may_pass_elsewhere(status)),
                FetchError::Mismatch { .. } => false,
            },
            Self::Checkpoint(CheckpointError::Model { .. } | CheckpointError::Open { .. }) => false,
        }
    }
}

/// The coordinator did not give it.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.message())]
pub(super) struct NotFetched(Status);

impl Checkpoints {
    /// Those of the coordinator at the other end of `coordinator`, kept in `folder`. Must be called on a tokio runtime.
    pub(super) fn new(coordinator: Coordinator, folder: PathBuf) -> Self {
        Self {
            coordinator,
            runtime: Handle::current(),
            folder,
            cache: Mutex::new(None),
        }
    }

    /// Embedders for one thread; loads ONNX Runtime.
    pub(super) fn embedders(&self) -> Result<Embedders, Unavailable> {
        let runtime = OnnxRuntime::load()?;
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        let cache = match &*cache {
            Some(cache) => cache,
            None => cache.insert(Arc::new(Cache::open(&self.folder, MAX_CACHE_BYTES)?)),
        };
        Ok(Embedders::new(runtime, cache.clone()))
    }

    /// The bytes that the coordinator has under this digest, unchecked, for a lease. Blocks: for threads outside the runtime.
    pub(super) fn fetch(&self, digest: CheckpointDigest, lease: v1::LeaseId) -> Result<Vec<u8>, NotFetched> {
        let (reply, answer) = oneshot::channel();
        let coordinator = self.coordinator.clone();
        let fetching = async move {
            // The thread waits for it.
            let _ = reply.send(fetch_checkpoint(&coordinator, digest, lease).await);
        };
        self.runtime.spawn(fetching.in_current_span());
        answer
            .blocking_recv()
            .unwrap_or_else(|_| Err(Status::unavailable("the worker is leaving")))
            .map_err(NotFetched)
    }
}
