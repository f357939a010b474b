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
    /// A further member of the committee is trained, or fine-tuned as the campaign's own embedder was.
    Committee,
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
        let lacks_member = record.members_ready < record.members_wanted();
        match record.lesson {
            // Also of a campaign that adopted an embedder before it had its pictures.
            lesson if lacks_pictures && (lacks_embedder || lesson.is_some() || lacks_member) => Self::Dataset,
            _ if lacks_embedder => Self::Pretrain,
            Some(_) => Self::FineTune,
            None if lacks_member => Self::Committee,
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
            Stage::Committee => Self::Committee,
            Stage::Taxonomy => Self::Taxonomy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        campaign::Weight,
        store::{DataDirectory, Store},
    };
    use murmuration_proto::{CampaignSpec, CheckpointDigest};

    /// A campaign with its embedder, as many further members, and all pictures.
    fn record(committee: u32) -> CampaignRecord {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let text =
            format!("model = \"two-sensor\"\nmethod = \"latent\"\n[feedback]\ncommittee = {committee}");
        let spec = CampaignSpec::from_toml(&text).unwrap();
        store.create_campaign(&spec, Weight::default(), 7).unwrap();
        CampaignRecord {
            pictures_done: 20_000,
            checkpoint: Some(CheckpointDigest::of(b"own")),
            ..store.campaign("latest").unwrap()
        }
    }

    #[test]
    fn the_committee_is_brought_as_far_as_the_campaigns_own_embedder_before_the_search_goes_on() {
        assert_eq!(Stage::of(&record(1)), Stage::Evolve);
        let mut record = record(3);
        for (seated, ready, stage) in [
            (0, 0, Stage::Committee),
            (1, 1, Stage::Committee),
            (2, 2, Stage::Evolve),
        ] {
            (record.members, record.members_ready) = (seated, ready);
            assert_eq!((Stage::of(&record), record.lesson_of_stage()), (stage, None));
        }
        // A round: the campaign's own learns first, and is moved to.
        record.lesson = Some(9);
        assert_eq!(
            (Stage::of(&record), record.lesson_of_stage()),
            (Stage::FineTune, Some(9))
        );
        (record.lesson, record.learned, record.rounds_done) = (None, Some(9), 1);
        record.next_checkpoint = Some(CheckpointDigest::of(b"taught"));
        assert_eq!(Stage::of(&record), Stage::Embed);
        (record.next_checkpoint, record.members_ready) = (None, 1);
        assert_eq!(
            (Stage::of(&record), record.lesson_of_stage()),
            (Stage::Committee, Some(9))
        );
    }

    #[test]
    fn whatever_is_to_be_trained_has_its_pictures_first() {
        let searching = CampaignRecord {
            pictures_done: 7,
            ..record(1)
        };
        assert_eq!(Stage::of(&searching), Stage::Evolve);
        let taught = CampaignRecord {
            lesson: Some(9),
            ..searching
        };
        assert_eq!(Stage::of(&taught), Stage::Dataset);
        let compared = CampaignRecord {
            pictures_done: 7,
            ..record(2)
        };
        assert_eq!(Stage::of(&compared), Stage::Dataset);
    }
}
