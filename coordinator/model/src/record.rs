//! A campaign as it is stored, and what its archive is of.

use super::{ArchiveEmbedder, CampaignId, CampaignState, Rounds, Weight};
use murmuration_proto::{CampaignName, CampaignSpec, CheckpointDigest, EmbedderSource, Feedback};
use std::fmt;

/// A campaign as it is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct CampaignRecord {
    /// Its id.
    pub id: CampaignId,
    /// What it was asked to do.
    pub spec: CampaignSpec,
    /// Its share of the workers.
    pub weight: Weight,
    /// The study that it was started for.
    pub study: Option<CampaignName>,
    /// Where it stands.
    pub state: CampaignState,
    /// Why it failed; empty unless it did.
    pub error: String,
    /// When it was created, milliseconds since 1970-01-01 UTC.
    pub created_ms: u64,
    /// When it stopped, milliseconds since 1970-01-01 UTC; `None` while it runs, and where nobody noted it.
    pub ended_ms: Option<u64>,
    /// How many times something of it was rolled back.
    pub rollbacks: u64,
    /// How many decisions have been made about it since it was created.
    pub decisions: u64,
    /// Version of the simulator that its evaluations come from.
    pub simulator_version: String,
    /// Complete generations on disk.
    pub generations_done: u32,
    /// Best and mean novelty of the last complete generation.
    pub last_novelty: Option<(f64, f64)>,
    /// What embeds its archive.
    pub embedder: ArchiveEmbedder,
    /// Pictures of its dataset on disk, those of the further starts of labelled controllers behind them.
    pub pictures_done: u64,
    /// Its rounds of feedback.
    pub rounds: Rounds,
}

/// What an archive's individuals and behaviours are of: whatever is made of as many of them, of one archive version, is the same.
/// As text, for scripts to compare: its [`ArchiveVersion::origin`], and the digest of the checkpoint if there is one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArchiveVersion {
    /// When the campaign was created, milliseconds since 1970-01-01 UTC: it tells apart campaigns of one id in different data
    /// directories.
    pub created_ms: u64,
    /// How many times something of it was rolled back: counted, for a clock may be set back.
    pub rollbacks: u64,
    /// The checkpoint whose embeddings it holds.
    pub checkpoint: Option<CheckpointDigest>,
}

impl ArchiveVersion {
    /// What tells its individuals from those of any other campaign of this id, and from those that were rolled back.
    #[must_use]
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

/// What a list of campaigns is searched by.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignHead {
    /// Its id.
    pub id: CampaignId,
    /// The study that it is a cell of.
    pub study: Option<CampaignName>,
    /// Its state on disk.
    pub state: CampaignState,
    /// The first lines of its specification, as TOML: the fields outside of tables, such as `method`.
    pub opening: String,
}

impl CampaignRecord {
    /// The archive version that its archive is of.
    #[must_use]
    pub fn archive_version(&self) -> ArchiveVersion {
        ArchiveVersion {
            created_ms: self.created_ms,
            rollbacks: self.rollbacks,
            checkpoint: self.embedder.checkpoint(),
        }
    }

    /// Pictures of its dataset on disk; 0 where it has none.
    #[must_use]
    pub fn dataset_done(&self) -> u64 {
        match self.spec.embedder() {
            Some(EmbedderSource::Trained { dataset, .. }) => self.pictures_done.min(dataset.pictures()),
            Some(EmbedderSource::Published(_)) | None => 0,
        }
    }

    /// Generations that there are to be, those after the rounds so far included.
    #[must_use]
    pub fn generations(&self) -> u32 {
        let further = self.spec.feedback().map_or(0, Feedback::generations);
        let further = further.saturating_mul(self.rounds.done);
        self.spec.search().generations().saturating_add(further)
    }

    /// Number of individuals of complete generations.
    #[must_use]
    pub fn individuals(&self) -> u64 {
        u64::from(self.generations_done) * u64::from(self.spec.search().population())
    }
}
