use super::*;
use murmuration_model::{Rounds, Weight};
use murmuration_store::DataDirectory;
use murmuration_swarm::{CampaignSpec, CheckpointDigest};

/// A latent campaign just after its creation.
fn created() -> CampaignRecord {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let text = "model = \"single-sensor\"\nmethod = \"latent\"\n[dataset]\ncontrollers = 100\nstarts = 2";
    let spec = CampaignSpec::from_toml(text).unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    store.campaign(id.as_str()).unwrap()
}

fn embedded() -> CampaignRecord {
    CampaignRecord {
        embedder: ArchiveEmbedder::Checkpoint(CheckpointDigest::of(b"embedder")),
        ..created()
    }
}

const INDIVIDUAL: Wrong = Wrong::Individual {
    index: 250,
    generation: 2,
};

#[test]
fn a_wrong_picture_begins_the_campaign_again_from_the_first_of_its_controller() {
    let begin = Some(Rollback::Dataset { pictures: 6 });
    for record in [created(), embedded()] {
        assert_eq!(Rollback::of(&record, Wrong::Picture(7), 0, 0), begin);
        // A rollback would lose people's labels.
        assert_eq!(Rollback::of(&record, Wrong::Picture(7), 1, 0), None);
        assert_eq!(Rollback::of(&record, Wrong::Picture(7), 0, 100), None);
    }
}

#[test]
fn a_wrong_individual_takes_its_generation_back_unless_the_archive_has_moved_since() {
    let back = Some(Rollback::Generations { generation: 2 });
    assert_eq!(Rollback::of(&embedded(), INDIVIDUAL, 0, 0), back);
    assert_eq!(Rollback::of(&embedded(), INDIVIDUAL, 30, 250), back);
    assert_eq!(Rollback::of(&embedded(), INDIVIDUAL, 30, 251), None);
    let moving = CampaignRecord {
        embedder: ArchiveEmbedder::Switching {
            from: embedded().embedder.checkpoint(),
            to: CheckpointDigest::of(b"next"),
            embedded: 0,
        },
        ..embedded()
    };
    assert_eq!(Rollback::of(&moving, INDIVIDUAL, 0, 0), None);
    let learning = CampaignRecord {
        rounds: Rounds {
            current_cutoff: Some(30),
            ..Rounds::default()
        },
        ..embedded()
    };
    assert_eq!(Rollback::of(&learning, INDIVIDUAL, 30, 0), None);
}

#[test]
fn a_wrong_embedding_has_the_archive_embedded_again() {
    let again = Some(Rollback::Embeddings { kept: 200 });
    assert_eq!(Rollback::of(&embedded(), Wrong::Embedding(3), 30, 200), again);
    // In a move, 200 is the number of individuals that the next embedder has embedded so far, and no generation depends on them.
    let moving = CampaignRecord {
        embedder: ArchiveEmbedder::Switching {
            from: embedded().embedder.checkpoint(),
            to: CheckpointDigest::of(b"next"),
            embedded: 200,
        },
        generations_done: 5,
        ..embedded()
    };
    let all = Some(Rollback::Embeddings { kept: 500 });
    assert_eq!(Rollback::of(&moving, Wrong::Embedding(3), 30, 200), all);
}
