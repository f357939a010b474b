//! Tests of versions of taxonomies: which versions stay after a switch or a rollback.

use super::*;

fn clustering(medoids: &[usize], clusters: &[u32]) -> Clustering {
    Clustering {
        medoids: medoids.to_vec(),
        clusters: clusters.to_vec(),
        loss: 1.0,
    }
}

/// Completes a campaign of two individuals with a taxonomy of one cluster around `medoid`.
fn complete(store: &Store, id: &CampaignId, medoid: usize, points: &[[f32; 2]]) {
    let measures = [ClusterMeasures::default()];
    let done = store.complete(id, &clustering(&[medoid], &[0, 0]), &measures, &[], points);
    assert!(done.unwrap());
}

fn switch(store: &Store, id: &CampaignId, to: CheckpointDigest) {
    store.move_to(id, to).unwrap();
    let embeddings = [vec![vec![7.0]], vec![vec![8.0]]];
    store
        .add_embeddings(id, 0, &embeddings, &Provenance::default())
        .unwrap();
    let switch = Switch {
        novelty: vec![3.0, 5.0],
        generations: vec![GenerationRecord::of(0, &[3.0, 5.0], 0)],
    };
    store.switch(id, &switch).unwrap();
}

#[test]
fn a_taxonomy_outlives_the_switch_and_the_next_one_stands_beside_it() {
    let (_folder, store, id, [first, second]) = embedded();
    let points = [[0.5, -1.0], [2.0, 0.25]];
    complete(&store, &id, 1, &points);
    switch(&store, &id, second);
    assert_eq!(store.taxonomy(&id).unwrap(), None);
    assert_eq!(store.first_medoid(&id).unwrap(), None);
    complete(&store, &id, 0, &[]);

    let versions = store.taxonomy_versions(&id).unwrap();
    let told: Vec<_> = versions
        .iter()
        .map(|version| {
            (
                version.version,
                version.stands,
                version.checkpoint,
                version.individuals,
            )
        })
        .collect();
    assert_eq!(told, [(1, false, Some(first), 2), (2, true, Some(second), 2)]);
    assert!(
        versions
            .iter()
            .all(|version| version.made_ms.is_some() && version.generations == 1)
    );
    let of = |version| store.taxonomy_of_version(&id, version).unwrap();
    assert_eq!(of(1).unwrap().medoids, [1]);
    assert_eq!(of(2), store.taxonomy(&id).unwrap());
    assert_eq!(of(3), None);
    assert_eq!(store.taxonomy_points(&id, 1).unwrap(), points);
    assert!(store.taxonomy_points(&id, 2).unwrap().is_empty());
    assert_eq!(store.first_medoid(&id).unwrap(), Some(0));

    // A taxonomy made again from the same archive keeps the version's number.
    complete(&store, &id, 1, &[]);
    let numbers: Vec<u32> = store
        .taxonomy_versions(&id)
        .unwrap()
        .iter()
        .map(|version| version.version)
        .collect();
    assert_eq!(numbers, [1, 2]);
    store.delete_campaign(&id, None, false).unwrap();
    let left = store.read(|connection| {
        Ok(connection.query_row("SELECT count(*) FROM taxonomies", [], |row| row.get::<_, u32>(0))?)
    });
    assert_eq!(left.unwrap(), 0);
}

#[test]
fn versions_about_discarded_individuals_go_with_them_and_others_stay() {
    let (_folder, store, id, [_, second]) = embedded();
    complete(&store, &id, 1, &[]);
    switch(&store, &id, second);
    store.roll_back_embeddings(&id, 2, "a worker was wrong").unwrap();
    assert_eq!(store.taxonomy_versions(&id).unwrap().len(), 1);
    store.roll_back_generations(&id, 0, "a worker was wrong").unwrap();
    assert_eq!(store.taxonomy_versions(&id).unwrap(), []);
}

#[test]
fn a_wrong_embedding_takes_the_taxonomy_that_stands_on_it() {
    let (_folder, store, id, _) = embedded();
    complete(&store, &id, 1, &[]);
    store.roll_back_embeddings(&id, 2, "a worker was wrong").unwrap();
    assert_eq!(store.taxonomy_versions(&id).unwrap(), []);
}
