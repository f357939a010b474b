//! What a campaign does next, as a function of what is on disk.

use crate::CampaignRecord;
use murmuration_proto::{EmbedderSource, Feedback, v1};

/// What a running campaign does, or one that does not run would do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Sampled controllers are simulated, to be trained on.
    Dataset,
    /// An embedder is trained.
    Pretrain,
    /// All that is stored is embedded with the next checkpoint, and the archive switches to it.
    Embed,
    /// Generations are proposed and evaluated.
    Evolve,
    /// The synthetic annotator labels individuals.
    Label,
    /// An embedder is fine-tuned on labels.
    FineTune,
    /// The archive is clustered.
    Taxonomy,
}

impl Stage {
    /// The stage that a campaign has come to.
    #[must_use]
    pub fn of(record: &CampaignRecord) -> Self {
        if record.next_checkpoint.is_some() {
            return Self::Embed;
        }
        let (lacks_pictures, lacks_embedder) = match record.spec.embedder() {
            Some(EmbedderSource::Trained { dataset, .. }) => (
                record.pictures_done < dataset.pictures(),
                record.checkpoint.is_none(),
            ),
            Some(EmbedderSource::Published(_)) | None => (false, false),
        };
        match record.lesson {
            // Also of a campaign that adopted an embedder before it had its pictures.
            lesson if lacks_pictures && (lacks_embedder || lesson.is_some()) => Self::Dataset,
            _ if lacks_embedder => Self::Pretrain,
            Some(_) => Self::FineTune,
            None if record.generations_done < record.generations() => Self::Evolve,
            None if record.spec.feedback().map_or(0, Feedback::rounds) > record.rounds_done => Self::Label,
            None => Self::Taxonomy,
        }
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
    use crate::{CampaignState, Weight};
    use murmuration_proto::{CampaignSpec, CheckpointDigest};

    /// A campaign with its embedder and all pictures.
    fn record() -> CampaignRecord {
        CampaignRecord {
            id: "two-1".parse().unwrap(),
            spec: CampaignSpec::from_toml("model = \"two-sensor\"\nmethod = \"latent\"").unwrap(),
            weight: Weight::default(),
            state: CampaignState::Running,
            error: String::new(),
            created_ms: 7,
            taken_back: 0,
            decisions: 0,
            simulator_version: String::new(),
            generations_done: 0,
            last_novelty: None,
            checkpoint: Some(CheckpointDigest::of(b"own")),
            next_checkpoint: None,
            pictures_done: 20_000,
            embedded: 0,
            rounds_done: 0,
            lesson: None,
            learned: None,
        }
    }

    #[test]
    fn a_round_is_learned_and_moved_to_before_the_search_goes_on() {
        let searching = record();
        assert_eq!(Stage::of(&searching), Stage::Evolve);
        let learning = CampaignRecord {
            lesson: Some(9),
            ..searching
        };
        assert_eq!(Stage::of(&learning), Stage::FineTune);
        let moving = CampaignRecord {
            lesson: None,
            rounds_done: 1,
            next_checkpoint: Some(CheckpointDigest::of(b"taught")),
            ..learning
        };
        assert_eq!(Stage::of(&moving), Stage::Embed);
        let moved = CampaignRecord {
            checkpoint: moving.next_checkpoint,
            next_checkpoint: None,
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
            lesson: Some(9),
            ..searching
        };
        assert_eq!(Stage::of(&taught), Stage::Dataset);
    }
}
