//! Published embedders for the evaluation threads: fetched from the coordinator and cached on disk.

use murmuration_embed::{
    Cache, CacheError, Device, EmbedError, Embedders, FetchError, OpenError, Runtime as OnnxRuntime,
    RuntimeError,
};
use murmuration_link::{Calls, fetch_checkpoint, may_pass_elsewhere};
use murmuration_proto::v1;
use murmuration_swarm::CheckpointDigest;
use std::{
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};
use tokio::{runtime::Handle, sync::oneshot};
use tonic::Status;
use tracing::Instrument as _;

/// Maximum number of bytes of checkpoints on disk (1 GiB, enough for thousands of checkpoints).
const MAX_CACHE_BYTES: u64 = 1 << 30;

/// The source of checkpoints for all threads of a worker.
pub(super) struct Checkpoints {
    calls: Calls,
    /// The tokio runtime that fetches checkpoints while the threads wait.
    runtime: Handle,
    folder: PathBuf,
    /// The device of the embedders.
    device: Device,
    /// The cache, which is opened at its first use.
    cache: Mutex<Option<Arc<Cache>>>,
}

/// Why no embedder is available.
#[derive(Debug, thiserror::Error)]
pub(super) enum Unavailable {
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    #[error(transparent)]
    Cache(#[from] CacheError),
    #[error(transparent)]
    Open(#[from] OpenError),
}

impl Unavailable {
    /// Whether another machine, or this machine later, may succeed: true if the problem is this machine's ONNX Runtime, card, cache or
    /// permission to fetch, or an unavailable coordinator.
    pub(super) fn may_be_had_elsewhere(&self) -> bool {
        match self {
            Self::Runtime(_) | Self::Cache(_) => true,
            Self::Open(OpenError::Fetch(error)) => match error {
                FetchError::Cache(_) => true,
                FetchError::Source { error, .. } => error
                    .downcast_ref()
                    .is_some_and(|NotFetched(status)| may_pass_elsewhere(status)),
                FetchError::Mismatch { .. } => false,
            },
            Self::Open(OpenError::Open { error, .. }) => matches!(error, EmbedError::Card { .. }),
            Self::Open(OpenError::Model { .. }) => false,
        }
    }
}

/// The coordinator did not send the checkpoint.
#[derive(Debug, thiserror::Error)]
#[error("{}", .0.message())]
pub(super) struct NotFetched(Status);

impl Checkpoints {
    /// Checkpoints from the coordinator of these `calls`, cached in `folder`, for embedders on `device`. Call this function on a
    /// tokio runtime.
    pub(super) fn new(calls: Calls, folder: PathBuf, device: Device) -> Self {
        Self {
            calls,
            runtime: Handle::current(),
            folder,
            device,
            cache: Mutex::new(None),
        }
    }

    /// Embedders for one thread; loads ONNX Runtime.
    pub(super) fn embedders(&self) -> Result<Embedders, Unavailable> {
        let runtime = OnnxRuntime::load()?.on(self.device)?;
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        let cache = match &*cache {
            Some(cache) => cache,
            None => cache.insert(Arc::new(Cache::open(&self.folder, MAX_CACHE_BYTES)?)),
        };
        Ok(Embedders::new(runtime, cache.clone()))
    }

    /// Fetches the bytes of a checkpoint for a lease, without checking them. This function blocks, so call it from threads
    /// outside the tokio runtime.
    pub(super) fn fetch(&self, digest: CheckpointDigest, lease: v1::LeaseId) -> Result<Vec<u8>, NotFetched> {
        let (reply, answer) = oneshot::channel();
        let calls = self.calls.clone();
        let fetching = async move {
            // The receiver exists, because the calling thread blocks on it.
            let _ = reply.send(fetch_checkpoint(&calls, digest, lease).await);
        };
        self.runtime.spawn(fetching.in_current_span());
        answer
            .blocking_recv()
            .unwrap_or_else(|_| Err(Status::unavailable("the worker is leaving")))
            .map_err(NotFetched)
    }
}
