//! Pictures for training an embedder, and saved trainings.

use super::CampaignRecord;
use murmuration_swarm::{CheckpointDigest, EmbedderSource};

/// Maximum number of individuals of an archive in a training without a dataset.
const MOST_FROM_ARCHIVE: u64 = 10_000;

/// A training that was interrupted and saved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SavedTraining {
    pub epoch: u64,
    /// The snapshot that the trainer resumes from.
    pub bytes: Vec<u8>,
}

/// The training that a campaign needs before it goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NextTraining {
    /// The training of the first embedder, without labels.
    Pretraining,
    /// The training of a round of feedback.
    FineTuning {
        parent: CheckpointDigest,
        /// The round's label cutoff.
        cutoff: u64,
    },
}

impl NextTraining {
    /// The next training of a campaign; `None` if it needs none.
    pub fn of(record: &CampaignRecord) -> Option<Self> {
        match (record.embedder.checkpoint(), record.spec.embedder()) {
            (None, Some(EmbedderSource::Trained { .. })) => Some(Self::Pretraining),
            (None, _) => None,
            (Some(parent), _) => {
                let cutoff = record.rounds.current_cutoff?;
                Some(Self::FineTuning { parent, cutoff })
            }
        }
    }
}

/// The source of the unlabelled pictures on which a campaign's embedders are trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrainingPictures {
    /// Number of pictures of each behaviour.
    pub views: u32,
    pub behaviours: u32,
    /// Whether the pictures come from the archive, because there is no dataset.
    from_archive: bool,
}

impl TrainingPictures {
    /// The pictures of a campaign: its dataset, or the beginning of its archive if the campaign began with a published
    /// checkpoint.
    pub fn of(record: &CampaignRecord) -> Self {
        match record.spec.embedder() {
            Some(EmbedderSource::Trained { dataset, .. }) => Self {
                views: dataset.starts(),
                behaviours: dataset.controllers(),
                from_archive: false,
            },
            Some(EmbedderSource::Published(_)) | None => Self {
                views: 1,
                behaviours: record.individuals().min(MOST_FROM_ARCHIVE) as u32,
                from_archive: true,
            },
        }
    }

    /// Whether the pictures come from the archive, because there is no dataset.
    pub const fn is_from_archive(&self) -> bool {
        self.from_archive
    }

    /// Number of pictures from the dataset.
    pub const fn in_dataset(&self) -> u64 {
        if self.from_archive { 0 } else { self.count() }
    }

    pub const fn count(&self) -> u64 {
        self.views as u64 * self.behaviours as u64
    }
}
