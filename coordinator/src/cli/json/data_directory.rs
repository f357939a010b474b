//! What is kept in a data directory, and copied from it.

use super::Time;
use murmuration_proto::CheckpointDigest;
use murmuration_store::{
    Recoverable,
    backup::Manifest,
    checkpoints::Condition,
    doctor::{CampaignFindings, Findings, Prospect, Salvaged},
};
use schemars::JsonSchema;
use serde::Serialize;

/// A backup.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Backup {
    /// The folder that was written.
    folder: String,
    /// When the backup was made.
    created: Time,
    /// BLAKE3 of the database, in hexadecimal digits.
    database: String,
    /// Digests of the checkpoints that the database names.
    checkpoints: Vec<String>,
    /// Where the checkpoints are kept; null if they are in the backup.
    checkpoint_store: Option<String>,
}

/// The condition of a data directory.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Doctor {
    /// Whether nothing is damaged.
    healthy: bool,
    /// Path of the database.
    database: String,
    /// Version of the database's schema.
    database_schema: u32,
    /// What is wrong with the database as a whole.
    faults: Vec<String>,
    /// Every checkpoint that the database names, oldest first.
    checkpoints: Vec<CheckpointState>,
    /// Every campaign, oldest first.
    campaigns: Vec<CampaignReport>,
    /// What was copied; null without --salvage.
    salvaged: Option<Copied>,
}

/// The condition of a checkpoint.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct CheckpointState {
    /// Its digest.
    checkpoint: String,
    condition: CheckpointCondition,
}

/// Whether a checkpoint's bytes are those of its digest.
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
    /// Its id.
    campaign: String,
    /// Its state; null if it cannot be read.
    state: Option<&'static str>,
    condition: CampaignCondition,
    /// What the database holds.
    stored: Amounts,
    /// How much of it is undamaged, from the beginning on.
    whole: Amounts,
    /// What is damaged.
    problems: Vec<String>,
    /// What to know besides; null if there is nothing.
    note: Option<String>,
}

/// Whether a campaign can go on.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(inline)]
enum CampaignCondition {
    Whole,
    LacksCheckpoint,
    Partly,
    Lost,
}

/// How much there is of a campaign.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Amounts {
    /// Pictures of the dataset.
    pictures: u64,
    /// Generations.
    generations: u32,
    /// Individuals.
    individuals: u64,
    /// Entries of the label log.
    labels: u64,
    /// Whether there is a taxonomy.
    taxonomy: bool,
}

/// What --salvage copied.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Copied {
    /// Ids of the campaigns in the new data directory.
    campaigns: Vec<String>,
    /// The campaigns that could not be copied.
    lost: Vec<Lost>,
    /// Digests of the checkpoints in the new data directory.
    checkpoints: Vec<String>,
}

/// A campaign that could not be copied.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct Lost {
    /// Its id.
    campaign: String,
    /// Why.
    reason: String,
}

impl Backup {
    pub(in crate::cli) fn new(folder: String, manifest: &Manifest) -> Self {
        Self {
            folder,
            created: Time::of_ms(manifest.created_ms),
            database: manifest.database.clone(),
            checkpoints: manifest.checkpoints.clone(),
            checkpoint_store: manifest.checkpoint_store.clone(),
        }
    }
}

impl Doctor {
    pub(in crate::cli) fn new(found: &Findings, salvaged: Option<&Salvaged>) -> Self {
        Self {
            healthy: found.is_healthy(),
            database: found.database.display().to_string(),
            database_schema: found.schema,
            faults: found.faults.clone(),
            checkpoints: found.checkpoints.iter().map(CheckpointState::of).collect(),
            campaigns: found.campaigns.iter().map(CampaignReport::of).collect(),
            salvaged: salvaged.map(Copied::of),
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
            condition: match campaign.prospect {
                Prospect::Whole => CampaignCondition::Whole,
                Prospect::LacksCheckpoint => CampaignCondition::LacksCheckpoint,
                Prospect::Partly => CampaignCondition::Partly,
                Prospect::Lost => CampaignCondition::Lost,
            },
            stored: Amounts::of(&campaign.stored),
            whole: Amounts::of(&campaign.remains),
            problems: campaign.problems.clone(),
            note: campaign.note.clone(),
        }
    }
}

impl Amounts {
    const fn of(amounts: &Recoverable) -> Self {
        Self {
            pictures: amounts.pictures,
            generations: amounts.generations,
            individuals: amounts.individuals,
            labels: amounts.labels,
            taxonomy: amounts.taxonomy,
        }
    }
}

impl Copied {
    fn of(salvaged: &Salvaged) -> Self {
        let lost = salvaged.lost.iter().map(|(campaign, reason)| Lost {
            campaign: campaign.to_string(),
            reason: reason.clone(),
        });
        Self {
            campaigns: salvaged.campaigns.iter().map(ToString::to_string).collect(),
            lost: lost.collect(),
            checkpoints: salvaged.checkpoints.iter().map(ToString::to_string).collect(),
        }
    }
}
