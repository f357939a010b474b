//! Tests campaigns over gRPC: the same specification gives the same digest on every cluster.

use murmuration_proto::{parts::whole, v1};
use murmuration_store::{DataDirectory, Store};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, http, small_spec};
use tonic::{Code, Status};

async fn digest_with(spec: &CampaignSpec, workers: usize) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), workers).await;
    let digest = cluster.run(spec).await;
    cluster.stop().await;
    digest
}

#[tokio::test(flavor = "multi_thread")]
async fn one_two_and_four_workers_give_one_digest() {
    let spec = small_spec("filter = true");
    let one = digest_with(&spec, 1).await;
    assert_eq!(one, digest_with(&spec, 2).await);
    assert_eq!(one, digest_with(&spec, 4).await);
}

#[tokio::test(flavor = "multi_thread")]
async fn every_part_of_a_specification_matters() {
    let mut digests = Vec::new();
    for more in ["", "seed = 2", "filter = true"] {
        digests.push(digest_with(&small_spec(more), 2).await);
    }
    let random = small_spec("").to_toml().replace("hand-crafted", "random");
    digests.push(digest_with(&CampaignSpec::from_toml(&random).unwrap(), 2).await);
    let two = small_spec("")
        .to_toml()
        .replace("\"single-sensor\"", "\"two-sensor\"");
    digests.push(digest_with(&CampaignSpec::from_toml(&two).unwrap(), 2).await);
    for (i, digest) in digests.iter().enumerate() {
        assert!(
            !digests[..i].contains(digest),
            "two different specifications share a digest"
        );
    }
}

/// A campaign of 400 generations, long enough to be interrupted.
fn longer() -> CampaignSpec {
    let text = small_spec("seed = 3").to_toml();
    CampaignSpec::from_toml(&text.replace("generations = 5", "generations = 400")).unwrap()
}

/// Watches a campaign until more than `after` generations, but not all generations, are done.
async fn in_the_middle(cluster: &mut Cluster, campaign: &str, after: u32) -> u32 {
    let begun = |status: &v1::Campaign| status.generations_done > after;
    let status = cluster.watch_until(campaign, begun).await;
    assert_eq!(
        status.state(),
        v1::CampaignState::Running,
        "it was over too early"
    );
    assert!((after + 1..400).contains(&status.generations_done));
    status.generations_done
}

#[tokio::test(flavor = "multi_thread")]
async fn a_coordinator_stopped_in_the_middle_goes_on_by_itself() {
    check_restart(longer(), 2).await;
}

/// Two generations are evaluated at the same time.
#[tokio::test(flavor = "multi_thread")]
async fn a_search_with_a_lag_is_reproducible_and_goes_on_after_a_restart() {
    let lagging = longer().to_toml().replace("[search]\n", "[search]\nlag = 1\n");
    let lagging = CampaignSpec::from_toml(&lagging).unwrap();
    let digest = digest_with(&lagging, 1).await;
    assert_eq!(digest, digest_with(&lagging, 4).await);
    assert_ne!(digest, digest_with(&longer(), 4).await);
    check_restart(lagging, 2).await;
}

