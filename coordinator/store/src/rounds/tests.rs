//! Rounds on disk: each round begins and ends in one transaction, and learns from the label log as it was when the round began.

use super::*;
use crate::{ArchivedIndividual, CheckpointRecord, DataDirectory, GenerationRecord, Provenance};
use murmuration_model::{SavedTraining, Weight, labels::Action};
use murmuration_swarm::CampaignSpec;

/// A completed campaign of 5 individuals that began with a published checkpoint, and another checkpoint.
fn open() -> (tempfile::TempDir, Store, CampaignId, CheckpointDigest) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let checkpoints = [b"first", b"other"].map(|bytes| CheckpointRecord::of(bytes));
    for checkpoint in &checkpoints {
        store.add_checkpoint(checkpoint).unwrap();
    }
    let [first, second] = checkpoints.map(|checkpoint| checkpoint.digest);
    let spec = format!(
        "model = \"single-sensor\"\nmethod = \"latent\"\ncheckpoint = \"{first}\"\n\
         [search]\npopulation = 5\ngenerations = 1\n[taxonomy]\nmedoids = 2\n[feedback]\ngenerations = 3"
    );
    let id = store
        .create_campaign(&CampaignSpec::from_toml(&spec).unwrap(), Weight::default(), 7)
        .unwrap();
    let individual = |index: u64| ArchivedIndividual::pictured(index, 0, vec![index as u8; 2500]);
    let record = GenerationRecord::of(0, &[0.0], 0);
    let individuals: Vec<_> = (0..5).map(individual).collect();
    store
        .commit_generation(&id, &record, &individuals, &Provenance::default())
        .unwrap();
    store.set_state(&id, CampaignState::Completed, "").unwrap();
    (folder, store, id, second)
}

fn answer(index: u64, class: &str) -> Change {
    Change {
        annotator: "ana".parse().unwrap(),
        time_ms: 1,
        action: Action::Answer {
            index,
            answer: class.parse().unwrap(),
        },
    }
}

fn request(id: &str) -> RequestId {
    id.parse().unwrap()
}

#[test]
fn a_round_learns_from_the_labels_of_its_beginning() {
    let (_folder, store, id, checkpoint) = open();
    let message = vec![answer(3, "ring"), answer(1, "clump"), answer(2, "not sure")];
    store.add_labels(&id, &request("a"), message).unwrap();
    store.begin_round(&id, 3).unwrap();
    store
        .add_labels(&id, &request("b"), vec![answer(3, "clump"), answer(0, "ring")])
        .unwrap();
    let record = store.campaign("latest").unwrap();
    assert_eq!(
        (record.state, record.rounds.current_cutoff),
        (CampaignState::Running, Some(3))
    );
    let classes = store.labels_until(&id, 3).unwrap().numbered_classes();
    assert_eq!(classes, [(1, 1), (3, 2)], "clump comes before ring");
    assert!(
        store.learned_classes(&record).unwrap().is_empty(),
        "not learned from yet"
    );
    store.finish_round(&id, checkpoint).unwrap();
    let record = store.campaign("latest").unwrap();
    assert_eq!(store.learned_classes(&record).unwrap(), [(1, 1), (3, 2)].into());
}

#[test]
fn the_end_of_a_round_is_a_move_and_further_generations() {
    let (_folder, store, id, checkpoint) = open();
    assert_eq!(store.campaign("latest").unwrap().generations(), 1);
    store.begin_round(&id, 0).unwrap();
    store.finish_round(&id, checkpoint).unwrap();
    let record = store.campaign("latest").unwrap();
    assert_eq!((record.rounds.done, record.rounds.current_cutoff), (1, None));
    assert_eq!(
        (record.embedder.next(), record.generations()),
        (Some(checkpoint), 4)
    );

    let absent = CheckpointDigest::of(b"absent");
    let before = store.campaign("latest").unwrap();
    let error = store.finish_round(&id, absent).unwrap_err();
    assert!(matches!(error, StoreError::NoCheckpoint(_)), "{error}");
    assert_eq!(store.campaign("latest").unwrap(), before);
}

#[test]
fn a_round_that_begins_again_forgets_the_training_on_other_labels() {
    let (_folder, store, id, _) = open();
    store.begin_round(&id, 1).unwrap();
    let saved = SavedTraining {
        epoch: 3,
        bytes: vec![1, 2],
    };
    store.save_training(&id, &saved).unwrap();
    store.begin_round(&id, 2).unwrap();
    assert_eq!(store.saved_training(&id).unwrap(), None);
}

#[test]
fn answers_and_the_round_that_learns_from_them_are_one() {
    let (_folder, store, id, _) = open();
    store
        .add_labels(&id, &request("before"), vec![answer(4, "ring")])
        .unwrap();
    let message = || vec![answer(0, "ring"), answer(1, "clump")];
    for _ in 0..2 {
        store
            .answer_round(&id, &RequestId::of_round(1), message())
            .unwrap();
        assert_eq!(store.campaign("latest").unwrap().rounds.current_cutoff, Some(3));
    }
    let (log, record) = (store.label_log(&id).unwrap(), store.campaign("latest").unwrap());
    let error = store.answer_round(&id, &RequestId::of_round(2), vec![answer(0, "x"), answer(5, "x")]);
    let error = error.unwrap_err();
    assert!(
        matches!(
            error,
            LabelError::Store(StoreError::NoIndividual { index: 5, .. })
        ),
        "{error}"
    );
    assert_eq!(store.label_log(&id).unwrap(), log);
    assert_eq!(store.campaign("latest").unwrap(), record);
}

#[test]
fn without_a_dataset_the_archive_is_looked_at() {
    let (_folder, store, id, _) = open();
    let record = store.campaign(id.as_str()).unwrap();
    let pictures = TrainingPictures::of(&record);
    assert_eq!((pictures.views, pictures.behaviours), (1, 5));
    let images = store.training_images(&record, 3..100).unwrap();
    assert_eq!(images, [[3; 2500], [4; 2500]].concat());
}
