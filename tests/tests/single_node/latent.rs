//! Tests latent campaigns: the outcome is the same on every cluster, and an archive never has two behaviour spaces.

use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, small_latent_spec};
use tonic::Code;

/// Runs a campaign to its end; returns its id, its last status and its digest.
async fn run(cluster: &mut Cluster, spec: &CampaignSpec) -> (String, v1::Campaign, String) {
    let id = cluster.create(spec).await;
    let last = cluster.finish(&id).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    let digest = cluster.digest(&id).await;
    (id, last, digest)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_checkpoint_and_the_archive_do_not_depend_on_the_cluster() {
    let spec = small_latent_spec("filter = true");
    let mut outcomes = Vec::new();
    for workers in [1, 3] {
        let folder = tempfile::tempdir().unwrap();
        let mut cluster = Cluster::start(folder.path(), workers).await;
        let (_, last, digest) = run(&mut cluster, &spec).await;
        cluster.stop().await;
        outcomes.push((last.checkpoint, digest));
    }
    assert_eq!(outcomes[0], outcomes[1]);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_individual_is_embedded_and_novelty_is_measured_there() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let both = small_latent_spec("");
    let changed = |from: &str, to: &str| CampaignSpec::from_toml(&both.to_toml().replace(from, to)).unwrap();
    let specs = [
        untrained(&both.to_toml()),
        changed("\"both\"", "\"embedding\""),
        changed("\"latent\"", "\"random\""),
        both.clone(),
    ];
    for spec in specs {
        let (id, last, _) = run(&mut cluster, &spec).await;
        assert_eq!(last.checkpoint.len(), 64);
        let individuals = cluster.archive(&id).await;
        assert_eq!(individuals.len(), 100);
        assert!(
            individuals
                .iter()
                .all(|individual| individual.embedding.len() == 5)
        );
        // The test can compute the novelty of the last generation from the archive.
        let parts = |individual: &v1::Individual| {
            let features = individual.features.as_slice().try_into().unwrap();
            (features, individual.embedding.clone())
        };
        let scale = spec.scale(individuals.iter().map(parts));
        let behaviour = |individual: &v1::Individual| {
            let (features, embedding) = parts(individual);
            scale.behaviour(&features, &embedding)
        };
        let behaviours: Vec<Vec<f64>> = individuals.iter().map(behaviour).collect();
        for individual in &individuals[80..] {
            let own = behaviour(individual);
            let distance = |other: &Vec<f64>| -> f64 {
                own.iter()
                    .zip(other)
                    .map(|(a, b)| (a - b) * (a - b))
                    .sum::<f64>()
                    .sqrt()
            };
            let mut distances: Vec<f64> = behaviours.iter().map(distance).collect();
            distances.sort_by(f64::total_cmp);
            let novelty = distances[1..16].iter().sum::<f64>() / 15.0;
            assert!((novelty - individual.novelty).abs() < 1e-9, "{}", spec.to_toml());
        }
    }
    cluster.stop().await;
}

/// The campaign `spec` with the method `untrained`.
fn untrained(spec: &str) -> CampaignSpec {
    let mut table: toml::Table = spec.parse().unwrap();
    table.insert("method".into(), "untrained".into());
    table.remove("training");
    CampaignSpec::from_toml(&toml::to_string(&table).unwrap()).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn there_and_back_to_a_checkpoint_is_where_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let (_, other, _) = run(&mut cluster, &untrained(&small_latent_spec("").to_toml())).await;
    let (id, first, digest) = run(&mut cluster, &small_latent_spec("")).await;
    let (individuals, clusters) = (cluster.archive(&id).await, cluster.taxonomy(&id).await);

    cluster.adopt(&id, &other.checkpoint).await.unwrap();
    let moved = cluster.finish(&id).await;
    assert_eq!(moved.state(), v1::CampaignState::Completed, "{}", moved.error);
    assert_eq!(
        (moved.checkpoint, moved.next_checkpoint.as_str()),
        (other.checkpoint, "")
    );
    let there = cluster.archive(&id).await;
    for (before, after) in individuals.iter().zip(&there) {
        assert_eq!(
            (&before.controller, &before.image),
            (&after.controller, &after.image)
        );
        assert!(before.embedding != after.embedding && before.novelty != after.novelty);
    }
    assert_ne!(cluster.taxonomy(&id).await, clusters);

    cluster.adopt(&id, &first.checkpoint).await.unwrap();
    cluster.finish(&id).await;
    assert_eq!(cluster.archive(&id).await, individuals);
    assert_eq!(cluster.taxonomy(&id).await, clusters);
    assert_eq!(cluster.digest(&id).await, digest);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_campaign_can_start_from_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let (_, trained, digest) = run(&mut cluster, &small_latent_spec("")).await;
    let mut table: toml::Table = small_latent_spec("").to_toml().parse().unwrap();
    table.remove("training");
    table.remove("dataset");
    table.insert("checkpoint".into(), trained.checkpoint.clone().into());
    let spec = CampaignSpec::from_toml(&toml::to_string(&table).unwrap()).unwrap();
    let (_, last, again) = run(&mut cluster, &spec).await;
    assert_eq!((last.dataset_done, again), (0, digest));
    assert_eq!(last.checkpoint, trained.checkpoint);

    table.insert("checkpoint".into(), "0".repeat(64).into());
    let absent = CampaignSpec::from_toml(&toml::to_string(&table).unwrap()).unwrap();
    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec((&absent).into())),
        ..v1::CreateCampaignRequest::default()
    };
    let refused = cluster.client.create_campaign(request).await.unwrap_err();
    assert_eq!(refused.code(), Code::NotFound, "{refused}");
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_checkpoint_that_does_not_suit_is_refused_and_nothing_changes() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let (id, first, digest) = run(&mut cluster, &small_latent_spec("")).await;
    let smaller = small_latent_spec("[image]\nresolution = 40");
    let (other, small, _) = run(&mut cluster, &smaller).await;
    let refused = cluster.adopt(&id, &small.checkpoint).await.unwrap_err();
    assert!(
        refused.message().contains("embeds pictures of 40 x 40"),
        "{refused}"
    );
    let refused = cluster.adopt(&other, &"0".repeat(64)).await.unwrap_err();
    assert_eq!(refused.code(), Code::NotFound, "{refused}");
    let (features, _, _) = run(&mut cluster, &murmuration_tests::small_spec("")).await;
    let refused = cluster.adopt(&features, &first.checkpoint).await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused}");
    assert!(
        refused.message().contains("behaviour space is \"features\""),
        "{refused}"
    );
    assert_eq!(cluster.digest(&id).await, digest);
    assert_eq!(cluster.status(&id).await.state(), v1::CampaignState::Completed);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_that_is_cancelled_leaves_its_trainer_to_others() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let endless = small_latent_spec("")
        .to_toml()
        .replace("epochs = 3", "epochs = 100000");
    let endless = endless.replace("patience = 8", "patience = 100000");
    let endless = cluster.create(&CampaignSpec::from_toml(&endless).unwrap()).await;
    while cluster.status(&endless).await.training.is_none() {
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    let request = v1::CancelCampaignRequest {
        campaign: endless.clone(),
    };
    cluster.client.cancel_campaign(request).await.unwrap();
    assert_eq!(
        cluster.status(&endless).await.state(),
        v1::CampaignState::Cancelled
    );
    run(&mut cluster, &small_latent_spec("")).await;
    cluster.stop().await;
}
