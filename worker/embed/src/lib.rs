//! Embeds images with a published checkpoint, on ONNX Runtime.
//!
//! [`Runtime`] is the loaded library. An [`Embedder`] is one checkpoint, ready to run on one thread. A [`Cache`] keeps
//! checkpoints on disk. [`Embedders`] uses a runtime and a cache to open checkpoints by digest for one thread. The crate has no
//! network code: the caller passes a function that fetches a missing checkpoint.

mod cache;
mod device;
mod embedder;
mod embedders;
mod runtime;

pub use cache::{Cache, CacheError, FetchError, checkpoint_folder};
pub use device::Device;
pub use embedder::{EmbedError, Embedder, MAX_BATCH};
pub use embedders::{Embedders, OpenError};
pub use runtime::{Runtime, RuntimeError, cache_folder};

#[cfg(test)]
mod tests;