/// A random campaign whose taxonomy covers a sample.
fn sampled() -> CampaignSpec {
    let text = longer()
        .to_toml()
        .replace("\"hand-crafted\"", "\"random\"")
        .replace("[taxonomy]\n", "[taxonomy]\nsample = 1010\n");
    CampaignSpec::from_toml(&text).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_search_with_a_sample_goes_on_after_a_restart() {
    // 60 generations of 20 are more than the sample.
    check_restart(sampled(), 60).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_taxonomy_covers_the_sample_and_the_archive_has_everything() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let campaign = cluster.create(&sampled()).await;
    assert_eq!(
        cluster.finish(&campaign).await.state(),
        v1::CampaignState::Completed
    );
    let archive = cluster.archive(&campaign).await;
    assert_eq!(archive.len(), 8000);
    assert!(archive.iter().all(|individual| individual.novelty == 0.0));
    let taxonomy = cluster.taxonomy(&campaign).await;
    assert_eq!(taxonomy.clusters.len(), 1010);
    let sizes = taxonomy.medoids.iter().map(|medoid| medoid.cluster_size);
    assert_eq!(sizes.sum::<u64>(), 1010);
    assert!(taxonomy.medoids.iter().all(|medoid| medoid.novelty > 0.0));
    for path in ["taxonomy", "map", "report"] {
        let url = format!("{}/campaigns/{campaign}/{path}", cluster.url());
        let text = http::get(url).await.unwrap().text().await.unwrap();
        assert!(
            text.contains("covers the first 1,010 individuals"),
            "{path}: {text}"
        );
        assert!(text.contains("at most 3.2 percentage points"), "{path}");
    }
    cluster.stop().await;
}

/// Checks that a campaign whose coordinator is stopped once more than `after` generations are done has the same digest as an
/// undisturbed one.
async fn check_restart(spec: CampaignSpec, after: u32) {
    let undisturbed = digest_with(&spec, 2).await;
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let campaign = cluster.create(&spec).await;
    let seen = in_the_middle(&mut cluster, &campaign, after).await;
    cluster.stop().await;

    // Without workers, the campaign has made no progress.
    let mut cluster = Cluster::start(folder.path(), 0).await;
    let stopped = cluster.status(&campaign).await;
    assert_eq!(
        (stopped.state(), stopped.active),
        (v1::CampaignState::Running, true)
    );
    assert!((seen..400).contains(&stopped.generations_done), "{stopped:?}");
    cluster.stop().await;

    let mut cluster = Cluster::start(folder.path(), 2).await;
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed);
    assert_eq!(cluster.digest(&campaign).await, undisturbed);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pause_resume_and_cancel_keep_the_archive() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let campaign = cluster.create(&longer()).await;
    let pause = || v1::PauseCampaignRequest {
        campaign: campaign.clone(),
    };
    let resume = || v1::ResumeCampaignRequest {
        campaign: campaign.clone(),
    };
    let cancel = || v1::CancelCampaignRequest {
        campaign: campaign.clone(),
    };

    in_the_middle(&mut cluster, &campaign, 2).await;
    let paused = cluster.client.pause_campaign(pause()).await.unwrap().into_inner();
    assert_eq!(
        (paused.state(), paused.active),
        (v1::CampaignState::Paused, false)
    );
    let at_pause = cluster.archive(&campaign).await;
    assert_eq!(at_pause.len(), 20 * paused.generations_done as usize);
    assert!(paused.generations_done > 2);
    let error = cluster.client.pause_campaign(pause()).await.unwrap_err();
    assert_eq!(
        (error.code(), error.message()),
        (
            Code::FailedPrecondition,
            "cannot pause campaign small-1: it is paused"
        )
    );
    let resumed = cluster
        .client
        .resume_campaign(resume())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(
        (resumed.state(), resumed.active),
        (v1::CampaignState::Running, true)
    );
    in_the_middle(&mut cluster, &campaign, paused.generations_done).await;
    cluster.client.cancel_campaign(cancel()).await.unwrap();
    let at_cancel = cluster.archive(&campaign).await;
    assert!(at_cancel.len() > at_pause.len() && at_cancel.starts_with(&at_pause));
    let error = cluster.client.resume_campaign(resume()).await.unwrap_err();
    assert_eq!(
        error.message(),
        "cannot resume campaign small-1: it was already cancelled"
    );
    cluster.stop().await;

    let mut cluster = Cluster::start(folder.path(), 1).await;
    assert!(cluster.archive(&campaign).await == at_cancel);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_archive_the_taxonomy_and_the_replays_fit_together() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let campaign = cluster.create(&small_spec("")).await;
    cluster.finish(&campaign).await;

    let archive = cluster.archive(&campaign).await;
    assert_eq!(archive.len(), 100);
    assert!(
        archive
            .iter()
            .enumerate()
            .all(|(i, individual)| individual.index == i as u64)
    );

    let taxonomy = cluster.taxonomy(&campaign).await;
    assert_eq!((taxonomy.medoids.len(), taxonomy.clusters.len()), (4, 100));
    assert_eq!(
        taxonomy
            .medoids
            .iter()
            .map(|medoid| medoid.cluster_size)
            .sum::<u64>(),
        100
    );
    let total: f64 = taxonomy
        .medoids
        .iter()
        .map(|medoid| medoid.mean_distance * medoid.cluster_size as f64)
        .sum();
    assert!((total - taxonomy.loss).abs() < 1e-9);
    for medoid in taxonomy.medoids {
        let medoid = medoid.individual.unwrap();
        assert_eq!(medoid, archive[medoid.index as usize]);
    }

    let request = v1::GetReplayRequest {
        campaign,
        index: 7,
        stride: 50,
    };
    let replay = cluster.client.get_replay(request).await.unwrap();
    let replay = whole(replay.into_inner()).await.unwrap();
    assert_eq!((replay.steps, replay.agents), (vec![0, 50, 100, 150, 200], 24));
    cluster.stop().await;
}

