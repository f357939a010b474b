//! Embeds images with a published checkpoint, on ONNX Runtime.
//!
//! [`Runtime`] is the library, loaded once; an [`Embedder`] is one checkpoint ready to run on one thread; a [`Cache`]
//! keeps checkpoints on disk; [`Embedders`] puts the three together for a thread that is asked for checkpoints by
//! digest. Knows nothing of the network: whoever has a missing checkpoint's bytes fetched passes a function.
#![deny(missing_docs)]

mod cache;
mod embedder;
mod embedders;
mod kind;
mod runtime;

pub use cache::{Cache, CacheError, FetchError, checkpoint_folder};
pub use embedder::{EmbedError, Embedder, MAX_BATCH};
pub use embedders::{CheckpointError, Embedders};
pub use runtime::{ONNX_RUNTIME_VERSION, Runtime, RuntimeError, cache_folder};

#[cfg(test)]
mod tests;
