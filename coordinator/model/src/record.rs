//! A campaign as it is stored, and the version of its archive.

use super::{ArchiveEmbedder, CampaignId, CampaignState, Weight};
use murmuration_swarm::{CampaignName, CampaignSpec, CheckpointDigest, EmbedderSource, Feedback};
use std::fmt;

#[derive(Debug, Clone, PartialEq)]
pub struct CampaignRecord {
    pub id: CampaignId,
    pub spec: CampaignSpec,
    /// Its share of the workers.
    pub weight: Weight,
    pub study: Option<CampaignName>,
    pub state: CampaignState,
    /// Why it failed; empty in any other state.
    pub error: String,
    /// When it was created, milliseconds since 1970-01-01 UTC.
    pub created_ms: u64,
    /// When it stopped, milliseconds since 1970-01-01 UTC; `None` while it runs, or if the time was not recorded.
    pub ended_ms: Option<u64>,
    /// Number of times that part of it was rolled back.
    pub rollbacks: u64,
    /// Number of decisions about it since it was created.
    pub decisions: u64,
    /// Version of the simulator that its evaluations come from.
    pub simulator_version: String,
    /// Complete generations on disk.
    pub generations_done: u32,
    /// Best and mean novelty of the last complete generation.
    pub last_novelty: Option<(f64, f64)>,
    pub embedder: ArchiveEmbedder,
    /// Pictures of its dataset on disk, followed by those of the further starts of labelled controllers.
    pub pictures_done: u64,
    pub rounds: Rounds,
}

/// The rounds of feedback of a campaign. A round's *label cutoff* is the length of the beginning of the label log that it learns
/// from. Later entries are for the next round.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rounds {
    /// Rounds whose fine-tuned checkpoint the archive has switched, or switches, to.
    pub done: u32,
    /// The label cutoff of the last of them; 0 before the first.
    pub last_cutoff: u64,
    /// The label cutoff of the round in progress, if any.
    pub current_cutoff: Option<u64>,
}

/// A campaign between two decisions about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunId {
    campaign: CampaignId,
    /// Number of decisions before it.
    number: u64,
}

impl RunId {
    pub const fn campaign(&self) -> &CampaignId {
        &self.campaign
    }

    /// Number of decisions before it.
    pub const fn number(&self) -> u64 {
        self.number
    }
}

/// Version of an archive: two reads of one version with equally many individuals give the same individuals and behaviours. As text,
/// for scripts to compare, it is its [`ArchiveVersion::origin`], and the digest of the checkpoint if there is one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArchiveVersion {
    /// When the campaign was created, milliseconds since 1970-01-01 UTC. It distinguishes campaigns of one id in different data
    /// directories.
    pub created_ms: u64,
    /// Number of times that part of it was rolled back. A counter, because a clock may be set back.
    pub rollbacks: u64,
    /// The checkpoint that embeds it.
    pub checkpoint: Option<CheckpointDigest>,
}

impl ArchiveVersion {
    /// Text that distinguishes its individuals from those of any other campaign of this id, and from individuals that were rolled
    /// back.
    pub fn origin(&self) -> String {
        match self.rollbacks {
            0 => self.created_ms.to_string(),
            count => format!("{}.{count}", self.created_ms),
        }
    }
}

impl fmt::Display for ArchiveVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.origin())?;
        match self.checkpoint {
            Some(checkpoint) => write!(f, "-{checkpoint}"),
            None => Ok(()),
        }
    }
}

/// The fields of a campaign that a search of the list uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignHead {
    pub id: CampaignId,
    pub study: Option<CampaignName>,
    pub state: CampaignState,
    /// The beginning of its specification as TOML: the fields outside of tables, such as `method`.
    pub opening: String,
}

impl CampaignRecord {
    /// The run that may change the campaign, as long as no decision was made after this read.
    pub fn run_id(&self) -> RunId {
        RunId {
            campaign: self.id.clone(),
            number: self.decisions,
        }
    }

    pub fn archive_version(&self) -> ArchiveVersion {
        ArchiveVersion {
            created_ms: self.created_ms,
            rollbacks: self.rollbacks,
            checkpoint: self.embedder.checkpoint(),
        }
    }

    /// Pictures of its dataset on disk; 0 without a dataset.
    pub fn dataset_done(&self) -> u64 {
        match self.spec.embedder() {
            Some(EmbedderSource::Trained { dataset, .. }) => self.pictures_done.min(dataset.pictures()),
            Some(EmbedderSource::Published(_)) | None => 0,
        }
    }

    /// Number of generations in total, including those of the rounds so far.
    pub fn generations(&self) -> u32 {
        let further = self.spec.feedback().map_or(0, Feedback::generations);
        let further = further.saturating_mul(self.rounds.done);
        self.spec.search().generations().saturating_add(further)
    }

    /// Number of evaluations of all these generations.
    pub fn evaluations(&self) -> u64 {
        u64::from(self.generations()) * u64::from(self.spec.search().population())
    }

    /// Number of individuals of complete generations.
    pub fn individuals(&self) -> u64 {
        u64::from(self.generations_done) * u64::from(self.spec.search().population())
    }
}
