//! The next stage of a campaign, as a function of its state on disk.

use crate::{CampaignRecord, NextTraining};
use murmuration_proto::v1;
use murmuration_swarm::{EmbedderSource, Feedback};

/// The stage of a running campaign, or the first stage of a stopped campaign once it resumes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Simulates sampled controllers for the training.
    Dataset,
    Pretrain,
    /// Embeds the whole archive with the next checkpoint, and switches the archive to it.
    Embed,
    Evolve,
    Label,
    FineTune,
    Taxonomy,
}

impl Stage {
    pub fn of(record: &CampaignRecord) -> Self {
        if record.embedder.next().is_some() {
            return Self::Embed;
        }
        match NextTraining::of(record) {
            // A campaign that adopted an embedder before its dataset was complete also makes the missing pictures.
            Some(_) if lacks_pictures(record) => Self::Dataset,
            Some(NextTraining::Pretraining) => Self::Pretrain,
            Some(NextTraining::FineTuning { .. }) => Self::FineTune,
            None if record.generations_done < record.generations() => Self::Evolve,
            None if record.spec.feedback().map_or(0, Feedback::rounds) > record.rounds.done => Self::Label,
            None => Self::Taxonomy,
        }
    }
}

/// Whether pictures of the dataset are missing.
fn lacks_pictures(record: &CampaignRecord) -> bool {
    match record.spec.embedder() {
        Some(EmbedderSource::Trained { dataset, .. }) => record.pictures_done < dataset.pictures(),
        Some(EmbedderSource::Published(_)) | None => false,
    }
}

impl From<Stage> for v1::CampaignStage {
    fn from(stage: Stage) -> Self {
        match stage {
            Stage::Dataset => Self::Dataset,
            Stage::Pretrain => Self::Pretrain,
            Stage::Embed => Self::Embed,
            Stage::Evolve => Self::Evolve,
            Stage::Label => Self::Label,
            Stage::FineTune => Self::FineTune,
            Stage::Taxonomy => Self::Taxonomy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ArchiveEmbedder, Rounds};
    use murmuration_swarm::{CampaignSpec, CheckpointDigest};

    /// A campaign with its embedder and all pictures.
    fn record() -> CampaignRecord {
        CampaignRecord {
            embedder: ArchiveEmbedder::Checkpoint(CheckpointDigest::of(b"own")),
            pictures_done: 20_000,
            ..CampaignRecord::begun(
                "two-1".parse().unwrap(),
                CampaignSpec::from_toml("model = \"two-sensor\"\nmethod = \"latent\"").unwrap(),
            )
        }
    }

    fn learning() -> Rounds {
        Rounds {
            current_cutoff: Some(9),
            ..Rounds::default()
        }
    }

    #[test]
    fn a_round_is_learned_and_moved_to_before_the_search_goes_on() {
        let searching = record();
        assert_eq!(Stage::of(&searching), Stage::Evolve);
        let learning = CampaignRecord {
            rounds: learning(),
            ..searching
        };
        assert_eq!(Stage::of(&learning), Stage::FineTune);
        let taught = CheckpointDigest::of(b"taught");
        let moving = CampaignRecord {
            rounds: Rounds {
                done: 1,
                last_cutoff: 9,
                current_cutoff: None,
            },
            embedder: ArchiveEmbedder::Switching {
                from: learning.embedder.checkpoint(),
                to: taught,
                embedded: 0,
            },
            ..learning
        };
        assert_eq!(Stage::of(&moving), Stage::Embed);
        let moved = CampaignRecord {
            embedder: ArchiveEmbedder::Checkpoint(taught),
            ..moving
        };
        assert_eq!(Stage::of(&moved), Stage::Evolve);
    }

    #[test]
    fn whatever_is_to_be_trained_has_its_pictures_first() {
        let searching = CampaignRecord {
            pictures_done: 7,
            ..record()
        };
        assert_eq!(Stage::of(&searching), Stage::Evolve);
        let taught = CampaignRecord {
            rounds: learning(),
            ..searching
        };
        assert_eq!(Stage::of(&taught), Stage::Dataset);
    }
}
