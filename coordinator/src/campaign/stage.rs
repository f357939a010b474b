//! What a campaign does next, as a function of what is on disk.

use crate::store::CampaignRecord;
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
        match (record.spec.embedder(), record.checkpoint) {
            (Some(EmbedderSource::Trained { dataset, .. }), None) => {
                if record.pictures_done < dataset.pictures() {
                    Self::Dataset
                } else {
                    Self::Pretrain
                }
            }
            _ if record.lesson.is_some() => Self::FineTune,
            _ if record.generations_done < record.generations() => Self::Evolve,
            _ if record.spec.feedback().map_or(0, Feedback::rounds) > record.rounds_done => Self::Label,
            _ => Self::Taxonomy,
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
