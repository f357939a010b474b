use super::*;
use crate::{ArchivedIndividual, DataDirectory, GenerationRecord, Picture};
use murmuration_model::Weight;
use murmuration_swarm::{CampaignSpec, Controller, Preset};

/// Embedding kind of the machines in these tests.
const KIND: u64 = 5;

/// A campaign of four pictures and three generations of two individuals. In each pair of results, machine 7 made the first, and
/// two machines made the second.
pub(crate) fn open() -> (tempfile::TempDir, Store, CampaignId) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    let by_7 = |notices: Vec<String>| Provenance {
        makers: [Some(MachineId(7)), None]
            .map(|unaudited| Maker {
                kind: KIND.into(),
                unaudited,
            })
            .to_vec(),
        notices,
    };
    let picture = |seed| Picture {
        features: None,
        controller: Controller::new(Preset::SingleSensor, &[0.5; 4]).unwrap(),
        seed,
        image: vec![seed as u8; 2500],
    };
    for place in [0, 2] {
        let pictures = [picture(place), picture(place + 1)];
        store
            .add_pictures(&id, place, &pictures, &by_7(Vec::new()))
            .unwrap();
    }
    for generation in 0..3 {
        let first = 2 * u64::from(generation);
        let individuals = [first, first + 1]
            .map(|index| ArchivedIndividual::pictured(index, generation, vec![index as u8; 2500]));
        let record = GenerationRecord::of(generation, &[0.0], 0);
        let provenance = by_7(vec![format!("generation {generation}")]);
        store
            .commit_generation(&id, &record, &individuals, &provenance)
            .unwrap();
    }
    (folder, store, id)
}

pub(crate) fn wrong(machine: u64) -> Quarantined {
    Quarantined {
        machine: MachineId(machine),
        name: format!("worker {machine}"),
    }
}

pub(crate) fn suspect(place: u64) -> Suspect {
    Suspect {
        place,
        kind: KIND.into(),
    }
}

#[test]
fn it_is_known_what_rests_on_the_word_of_whom() {
    let (_folder, store, id) = open();
    assert!(store.suspects(&id).unwrap().is_empty());
    store.quarantine(&[wrong(8), wrong(0)]).unwrap();
    assert!(store.suspects(&id).unwrap().is_empty(), "nobody is not somebody");
    store.quarantine(&[wrong(7)]).unwrap();
    let suspects = store.suspects(&id).unwrap();
    assert_eq!(suspects.pictures, [0, 2].map(suspect));
    assert_eq!(suspects.individuals, [0, 2, 4].map(suspect));
    assert_eq!(suspects.machines, [wrong(7)]);
    assert_eq!(suspects.len(), 5);
}

#[test]
fn what_another_found_too_rests_on_nobodys_word() {
    let (_folder, store, id) = open();
    store.quarantine(&[wrong(7)]).unwrap();
    store.confirm(&id, &[wrong(7)], "all right").unwrap();
    assert!(store.suspects(&id).unwrap().is_empty());
    assert_eq!(texts(&store, &id).last().unwrap(), "all right");
}

#[test]
fn who_was_found_wrong_is_remembered_once() {
    let (folder, store, _) = open();
    store.quarantine(&[wrong(u64::MAX)]).unwrap();
    store.quarantine(&[wrong(7), wrong(u64::MAX)]).unwrap();
    drop(store);
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let mut known = store.quarantined().unwrap();
    known.sort_by_key(|wrong| wrong.machine);
    assert_eq!(known, [wrong(7), wrong(u64::MAX)]);
}

#[test]
fn the_latest_notices_are_told_oldest_first() {
    let (_folder, store, id) = open();
    for number in 0..60 {
        store.confirm(&id, &[], &number.to_string()).unwrap();
    }
    let expected: Vec<String> = (10..60).map(|number| number.to_string()).collect();
    assert_eq!(texts(&store, &id), expected);
}

fn texts(store: &Store, id: &CampaignId) -> Vec<String> {
    let notices = store.notices(id).unwrap();
    notices.into_iter().map(|notice| notice.text).collect()
}

#[test]
fn a_machine_whose_quarantine_is_lifted_is_sound_and_what_it_did_is_not() {
    let (_folder, store, id) = open();
    assert!(
        !store.lift_quarantine(MachineId(7)).unwrap(),
        "it is not quarantined"
    );
    store.quarantine(&[wrong(7)]).unwrap();
    let suspects = store.suspects(&id).unwrap();
    assert!(store.lift_quarantine(MachineId(7)).unwrap());
    assert_eq!(store.still_quarantined().unwrap(), []);
    assert!(!store.quarantined().unwrap().contains(&wrong(7)));
    let after = store.suspects(&id).unwrap();
    assert_eq!(
        (after.pictures, after.individuals),
        (suspects.pictures, suspects.individuals)
    );
    // The machine's results from now on are distinguished from its earlier results.
    store.quarantine(&[wrong(7)]).unwrap();
    assert_eq!(store.still_quarantined().unwrap(), [wrong(7)]);
    assert_eq!(store.suspects(&id).unwrap().machines.len(), 1);
}
