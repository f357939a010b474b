//! Documents about exports, checkpoints and data directories: backups, and the findings of `doctor`.

use super::Time;
use murmuration_export::Exported;
use murmuration_store::{
    backup::Manifest,
    checkpoints::Condition,
    doctor::{self, CampaignFindings, Findings},
};
use murmuration_swarm::{CheckpointDigest, text::masked_url};
use schemars::JsonSchema;
use serde::Serialize;

/// A backup.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Backup {
    /// The folder that was written.
    folder: String,
    /// When the backup was made.
    created: Time,
    /// BLAKE3 of the database, in hexadecimal digits.
    database: String,
    /// Digests of the checkpoints that the database names.
    checkpoints: Vec<String>,
    /// Location of the checkpoints; null if they are in the backup.
    checkpoint_store: Option<String>,
}

/// The condition of a data directory.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Doctor {
    /// Whether there is no damage.
    healthy: bool,
    /// Path of the database.
    database: String,
    /// Version of the database's schema.
    database_schema: u32,
    /// Damage to the database as a whole.
    faults: Vec<String>,
    /// Every checkpoint that the database names, oldest first.
    checkpoints: Vec<CheckpointState>,
    /// Every campaign, oldest first.
    campaigns: Vec<CampaignReport>,
}

/// The condition of a checkpoint.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct CheckpointState {
    /// Digest of the checkpoint.
    checkpoint: String,
    condition: CheckpointCondition,
}

/// Whether a checkpoint's bytes match its digest.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum CheckpointCondition {
    Whole,
    Missing,
    Damaged,
    Unread,
}

/// The condition of a campaign.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct CampaignReport {
    /// Id of the campaign.
    campaign: String,
    /// State of the campaign; null if the state cannot be read.
    state: Option<&'static str>,
    condition: CampaignCondition,
    /// Amounts of data in the database.
    stored: Amounts,
    /// Amounts of undamaged data, counted from the beginning of the campaign.
    whole: Amounts,
    /// Kinds of damage.
    problems: Vec<String>,
    /// Further advice; null if there is none.
    note: Option<String>,
}

/// Whether a campaign can continue.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum CampaignCondition {
    Whole,
    LacksCheckpoint,
    Damaged,
    Unreadable,
}

/// Amounts of a campaign's data.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Amounts {
    /// Pictures of the dataset.
    pictures: u64,
    /// Number of generations.
    generations: u32,
    /// Number of individuals.
    individuals: u64,
    /// Entries of the label log.
    labels: u64,
    /// Whether a taxonomy exists.
    taxonomy: bool,
}

impl Backup {
    pub(crate) fn new(folder: String, manifest: &Manifest) -> Self {
        Self {
            folder,
            created: Time::of_ms(manifest.created_ms),
            database: manifest.database.clone(),
            checkpoints: manifest.checkpoints.clone(),
            checkpoint_store: manifest.checkpoint_store.as_deref().map(masked_url),
        }
    }
}

impl Doctor {
    pub(crate) fn new(found: &Findings) -> Self {
        Self {
            healthy: found.is_healthy(),
            database: found.database.display().to_string(),
            database_schema: found.schema,
            faults: found.faults.clone(),
            checkpoints: found.checkpoints.iter().map(CheckpointState::of).collect(),
            campaigns: found.campaigns.iter().map(CampaignReport::of).collect(),
        }
    }
}

impl CheckpointState {
    fn of((digest, condition): &(CheckpointDigest, Condition)) -> Self {
        Self {
            checkpoint: digest.to_string(),
            condition: match condition {
                Condition::Whole => CheckpointCondition::Whole,
                Condition::Missing => CheckpointCondition::Missing,
                Condition::Damaged => CheckpointCondition::Damaged,
                Condition::Unread(_) => CheckpointCondition::Unread,
            },
        }
    }
}

impl CampaignReport {
    fn of(campaign: &CampaignFindings) -> Self {
        Self {
            campaign: campaign.id.to_string(),
            state: campaign.state.map(|state| state.name()),
            condition: match campaign.condition {
                doctor::CampaignCondition::Whole => CampaignCondition::Whole,
                doctor::CampaignCondition::LacksCheckpoint => CampaignCondition::LacksCheckpoint,
                doctor::CampaignCondition::Damaged => CampaignCondition::Damaged,
                doctor::CampaignCondition::Unreadable => CampaignCondition::Unreadable,
            },
            stored: Amounts::of(&campaign.stored),
            whole: Amounts::of(&campaign.whole),
            problems: campaign.problems.clone(),
            note: campaign.note.clone(),
        }
    }
}

impl Amounts {
    const fn of(amounts: &doctor::Amounts) -> Self {
        Self {
            pictures: amounts.pictures,
            generations: amounts.generations,
            individuals: amounts.individuals,
            labels: amounts.labels,
            taxonomy: amounts.taxonomy,
        }
    }
}

/// A campaign that was exported.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Export {
    /// Id of the campaign.
    campaign: String,
    /// State of the campaign at its export: running, paused, completed, failed or cancelled.
    state: &'static str,
    /// The folder that was written.
    folder: String,
    /// Paths of the written files within the folder.
    files: Vec<String>,
    /// Complete generations.
    generations: u32,
    /// Individuals of the complete generations.
    individuals: u64,
    /// Entries of the label log.
    label_entries: u64,
    /// The checkpoint that embeds the archive; null if there is none.
    checkpoint: Option<String>,
    /// The digest of the archive, BLAKE3 in hexadecimal digits.
    digest: String,
}

impl From<&Exported> for Export {
    fn from(exported: &Exported) -> Self {
        let record = &exported.campaign.record;
        let checkpoint = record.embedder.checkpoint();
        Self {
            campaign: record.id.to_string(),
            state: record.state.name(),
            folder: exported.folder.display().to_string(),
            files: exported.files.clone(),
            generations: record.generations_done,
            individuals: record.individuals(),
            label_entries: exported.campaign.label_entries,
            checkpoint: checkpoint.map(|digest| digest.to_string()),
            digest: exported.campaign.digest.clone(),
        }
    }
}
