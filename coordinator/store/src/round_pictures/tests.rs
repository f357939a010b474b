//! A round learns from labelled individuals, and from further starts of their controllers.

use super::*;
use crate::{DataDirectory, GenerationRecord, Picture, Provenance};
use murmuration_model::{
    CampaignId, Weight,
    labels::{Action, Change},
};
use murmuration_swarm::CampaignSpec;

/// A campaign of 5 individuals, with a dataset of 4 pictures. Two individuals are labelled, and the campaign learns from 3 starts
/// of each labelled individual.
fn labelled() -> (tempfile::TempDir, Store, CampaignId) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let text = "model = \"single-sensor\"\nmethod = \"latent\"\n[dataset]\ncontrollers = 4\nstarts = 1\n\
                [search]\npopulation = 5\n[feedback]\nstarts = 3";
    let spec = CampaignSpec::from_toml(text).unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    let individual = |index: u64| ArchivedIndividual::pictured(index, 0, vec![index as u8; 2500]);
    add(&store, &id, 0, &[start(1), start(2), start(3), start(4)]);
    let record = GenerationRecord::of(0, &[0.0], 0);
    let individuals: Vec<_> = (0..5).map(individual).collect();
    store
        .commit_generation(&id, &record, &individuals, &Provenance::default())
        .unwrap();
    let message = [(1, "ring"), (3, "clump")].map(|(index, class)| Change {
        annotator: "ana".parse().unwrap(),
        time_ms: 1,
        action: Action::Answer {
            index,
            answer: class.parse().unwrap(),
        },
    });
    store
        .add_labels(&id, &"1".parse().unwrap(), message.into())
        .unwrap();
    (folder, store, id)
}

fn start(seed: u64) -> FurtherStart {
    FurtherStart {
        controller: ArchivedIndividual::still(0, 0).controller,
        seed,
        labelled: 0,
    }
}

/// Adds a picture for each start, with 100 plus the picture's place as the grey value.
fn add(store: &Store, id: &CampaignId, first: u64, starts: &[FurtherStart]) {
    let pictures: Vec<_> = starts
        .iter()
        .zip(first..)
        .map(|(start, place)| Picture {
            features: None,
            controller: start.controller.clone(),
            seed: start.seed,
            image: vec![100 + place as u8; 2500],
        })
        .collect();
    store
        .add_pictures(id, first, &pictures, &Provenance::default())
        .unwrap();
}

#[test]
fn what_a_labelled_controller_does_from_further_starts_has_its_class() {
    let (_folder, store, id) = labelled();
    let round = || {
        let record = store.campaign("latest").unwrap();
        store.round_pictures(&record, 2).unwrap()
    };
    let (clump, ring) = (1, 2);
    let before = round();
    let individuals = [
        (RoundPicture::Individual(1), ring),
        (RoundPicture::Individual(3), clump),
    ];
    assert_eq!((before.labels, before.pictures), (2, individuals.to_vec()));
    assert_eq!(before.missing.len(), 4);

    // Each labelled individual has one further picture now; its second further picture is still missing.
    let [missing, second, third, _] = <[_; 4]>::try_from(before.missing).unwrap();
    let there = [second, third];
    add(&store, &id, 4, &there);
    let between = round();
    let learned = [
        individuals[0],
        (RoundPicture::Further(4), ring),
        individuals[1],
        (RoundPicture::Further(5), clump),
    ];
    assert_eq!((between.labels, between.pictures), (2, learned.to_vec()));
    assert_eq!((between.missing.len(), between.missing[0].clone()), (2, missing));

    let record = store.campaign("latest").unwrap();
    let greys = learned.map(|(picture, _)| store.round_image(&record, picture).unwrap()[7]);
    assert_eq!(greys, [1, 104, 3, 105]);
    assert_eq!((record.pictures_done, record.dataset_done()), (6, 4));
    let dataset = store.training_images(&record, 0..100).unwrap();
    assert_eq!(dataset.len(), 4 * 2500);
}

#[test]
fn a_round_learns_from_no_more_than_was_said_when_it_began() {
    let (_folder, store, _) = labelled();
    let record = store.campaign("latest").unwrap();
    let round = store.round_pictures(&record, 1).unwrap();
    assert_eq!((round.labels, round.missing.len()), (1, 2));
}
