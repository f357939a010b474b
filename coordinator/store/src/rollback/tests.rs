use super::*;
use crate::{
    ArchivedIndividual, GenerationRecord, Provenance,
    provenance::tests::{open, suspect, wrong},
};
use murmuration_model::labels::Answer;
use murmuration_swarm::Preset;

fn left(store: &Store, id: &CampaignId) -> Vec<u64> {
    let individuals = store.individuals(id, &Preset::SingleSensor.into(), 0..9, true);
    individuals.unwrap().iter().map(|left| left.index).collect()
}

fn answer(store: &Store, id: &CampaignId, annotator: &str, index: u64) {
    let change = Change {
        annotator: annotator.parse().unwrap(),
        time_ms: 1,
        action: Action::Answer {
            index,
            answer: Answer::NotSure,
        },
    };
    let request = format!("{annotator}-{index}").parse().unwrap();
    store.add_labels(id, &request, vec![change]).unwrap();
}

#[test]
fn generations_that_are_rolled_back_are_gone_and_can_be_made_again() {
    let (_folder, store, id) = open();
    store.quarantine(&[wrong(7)]).unwrap();
    store.roll_back_generations(&id, 1, "a worker was wrong").unwrap();
    assert_eq!(store.campaign(id.as_str()).unwrap().generations_done, 1);
    assert_eq!(left(&store, &id), [0, 1]);
    assert_eq!(store.suspects(&id).unwrap().individuals, [suspect(0)]);
    assert_eq!(
        store.notices(&id).unwrap().last().unwrap().text,
        "a worker was wrong"
    );
    let again = GenerationRecord::of(1, &[0.0], 0);
    let individuals = [2, 3].map(|index| ArchivedIndividual::pictured(index, 1, vec![0; 2500]));
    store
        .commit_generation(&id, &again, &individuals, &Provenance::default())
        .unwrap();
    assert_eq!(left(&store, &id), [0, 1, 2, 3]);
}

#[test]
fn nobody_has_said_anything_about_individuals_that_are_new() {
    let (_folder, store, id) = open();
    for (annotator, index) in [("ana", 1), ("ana", 2), ("ben", 2), ("ben", 5), ("ana", 5)] {
        answer(&store, &id, annotator, index);
    }
    store.roll_back_generations(&id, 1, "a worker was wrong").unwrap();
    let labels = store.labels(&id).unwrap();
    let standing: Vec<_> = labels
        .standing()
        .map(|label| (label.annotator.to_string(), label.index))
        .collect();
    assert_eq!(standing, [("ana".to_owned(), 1)]);
    // The log keeps every entry, and can be read from its beginning.
    assert_eq!(store.label_log(&id).unwrap().len(), 9);
}

#[test]
fn what_a_deleted_class_set_aside_about_individuals_that_are_gone_stays_away() {
    let (_folder, store, id) = open();
    let say = |request: &str, actions: Vec<Action>| {
        let change = |action| Change {
            annotator: "ana".parse().unwrap(),
            time_ms: 1,
            action,
        };
        let changes = actions.into_iter().map(change).collect();
        store.add_labels(&id, &request.parse().unwrap(), changes).unwrap();
    };
    let ring = |index| Action::Answer {
        index,
        answer: "ring".parse().unwrap(),
    };
    let delete = Action::Delete {
        class: "ring".parse().unwrap(),
    };
    say("1", vec![ring(1), ring(2), ring(5), delete]);
    store.roll_back_generations(&id, 1, "a worker was wrong").unwrap();
    say("2", vec![Action::Revert { entry: 3 }]);
    let standing: Vec<u64> = store
        .labels(&id)
        .unwrap()
        .standing()
        .map(|label| label.index)
        .collect();
    assert_eq!(standing, [1]);
}

#[test]
fn who_begins_again_keeps_the_pictures_before_the_wrong_one() {
    let (_folder, store, id) = open();
    store.quarantine(&[wrong(7)]).unwrap();
    store.roll_back_dataset(&id, 1, "a worker was wrong").unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    assert_eq!((record.pictures_done, record.generations_done), (1, 0));
    let suspects = store.suspects(&id).unwrap();
    assert_eq!(
        (suspects.pictures, suspects.individuals),
        (vec![suspect(0)], vec![])
    );
}

#[test]
fn what_is_rolled_back_is_of_another_archive_version_whatever_the_clock_says() {
    let (_folder, store, _) = open();
    // The clock was a century ahead when the campaign was created, and has been set right since.
    let ahead = now_ms().unsigned_abs() + 100 * 365 * 86_400_000;
    let spec = murmuration_swarm::CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"");
    let weight = murmuration_model::Weight::default();
    let id = store.create_campaign(&spec.unwrap(), weight, ahead).unwrap();
    let archive_version = || store.campaign(id.as_str()).unwrap().archive_version();
    let mut archive_versions = vec![archive_version()];
    assert_eq!(archive_versions[0].to_string(), ahead.to_string());
    for _ in 0..2 {
        store.roll_back_generations(&id, 0, "a worker was wrong").unwrap();
        assert!(
            !archive_versions.contains(&archive_version()),
            "{}",
            archive_version()
        );
        archive_versions.push(archive_version());
    }
    assert_eq!(archive_versions[2].to_string(), format!("{ahead}.2"));
}
