//! Runs and decisions, in every order.

use super::*;
use crate::{ArchivedIndividual, DataDirectory, GenerationRecord, Picture, Provenance, Switch};
use murmuration_model::{SavedTraining, Weight, labels::RequestId};
use murmuration_search::medoids::Clustering;
use murmuration_swarm::{CampaignSpec, Controller, Preset};

fn open() -> (tempfile::TempDir, Store, CampaignId) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"latent\"").unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    (folder, store, id)
}

/// The handle of the store for the campaign's current run.
fn running(store: &Store, id: &CampaignId) -> Store {
    store.during(store.campaign(id.as_str()).unwrap().run_id())
}

fn checkpoint(store: &Store) -> CheckpointDigest {
    let record = crate::CheckpointRecord::of(b"checkpoint");
    store.add_checkpoint(&record).unwrap();
    record.digest
}

/// A change that a stage makes.
type Commit = fn(&Store, &CampaignId) -> Result<(), StoreError>;

const COMMITS: [(&str, Commit); 12] = [
    ("an epoch", |store, id| {
        let epoch = crate::EpochRecord {
            round: 0,
            epoch: 1,
            loss: None,
            accuracy: None,
        };
        store.add_epoch(id, &epoch)
    }),
    ("a generation", |store, id| {
        let record = GenerationRecord::of(0, &[0.0], 0);
        let individuals = [ArchivedIndividual::still(0, 0)];
        store.commit_generation(id, &record, &individuals, &Provenance::default())
    }),
    ("pictures", |store, id| {
        let picture = Picture {
            features: None,
            controller: Controller::new(Preset::SingleSensor, &[0.0; 4]).unwrap(),
            seed: 1,
            image: vec![0; 2500],
        };
        store.add_pictures(id, 0, &[picture], &Provenance::default())
    }),
    ("embeddings", |store, id| {
        store.add_embeddings(id, 0, &[vec![vec![0.5]]], &Provenance::default())
    }),
    ("a switch", |store, id| {
        let nothing = Switch {
            novelty: Vec::new(),
            generations: Vec::new(),
        };
        store.switch(id, &nothing)
    }),
    ("a move", |store, id| {
        store.move_to(id, CheckpointDigest::of(b"checkpoint"))
    }),
    ("a round's end", |store, id| {
        store.finish_round(id, CheckpointDigest::of(b"checkpoint"))
    }),
    ("a snapshot", |store, id| {
        let training = SavedTraining {
            epoch: 1,
            bytes: vec![1],
        };
        store.save_training(id, &training)
    }),
    ("a round's answers", |store, id| {
        let answered = store.answer_round(id, &RequestId::of_round(1), Vec::new());
        answered.map_err(|error| match error {
            crate::LabelError::Store(error) => error,
            refused => panic!("{refused}"),
        })
    }),
    ("what is rolled back", |store, id| {
        store.roll_back_generations(id, 0, "wrong")
    }),
    ("a failure", |store, id| {
        store.set_state(id, CampaignState::Failed, "for want of room")
    }),
    ("a taxonomy", |store, id| {
        let none = Clustering {
            medoids: Vec::new(),
            clusters: Vec::new(),
            loss: 0.0,
        };
        store.complete(id, &none, &[], &[], &[]).map(drop)
    }),
];

#[test]
fn no_stage_changes_a_campaign_about_which_something_was_decided() {
    type Decide = fn(&Store, &CampaignId);
    let decisions: [(&str, Decide); 4] = [
        ("paused", |store, id| {
            store.decide(id, Decision::Pause, false).unwrap()
        }),
        ("cancelled", |store, id| {
            store.decide(id, Decision::Cancel, false).unwrap();
        }),
        // The campaign resumes, so another run has begun.
        ("resumed", |store, id| {
            store.decide(id, Decision::Pause, false).unwrap();
            store.decide(id, Decision::Resume, false).unwrap();
        }),
        ("moved", |store, id| {
            let checkpoint = CheckpointDigest::of(b"checkpoint");
            store.decide(id, Decision::Adopt(checkpoint), false).unwrap();
        }),
    ];
    for (commit, make) in COMMITS {
        for (decided, decide) in decisions {
            let (_folder, store, id) = open();
            checkpoint(&store);
            let run = running(&store, &id);
            decide(&store, &id);
            let before = store.campaign(id.as_str()).unwrap();
            let refused = make(&run, &id);
            assert!(
                matches!(&refused, Err(StoreError::Superseded(campaign)) if *campaign == id),
                "{commit} of a campaign that was {decided}: {refused:?}"
            );
            assert_eq!(store.campaign(id.as_str()).unwrap(), before, "{commit}");
            assert_eq!(store.taxonomy(&id).unwrap(), None);
            assert_eq!(store.saved_training(&id).unwrap(), None);
        }
    }
}

#[test]
fn a_run_makes_every_change_until_something_is_decided() {
    for (commit, make) in COMMITS {
        let (_folder, store, id) = open();
        let checkpoint = checkpoint(&store);
        if commit == "embeddings" || commit == "a switch" {
            store.move_to(&id, checkpoint).unwrap();
        }
        let made = make(&running(&store, &id), &id);
        assert!(made.is_ok(), "{commit}: {made:?}");
    }
}

#[test]
fn a_run_that_has_ended_has_no_last_word() {
    let (_folder, store, id) = open();
    let run = running(&store, &id);
    run.set_state(&id, CampaignState::Failed, "for want of room")
        .unwrap();
    let late = run.complete(
        &id,
        &Clustering {
            medoids: Vec::new(),
            clusters: Vec::new(),
            loss: 0.0,
        },
        &[],
        &[],
        &[],
    );
    assert!(matches!(late, Err(StoreError::Superseded(_))), "{late:?}");
    assert_eq!(store.campaign(id.as_str()).unwrap().state, CampaignState::Failed);
}

#[test]
fn a_decision_goes_by_the_state_that_is() {
    let (_folder, store, id) = open();
    let none = Clustering {
        medoids: Vec::new(),
        clusters: Vec::new(),
        loss: 0.0,
    };
    // The campaign completes between a person's click and the decision.
    store.complete(&id, &none, &[], &[], &[]).unwrap();
    for decision in [Decision::Pause, Decision::Cancel, Decision::Resume] {
        let refused = store.decide(&id, decision, false).unwrap_err().to_string();
        assert!(refused.ends_with("it was already completed"), "{refused}");
    }
    assert_eq!(store.campaign(id.as_str()).unwrap().decisions, 0);
    assert!(store.reopen(&id).unwrap());
    assert!(!store.reopen(&id).unwrap());
    // The run failed, and its failure could not be recorded.
    let refused = store.decide(&id, Decision::Pause, true).unwrap_err().to_string();
    assert!(refused.ends_with("it is failed"), "{refused}");
    store.decide(&id, Decision::Resume, true).unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    assert_eq!((record.state, record.decisions), (CampaignState::Running, 2));
    // A refused decision changes nothing.
    let absent = Decision::Adopt(CheckpointDigest::of(b"absent"));
    assert!(store.decide(&id, absent, false).is_err());
    assert_eq!(store.campaign(id.as_str()).unwrap(), record);
}