async fn extend(cluster: &mut Cluster, campaign: &str, generations: u32) -> Result<v1::Campaign, Status> {
    let request = v1::ExtendCampaignRequest {
        campaign: campaign.to_owned(),
        generations,
    };
    Ok(cluster.client.extend_campaign(request).await?.into_inner())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_extended_campaign_is_one_that_asked_for_more_from_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 2).await;
    let plain = small_spec("filter = true").to_toml();
    let methods = [
        ("novelty", plain.clone()),
        ("lag", plain.replace("[search]", "[search]\nlag = 1")),
        ("random", plain.replace("\"hand-crafted\"", "\"random\"")),
        ("exhaustive", "model = \"single-sensor\"\nmethod = \"exhaustive\"\n[world]\nhorizon = 30\n[controllers]\nstep = 0.5\n\
            [search]\npopulation = 13\ngenerations = 5\n[taxonomy]\nmedoids = 3".to_owned()),
    ];
    let mut extended = Vec::new();
    for (method, text) in methods {
        let short = CampaignSpec::from_toml(&text).unwrap();
        let long = short.with_generations(9).unwrap();
        let id = cluster.create(&short).await;
        cluster.finish(&id).await;
        let former = cluster.digest(&id).await;
        let refused = extend(&mut cluster, &id, 5).await.unwrap_err();
        assert!(
            refused.message().contains("more than the 5"),
            "{}",
            refused.message()
        );
        extend(&mut cluster, &id, 9).await.unwrap();
        let last = cluster.finish(&id).await;
        assert_eq!(
            (last.state(), last.generations_done),
            (v1::CampaignState::Completed, 9),
            "{method}"
        );
        let from_the_start = cluster.run(&long).await;
        assert_eq!(cluster.digest(&id).await, from_the_start, "{method}");
        assert_ne!(former, from_the_start, "{method}");
        extended.push(id);
    }
    cluster.stop().await;
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    for id in extended {
        let versions = store.taxonomy_versions(&id.parse().unwrap()).unwrap();
        let generations: Vec<_> = versions
            .iter()
            .map(|version| (version.generations, version.stands))
            .collect();
        assert_eq!(generations, [(5, false), (9, true)], "{id}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn only_a_completed_campaign_is_extended_and_only_within_its_limits() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let id = cluster.create(&longer()).await;
    let refused = extend(&mut cluster, &id, 500).await.unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    assert!(
        refused.message().contains("it is running"),
        "{}",
        refused.message()
    );
    let done = cluster.create(&small_spec("")).await;
    cluster.finish(&done).await;
    let digest = cluster.digest(&done).await;
    let refused = extend(&mut cluster, &done, 100_001).await.unwrap_err();
    assert!(refused.message().contains("100000"), "{}", refused.message());
    assert_eq!(cluster.digest(&done).await, digest, "nothing has changed");
    cluster.stop().await;
}
