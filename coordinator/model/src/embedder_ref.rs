//! Which published embedder: as far as jobs need to know it.

use murmuration_proto::CheckpointDigest;

/// Which published embedder: as far as jobs need to know it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EmbedderRef {
    /// Its checkpoint.
    pub checkpoint: CheckpointDigest,
    /// Numbers in an embedding, 1 or more.
    pub dimensions: usize,
}
