//! The embedder of a campaign's archive: none, a checkpoint, or one checkpoint until the switch to another.

use murmuration_proto::CheckpointDigest;

/// The embedder of a campaign's archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArchiveEmbedder {
    /// Nothing: the campaign's behaviour space has no embedding, or its embedder is still to be trained.
    None,
    Checkpoint(CheckpointDigest),
    /// The archive switches to another checkpoint.
    Switching {
        /// The checkpoint that embeds it until then, if one does.
        from: Option<CheckpointDigest>,
        /// The checkpoint that embeds it from then on.
        to: CheckpointDigest,
        /// Individuals, from index 0, that are embedded with that on disk.
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

    /// Individuals that are embedded with the [next](Self::next) checkpoint on disk.
    pub const fn embedded(&self) -> u64 {
        match *self {
            Self::Switching { embedded, .. } => embedded,
            Self::None | Self::Checkpoint(_) => 0,
        }
    }
}

/// Which published embedder: as far as jobs need to know it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EmbedderRef {
    pub checkpoint: CheckpointDigest,
    /// Numbers in an embedding, 1 or more.
    pub dimensions: usize,
}
