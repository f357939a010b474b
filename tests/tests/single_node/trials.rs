//! Tests individuals with several trials: their measurements are means over the trials, and robustness counts how alike the
//! trials are.

use murmuration_proto::v1;
use murmuration_sim::{evaluate::evaluate, simulate::Start};
use murmuration_swarm::{CampaignSpec, Controller, mean_embedding};
use murmuration_tests::{Cluster, small_latent_spec, small_spec};

/// The campaign `spec` with three starts and some noise.
fn three_starts(spec: &CampaignSpec) -> CampaignSpec {
    let mut table: toml::Table = spec.to_toml().parse().unwrap();
    let evaluation: toml::Table = "starts = 3".parse().unwrap();
    table.insert("evaluation".into(), evaluation.into());
    let noise: toml::Table = "slip = 0.1".parse().unwrap();
    table["world"]
        .as_table_mut()
        .unwrap()
        .insert("noise".into(), noise.into());
    CampaignSpec::from_toml(&toml::to_string(&table).unwrap()).unwrap()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// The places of the medoids nearest to a behaviour: several places if several medoids are equally near.
fn nearest(behaviour: &[f64], medoids: &[Vec<f64>]) -> Vec<u32> {
    let distance = |medoid: &Vec<f64>| -> f64 {
        let squares = behaviour.iter().zip(medoid).map(|(a, b)| (a - b) * (a - b));
        squares.sum()
    };
    let least = medoids.iter().map(distance).fold(f64::INFINITY, f64::min);
    let places = (0..).zip(medoids).filter(|(_, medoid)| distance(medoid) == least);
    places.map(|(place, _)| place).collect()
}

/// Checks the coordinator's counts of robust trials by counting again from the archive.
fn check_robustness(spec: &CampaignSpec, archive: &[v1::Individual], taxonomy: &v1::Taxonomy) {
    let parts = |individual: &v1::Individual| {
        let features = individual.features.as_slice().try_into().unwrap();
        (features, individual.embedding.clone())
    };
    let scale = spec.scale(archive.iter().map(parts));
    let behaviour =
        |features: &[f64], embedding: &[f32]| scale.behaviour(&features.try_into().unwrap(), embedding);
    let medoids: Vec<Vec<f64>> = taxonomy
        .medoids
        .iter()
        .filter_map(|medoid| medoid.individual.as_ref())
        .map(|medoid| behaviour(&medoid.features, &medoid.embedding))
        .collect();
    assert_eq!(taxonomy.robust_trials.len(), archive.len());
    for (individual, (&own, &robust)) in archive
        .iter()
        .zip(taxonomy.clusters.iter().zip(&taxonomy.robust_trials))
    {
        let is_own = |trial: &&v1::Trial| {
            let nearest = nearest(&behaviour(&trial.features, &trial.embedding), &medoids);
            nearest.contains(&own)
        };
        let counted = individual.trials.iter().filter(is_own).count();
        assert_eq!(counted, robust as usize, "individual {}", individual.index);
    }
    let robust = &taxonomy.robust_trials;
    assert!(
        robust.contains(&3) && robust.iter().any(|&trials| trials < 3),
        "{robust:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn an_individual_is_the_mean_of_its_trials_on_any_cluster() {
    let spec = three_starts(&small_spec(""));
    let mut digests = Vec::new();
    for workers in [1, 3] {
        let folder = tempfile::tempdir().unwrap();
        let mut cluster = Cluster::start(folder.path(), workers).await;
        let id = cluster.create(&spec).await;
        let last = cluster.finish(&id).await;
        assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
        digests.push(cluster.digest(&id).await);
        let archive = cluster.archive(&id).await;
        check_robustness(&spec, &archive, &cluster.taxonomy(&id).await);
        for individual in &archive {
            assert_eq!(
                (individual.trials.len(), individual.trials[0].seed),
                (3, individual.seed)
            );
            for feature in 0..5 {
                let over_trials = mean(individual.trials.iter().map(|trial| trial.features[feature]));
                assert_eq!(individual.features[feature], over_trials);
            }
        }
        let individual = &archive[7];
        let controller = Controller::new(spec.model(), &individual.controller).unwrap();
        for (place, trial) in individual.trials.iter().enumerate() {
            let start = Start::seeded(trial.seed);
            let alone = evaluate(&controller, spec.world(), spec.image(), &start).unwrap();
            assert_eq!(alone.features().as_slice(), trial.features);
            let is_shown = individual.image.as_deref() == Some(alone.image());
            assert_eq!(is_shown, place == 0, "the picture is that of the first trial");
        }
        cluster.stop().await;
    }
    assert_eq!(digests[0], digests[1]);
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    assert_ne!(cluster.run(&small_spec("")).await, digests[0]);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_trial_is_embedded_again_when_the_archive_moves() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let mut other: toml::Table = small_latent_spec("").to_toml().parse().unwrap();
    other.insert("method".into(), "untrained".into());
    other.remove("training");
    let other = CampaignSpec::from_toml(&toml::to_string(&other).unwrap()).unwrap();
    let other_id = cluster.create(&other).await;
    let other = cluster.finish(&other_id).await.checkpoint;

    let spec = three_starts(&small_latent_spec(""));
    let id = cluster.create(&spec).await;
    let first = cluster.finish(&id).await;
    assert_eq!(first.state(), v1::CampaignState::Completed, "{}", first.error);
    let digest = cluster.digest(&id).await;
    let before = cluster.archive(&id).await;
    check_robustness(&spec, &before, &cluster.taxonomy(&id).await);

    for (checkpoint, is_back) in [(other, false), (first.checkpoint, true)] {
        cluster.adopt(&id, &checkpoint).await.unwrap();
        let moved = cluster.finish(&id).await;
        assert_eq!(moved.state(), v1::CampaignState::Completed, "{}", moved.error);
        assert_eq!(cluster.digest(&id).await == digest, is_back);
        let archive = cluster.archive(&id).await;
        check_robustness(&spec, &archive, &cluster.taxonomy(&id).await);
        for (one, other) in before.iter().zip(&archive) {
            let embeddings = other.trials.iter().map(|trial| trial.embedding.as_slice());
            assert_eq!(mean_embedding(embeddings), other.embedding);
            let again = one.trials.iter().zip(&other.trials);
            assert!(again.clone().all(|(one, other)| one.features == other.features));
            assert!(
                again
                    .clone()
                    .all(|(one, other)| (one.embedding == other.embedding) == is_back)
            );
        }
    }
    cluster.stop().await;
}
