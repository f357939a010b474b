//! Whole campaigns, part by part: from a store to a client, and from a client into a store of their own until they are whole.
//!
//! Limits: the pictures of a dataset, snapshots of trainings, notices and provenance are not transferred. The pictures can be
//! simulated again, and the others are about this store.

mod incoming;
mod messages;
mod outgoing;
mod rows;
mod sequence;
mod takeover;

pub(crate) use incoming::remove_leftovers;
pub use incoming::{ImportError, Incoming};
pub use outgoing::{Outgoing, OutgoingError};
pub use sequence::Sequence;

use crate::{ArchivedIndividual, CheckpointRecord, ClusterMeasures, GenerationRecord};
use murmuration_model::{
    ExportedCampaign,
    labels::{Entry, RequestId},
};
use murmuration_proto::PART_BYTES;

/// Entries of a label log in a part.
pub const PART_ENTRIES: usize = 1000;

/// As many of the next individuals as a part has room for, and one at least where there is one: `bytes` says how long one is as a
/// message.
///
/// # Errors
/// Those of `next`.
pub fn fill_part<T, E>(
    mut next: impl FnMut() -> Result<Option<T>, E>,
    bytes: impl Fn(&T) -> usize,
) -> Result<Vec<T>, E> {
    let (mut part, mut so_far) = (Vec::new(), 0);
    while so_far < PART_BYTES {
        let Some(one) = next()? else { break };
        so_far += bytes(&one);
        part.push(one);
    }
    Ok(part)
}

/// A part of a campaign. Parts come in the order of the variants; a checkpoint comes with its bytes behind it, and a
/// generation with its individuals.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// The campaign itself.
    Campaign(Box<ExportedCampaign>),
    /// A checkpoint; its parent came before it.
    Checkpoint(CheckpointRecord),
    /// Bytes of the last checkpoint, in order.
    Chunk(Vec<u8>),
    /// Entries of the label log, in order, each with the request that it came with.
    Labels(Vec<(RequestId, Entry)>),
    /// A generation.
    Generation(GenerationRecord),
    /// Individuals of the last generation, by index.
    Individuals(Vec<Member>),
    /// The taxonomy, of a completed campaign.
    Taxonomy(Medoids),
}

/// An individual, with its place in the taxonomy.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// The individual, with its pictures.
    pub individual: ArchivedIndividual,
    /// The place of its medoid, from 0, if the campaign is completed.
    pub cluster: Option<u32>,
    /// The number of its trials to which no other medoid is nearer than its own, if the campaign is completed and of several
    /// starts.
    pub robust_trials: Option<u8>,
}

/// The medoids of a taxonomy, largest cluster first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Medoids {
    /// Each medoid's index, and what is measured of its cluster.
    pub medoids: Vec<(u64, ClusterMeasures)>,
    /// Sum of the distances of all individuals to their medoids, in units of the behaviour space.
    pub loss: f64,
}
