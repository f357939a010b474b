//! Archives that move to another checkpoint.

use super::*;
use murmuration_model::ArchiveEmbedder;

fn embeddings(store: &Store, id: &CampaignId) -> Vec<Vec<f32>> {
    let individuals = store.individuals(id, &MODEL.into(), 0..10, false).unwrap();
    individuals
        .into_iter()
        .map(|individual| individual.embedding())
        .collect()
}

#[test]
fn an_archive_switches_to_another_checkpoint_at_once() {
    let (_folder, store, id, [first, second]) = embedded();
    assert_eq!(embeddings(&store, &id), [[0.0, -0.5], [1.0, -0.5]]);
    let clustering = Clustering {
        medoids: vec![0],
        clusters: vec![0, 0],
        loss: 1.0,
    };
    store
        .complete(&id, &clustering, &[ClusterMeasures::default()], &[], &[])
        .unwrap();

    store.move_to(&id, second).unwrap();
    store
        .add_embeddings(&id, 0, &[vec![vec![7.0]]], &Provenance::default())
        .unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    let switching = |from, to, embedded| ArchiveEmbedder::Switching { from, to, embedded };
    assert_eq!(record.embedder, switching(Some(first), second, 1));
    assert_eq!(record.state, CampaignState::Running);
    // Until the switch, embeddings and taxonomy stay as they were.
    assert_eq!(embeddings(&store, &id), [[0.0, -0.5], [1.0, -0.5]]);
    assert!(store.taxonomy(&id).unwrap().is_some());

    store
        .add_embeddings(&id, 1, &[vec![vec![8.0]]], &Provenance::default())
        .unwrap();
    assert_eq!(store.next_embeddings(&id, 1).unwrap(), [[7.0], [8.0]]);
    let switch = Switch {
        novelty: vec![3.0, 5.0],
        generations: vec![GenerationRecord::of(0, &[3.0, 5.0], 0)],
    };
    store.switch(&id, &switch).unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    assert_eq!(record.embedder, ArchiveEmbedder::Checkpoint(second));
    assert_eq!(record.last_novelty, Some((5.0, 4.0)));
    assert_eq!(embeddings(&store, &id), [[7.0], [8.0]]);
    assert_eq!(store.individual(&id, &MODEL.into(), 1).unwrap().novelty, 5.0);
    assert_eq!(store.taxonomy(&id).unwrap(), None);
}

#[test]
fn an_archive_that_was_embedded_wrongly_is_embedded_again_without_what_came_after() {
    let (_folder, store, id, [_, second]) = embedded();
    store.move_to(&id, second).unwrap();
    let by_7 = Provenance {
        makers: vec![
            Maker {
                kind: EmbeddingKind::UNKNOWN,
                unaudited: Some(MachineId(7)),
            };
            2
        ],
        notices: Vec::new(),
    };
    let wrong = [vec![vec![7.0]], vec![vec![8.0]]];
    store.add_embeddings(&id, 0, &wrong, &by_7).unwrap();
    let switch = Switch {
        novelty: vec![3.0, 5.0],
        generations: Vec::new(),
    };
    store.switch(&id, &switch).unwrap();
    let later = ArchivedIndividual::pictured(2, 1, vec![0; 2500]);
    let generation = GenerationRecord::of(1, &[0.0], 0);
    store
        .commit_generation(&id, &generation, &[later], &Provenance::default())
        .unwrap();
    let worker = Quarantined {
        machine: MachineId(7),
        name: "wrong".to_owned(),
    };
    store.quarantine(&[worker]).unwrap();
    let suspect = store.suspects(&id).unwrap().embeddings;
    assert_eq!(
        suspect.iter().map(|suspect| suspect.place).collect::<Vec<_>>(),
        [0, 1]
    );
    assert_eq!(store.embedded_when_moved(&id).unwrap(), 2);

    store.roll_back_embeddings(&id, 2, "a worker was wrong").unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    let switching = ArchiveEmbedder::Switching {
        from: None,
        to: second,
        embedded: 0,
    };
    assert_eq!((record.embedder, record.generations_done), (switching, 1));
    assert!(store.suspects(&id).unwrap().is_empty());
    let right = [vec![vec![1.0]], vec![vec![2.0]]];
    store
        .add_embeddings(&id, 0, &right, &Provenance::default())
        .unwrap();
    store.switch(&id, &switch).unwrap();
    assert_eq!(embeddings(&store, &id), right.concat());
}

#[test]
fn a_move_that_is_given_up_leaves_nothing_behind() {
    let (_folder, store, id, [first, second]) = embedded();
    store.move_to(&id, second).unwrap();
    store
        .add_embeddings(&id, 0, &[vec![vec![7.0]]], &Provenance::default())
        .unwrap();
    store.move_to(&id, first).unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    assert_eq!(
        (record.embedder.next(), record.embedder.embedded()),
        (Some(first), 2)
    );
    store.move_to(&id, second).unwrap();
    assert_eq!(store.campaign(id.as_str()).unwrap().embedder.embedded(), 0);
    assert_eq!(embeddings(&store, &id), [[0.0, -0.5], [1.0, -0.5]]);
}

#[test]
fn a_rollback_cuts_off_the_embeddings_that_a_move_has_added_past_it() {
    let (_folder, store, id, [first, second]) = embedded();
    for generation in [1, 2] {
        let record = GenerationRecord::of(generation, &[0.1, 0.2], 0);
        let individuals = [0, 1].map(|place| {
            let index = u64::from(generation) * 2 + place;
            individual(index).with_trial(trial(index, vec![index as f32, -0.5]))
        });
        store
            .commit_generation(&id, &record, &individuals, &Provenance::default())
            .unwrap();
    }
    store.move_to(&id, second).unwrap();
    let new = [7.0, 8.0, 9.0, 10.0, 11.0].map(|value| vec![vec![value]]);
    store
        .add_embeddings(&id, 0, &new, &Provenance::default())
        .unwrap();
    assert_eq!(store.campaign(id.as_str()).unwrap().embedder.embedded(), 5);
    let again = store.add_embeddings(&id, 4, &new[..1], &Provenance::default());
    assert!(again.is_err(), "it is there already");

    store.roll_back_generations(&id, 1, "a worker was wrong").unwrap();
    assert_eq!(store.next_embeddings(&id, 1).unwrap(), [[7.0], [8.0]]);
    assert_eq!(store.campaign(id.as_str()).unwrap().embedder.embedded(), 2);
    assert_eq!(embeddings(&store, &id), [[0.0, -0.5], [1.0, -0.5]]);
    store.move_to(&id, first).unwrap();
    assert_eq!(store.campaign(id.as_str()).unwrap().embedder.embedded(), 2);
}

#[test]
fn a_switch_of_a_part_of_an_archive_leaves_the_other_novelty() {
    let (_folder, store, id, [_, second]) = embedded();
    store.move_to(&id, second).unwrap();
    store.switch(&id, &unchanged(&[3.0])).unwrap();
    let novelty = |index| store.individual(&id, &MODEL.into(), index).unwrap().novelty;
    assert_eq!([novelty(0), novelty(1)], [3.0, 0.1]);
}
