//! The embedder of a campaign's archive: none, a checkpoint, or one checkpoint until the switch to another.

use murmuration_swarm::CheckpointDigest;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArchiveEmbedder {
    /// The campaign's behaviour space has no embedding, or its embedder is not trained yet.
    None,
    Checkpoint(CheckpointDigest),
    /// The archive switches to another checkpoint.
    Switching {
        /// The checkpoint that embeds the archive until the switch, if any.
        from: Option<CheckpointDigest>,
        /// The checkpoint that embeds the archive from the switch on.
        to: CheckpointDigest,
        /// Number of individuals on disk, from index 0, that are embedded with `to`.
        embedded: u64,
    },
}

impl ArchiveEmbedder {
    /// The checkpoint whose embeddings the archive holds.
    pub const fn checkpoint(&self) -> Option<CheckpointDigest> {
        match *self {
            Self::None => None,
            Self::Checkpoint(checkpoint) => Some(checkpoint),
            Self::Switching { from, .. } => from,
        }
    }

    /// The checkpoint that the archive switches to.
    pub const fn next(&self) -> Option<CheckpointDigest> {
        match *self {
            Self::Switching { to, .. } => Some(to),
            Self::None | Self::Checkpoint(_) => None,
        }
    }

    /// Number of individuals on disk that are embedded with the [next](Self::next) checkpoint.
    pub const fn embedded(&self) -> u64 {
        match *self {
            Self::Switching { embedded, .. } => embedded,
            Self::None | Self::Checkpoint(_) => 0,
        }
    }
}

/// A published embedder, with the data that jobs need about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EmbedderRef {
    pub checkpoint: CheckpointDigest,
    /// Numbers in an embedding, 1 or more.
    pub dimensions: usize,
}
