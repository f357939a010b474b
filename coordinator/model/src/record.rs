//! A campaign as it is stored, and the version of its archive.

use super::{ArchiveEmbedder, CampaignId, CampaignNotes, CampaignState, Weight};
use murmuration_swarm::{CampaignName, CampaignSpec, CheckpointDigest, EmbedderSource, Feedback};
use std::fmt;

#[derive(Debug, Clone, PartialEq)]
pub struct CampaignRecord {
    pub id: CampaignId,
    pub spec: CampaignSpec,
    /// The campaign's share of the workers.
    pub weight: Weight,
    pub study: Option<CampaignName>,
    pub notes: CampaignNotes,
    pub state: CampaignState,
    /// Why the campaign failed; empty in any other state.
    pub error: String,
    /// When the campaign was created, milliseconds since 1970-01-01 UTC.
    pub created_ms: u64,
    /// When the campaign stopped, milliseconds since 1970-01-01 UTC; `None` while it runs, or if the time was not recorded.
    pub ended_ms: Option<u64>,
    /// Number of rollbacks of the campaign.
    pub rollbacks: u64,
    /// Number of decisions about the campaign since it was created.
    pub decisions: u64,
    /// Version of the simulator that made the campaign's evaluations.
    pub simulator_version: String,
    /// Complete generations on disk.
    pub generations_done: u32,
    /// Best and mean novelty of the last complete generation.
    pub last_novelty: Option<(f64, f64)>,
    pub embedder: ArchiveEmbedder,
    /// Number of pictures on disk: pictures of the dataset, then pictures of labelled controllers from further starts.
    pub pictures_done: u64,
    pub rounds: Rounds,
}

impl CampaignRecord {
    /// The record of a campaign that has computed nothing yet, created at time 0.
    #[must_use]
    pub fn begun(id: CampaignId, spec: CampaignSpec) -> Self {
        Self {
            id,
            spec,
            weight: Weight::default(),
            study: None,
            notes: CampaignNotes::default(),
            state: CampaignState::Running,
            error: String::new(),
            created_ms: 0,
            ended_ms: None,
            rollbacks: 0,
            decisions: 0,
            simulator_version: String::new(),
            generations_done: 0,
            last_novelty: None,
            embedder: ArchiveEmbedder::None,
            pictures_done: 0,
            rounds: Rounds::default(),
        }
    }
}

/// The rounds of feedback of a campaign. A round's *label cutoff* is the number of entries, from the first of the label log, that
/// the round learns from. Later entries are for the next round.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Rounds {
    /// Number of rounds whose fine-tuned checkpoint the archive has switched to, or is switching to.
    pub done: u32,
    /// The label cutoff of the last of the `done` rounds; 0 before the first round.
    pub last_cutoff: u64,
    /// The label cutoff of the round in progress, if any.
    pub current_cutoff: Option<u64>,
}

/// Identifies a run: the work on a campaign between two decisions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunId {
    campaign: CampaignId,
    /// Number of decisions about the campaign before the run.
    number: u64,
}

impl RunId {
    pub const fn campaign(&self) -> &CampaignId {
        &self.campaign
    }

    /// Number of decisions about the campaign before the run.
    pub const fn number(&self) -> u64 {
        self.number
    }
}

/// Version of an archive: two reads of one version with equally many individuals give the same individuals and behaviours. The
/// text of a version, which scripts can compare, is its [`ArchiveVersion::origin`] and the digest of its checkpoint, if any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArchiveVersion {
    /// When the campaign was created, milliseconds since 1970-01-01 UTC. The time distinguishes campaigns with the same id in
    /// different data directories.
    pub created_ms: u64,
    /// Number of rollbacks of the campaign: a counter, and not a time, because a clock can be set back.
    pub rollbacks: u64,
    /// The checkpoint that embeds the archive, if any.
    pub checkpoint: Option<CheckpointDigest>,
}

impl ArchiveVersion {
    /// Text that distinguishes the archive's individuals from individuals that were rolled back, and from individuals of any
    /// other campaign with the same id.
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

/// The fields of a campaign that a search in the list of campaigns uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignHead {
    pub id: CampaignId,
    pub study: Option<CampaignName>,
    pub notes: CampaignNotes,
    pub state: CampaignState,
    /// The beginning of the campaign's specification as TOML: the fields outside of tables, such as `method`.
    pub opening: String,
}

impl CampaignRecord {
    /// The run that can change the campaign, if no decision was made after this record was read.
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

    /// Number of pictures of the campaign's dataset on disk; 0 without a dataset.
    pub fn dataset_done(&self) -> u64 {
        match self.spec.embedder() {
            Some(EmbedderSource::Trained { dataset, .. }) => self.pictures_done.min(dataset.pictures()),
            Some(EmbedderSource::Published(_)) | None => 0,
        }
    }

    /// Total number of generations, including the generations of the rounds so far.
    pub fn generations(&self) -> u32 {
        let further = self.spec.feedback().map_or(0, Feedback::generations);
        let further = further.saturating_mul(self.rounds.done);
        self.spec.search().generations().saturating_add(further)
    }

    /// Number of evaluations of all [`CampaignRecord::generations`].
    pub fn evaluations(&self) -> u64 {
        u64::from(self.generations()) * u64::from(self.spec.search().population())
    }

    /// Number of individuals of complete generations.
    pub fn individuals(&self) -> u64 {
        u64::from(self.generations_done) * u64::from(self.spec.search().population())
    }

    /// Number of individuals that taxonomy, map and report cover, the first of the archive, see [`CampaignSpec::sample`]; of all
    /// individuals without a sample.
    pub fn sampled(&self) -> u64 {
        let most = self.spec.sample().map_or(u64::MAX, u64::from);
        self.individuals().min(most)
    }
}
