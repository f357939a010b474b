//! Tests workers that compute wrongly, and tasks that kill workers. The coordinator detects such workers and tasks, and the
//! outcome does not change.

mod elsewhere;
mod kinds;
mod machines;

use murmuration_dispatch::{Options, Share};
use murmuration_embed::Device;
use murmuration_link::Target;
use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, Purpose, RandomStream};
use murmuration_tests::{Cluster, FakeWorker, Murmuration, quick_dispatch, small_latent_spec, small_spec};
use rand::RngExt as _;
use std::{net::Ipv4Addr, num::NonZeroUsize, path::Path, time::Duration};
use tokio::{sync::watch, task::JoinHandle};
use tonic::{Code, Status};

/// Machine and process of the liar's connections, unless a test uses other numbers.
const LIAR: (u8, u64) = (2, 42);
/// A worker that takes a lease and does not answer.
const SLOW: (u8, u64) = (6, 45);

fn audited(share: &str) -> Options {
    Options {
        audited: share.parse::<Share>().unwrap(),
        ..quick_dispatch()
    }
}

/// Options as of [`audited`], with time for workers of the test that send nothing for a while.
fn patient(share: &str) -> Options {
    Options {
        silence_limit: Duration::from_secs(20),
        ..audited(share)
    }
}

/// A wrong evaluation that is not obviously impossible.
fn lie() -> v1::Evaluation {
    v1::Evaluation {
        features: vec![0.123; 5],
        image: vec![7; 2500],
        ..v1::Evaluation::default()
    }
}

/// A wrong evaluation that differs for each start, because a network cannot learn from identical pictures.
fn lie_about(seed: u64) -> v1::Evaluation {
    let mut noise = RandomStream::derive(seed, Purpose::Start, 0);
    v1::Evaluation {
        image: (0..2500).map(|_| noise.random()).collect(),
        ..lie()
    }
}

/// An evaluation that exposes a worker at once.
fn impossible() -> v1::Evaluation {
    v1::Evaluation {
        features: vec![f64::NAN; 5],
        ..lie()
    }
}

async fn connect(cluster: &Cluster, (machine, instance): (u8, u64)) -> Result<FakeWorker, Status> {
    FakeWorker::connect_as(&cluster.url(), machine, instance).await
}

/// Answers leases with lies until `count` tasks are answered.
async fn tell_lies(liar: &mut FakeWorker, count: usize) {
    let mut told = 0;
    while told < count {
        let (lease, batch) = liar.lease(20).await;
        let lies: Vec<_> = batch.tasks.iter().map(|task| lie_about(task.seed)).collect();
        told += lies.len();
        liar.answer_each(lease, lies).await;
    }
}

/// An honest worker.
struct Honest {
    stop: watch::Sender<bool>,
    work: JoinHandle<()>,
}

impl Honest {
    /// Starts a worker on the machine 127.0.0.`machine`.
    fn join(cluster: &Cluster, cache: &Path, machine: u8) -> Self {
        let options = murmuration_worker::client::Options {
            coordinator: Target::open(&cluster.url()),
            name: "honest".to_owned(),
            local_address: Some(Ipv4Addr::new(127, 0, 0, machine).into()),
            threads: NonZeroUsize::MIN,
            cache: cache.to_owned(),
            embed_on: Device::default(),
            health: murmuration_link::Health::default(),
            leaving: murmuration_link::Leaving::default(),
        };
        let (stop, stopped) = watch::channel(false);
        let work = async { murmuration_worker::client::run(options, stopped).await.unwrap() };
        let work = tokio::spawn(work);
        Self { stop, work }
    }

    async fn leave(self) {
        self.stop.send_replace(true);
        self.work.await.unwrap();
    }
}

/// A campaign of two hundred generations.
fn longer() -> CampaignSpec {
    let text = small_spec("").to_toml();
    CampaignSpec::from_toml(&text.replace("generations = 5", "generations = 200")).unwrap()
}

/// The digest of the campaign without a liar.
async fn undisturbed(spec: &CampaignSpec) -> String {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    let digest = cluster.run(spec).await;
    cluster.stop().await;
    digest
}

/// Starts a campaign on a cluster that audits everything, with the liar as its only worker. Returns the cluster, the campaign's
/// id and the liar.
async fn with_a_liar(data: &Path, spec: &CampaignSpec) -> (Cluster, String, FakeWorker) {
    // The silence limit leaves enough time for the second honest worker to join.
    let mut cluster = Cluster::start_with(data, 0, patient("1")).await;
    let campaign = cluster.create(spec).await;
    let liar = connect(&cluster, LIAR).await.unwrap();
    (cluster, campaign, liar)
}

fn notices(status: &v1::Campaign) -> String {
    let texts: Vec<_> = status.notices.iter().map(|notice| notice.text.as_str()).collect();
    texts.join("\n")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_an_audit_finds_wrong_is_quarantined_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    // The campaign is long enough that the liar gets work beside the honest workers.
    let spec = longer();
    let (mut cluster, campaign, mut liar) = with_a_liar(folder.path(), &spec).await;
    let (lease, batch) = liar.lease(5).await;
    // The honest workers join after the liar has a lease.
    let workers = [3, 4].map(|machine| Honest::join(&cluster, folder.path(), machine));
    while cluster.status(&campaign).await.workers < 3 {
        tokio::task::yield_now().await;
    }
    liar.answer(lease, lie(), batch.tasks.len()).await;
    let (_, status) = liar.answer_all(&lie()).await;
    assert_eq!(status.code(), Code::FailedPrecondition);
    assert!(status.message().contains("quarantined"), "{status}");
    // The coordinator also refuses another process of the same machine.
    for instance in [LIAR.1, 43, 0] {
        let again = connect(&cluster, (LIAR.0, instance)).await.unwrap_err();
        assert!(again.message().contains("quarantined"), "{again}");
    }
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    assert_eq!(cluster.digest(&campaign).await, undisturbed(&spec).await);
    for worker in workers {
        worker.leave().await;
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn generations_that_a_worker_found_wrong_had_a_part_in_are_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_with(folder.path(), 0, audited("0")).await;
    let campaign = cluster.create(&small_spec("")).await;
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    tell_lies(&mut liar, 20).await;
    // The coordinator has not detected the lies yet, so the next generation descends from them.
    let (lease, batch) = liar.lease(20).await;
    cluster
        .watch_until(&campaign, |status| status.generations_done == 1)
        .await;
    liar.answer(lease, impossible(), batch.tasks.len()).await;
    assert_eq!(liar.dismissed().await.code(), Code::InvalidArgument);
    let expected =
        "impostor at 127.0.0.2 returned wrong results and is quarantined: start a worker on another machine";
    cluster
        .watch_until(&campaign, |status| status.waiting.contains(expected))
        .await;
    let worker = Honest::join(&cluster, folder.path(), 3);
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    let expected = notices(&last);
    assert!(
        expected.contains("individual 0 was wrong; the generations from 0 on"),
        "{expected}"
    );
    assert_eq!(
        cluster.digest(&campaign).await,
        undisturbed(&small_spec("")).await
    );
    worker.leave().await;
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_completed_campaign_is_made_anew_when_one_of_its_workers_is_found_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let spec = small_spec("");
    let mut cluster = Cluster::start_with(folder.path(), 0, audited("0")).await;
    let campaign = cluster.create(&spec).await;
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    tell_lies(&mut liar, 20).await;
    cluster
        .watch_until(&campaign, |status| status.generations_done == 1)
        .await;
    drop(liar);
    let worker = Honest::join(&cluster, folder.path(), 3);
    cluster.finish(&campaign).await;
    let expected = undisturbed(&spec).await;
    assert_ne!(cluster.digest(&campaign).await, expected);
    worker.leave().await;
    cluster.stop().await;

    // Another coordinator over the same data directory has the record of each worker's results. It detects the liar in another
    // campaign.
    let mut cluster = Cluster::start_with(folder.path(), 0, audited("0")).await;
    let other = cluster.create(&small_spec("seed = 2")).await;
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let (lease, batch) = liar.lease(1).await;
    liar.answer(lease, impossible(), batch.tasks.len()).await;
    assert_eq!(liar.dismissed().await.code(), Code::InvalidArgument);
    let worker = Honest::join(&cluster, folder.path(), 3);
    cluster.finish(&other).await;
    let text = loop {
        let status = cluster.finish(&campaign).await;
        if !status.notices.is_empty() && status.state() == v1::CampaignState::Completed {
            break notices(&status);
        }
    };
    assert!(
        text.contains("individual 0 was wrong; the generations from 0 on"),
        "{text}"
    );
    assert_eq!(cluster.digest(&campaign).await, expected);
    worker.leave().await;
    cluster.stop().await;

    // A third coordinator refuses the liar.
    let cluster = Cluster::start(folder.path(), 0).await;
    for instance in [LIAR.1, 43] {
        let refused = connect(&cluster, (LIAR.0, instance)).await.unwrap_err();
        assert!(
            refused.message().contains("murmuration quarantine --lift"),
            "{refused}"
        );
    }
    let murmuration = Murmuration::over(folder.path());
    let listed = murmuration.run(&["quarantine", "--json"]).last_line();
    let quarantined = &listed["machines"][0];
    assert_eq!(quarantined["name"], "impostor at 127.0.0.2");
    let lift = ["quarantine", "--lift", quarantined["machine"].as_str().unwrap()];
    let held = murmuration.run(&lift);
    assert!(
        held.code == Some(1) && held.stderr.contains("stop that process first"),
        "{}",
        held.stderr
    );
    cluster.stop().await;

    // After a person has lifted the quarantine, the liar can connect again.
    for code in [0, 2] {
        let lifted = murmuration.run(&lift);
        assert_eq!(lifted.code, Some(code), "{}", lifted.stderr);
    }
    let cluster = Cluster::start(folder.path(), 0).await;
    connect(&cluster, LIAR).await.unwrap();
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_campaign_whose_audits_are_late_waits_for_them_whoever_else_is_found_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let spec = small_spec("");
    let expected = undisturbed(&spec).await;
    let mut cluster = Cluster::start_with(folder.path(), 0, patient("1")).await;
    let mut slow = connect(&cluster, SLOW).await.unwrap();
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let campaign = cluster.create(&spec).await;
    slow.lease(1).await;
    let search = spec.search();
    tell_lies(&mut liar, search.evaluations() as usize).await;
    cluster
        .watch_until(&campaign, |status| {
            status.generations_done == search.generations()
        })
        .await;
    let mut broken = connect(&cluster, (5, 44)).await.unwrap();
    let (lease, batch) = broken.lease(1).await;
    broken.answer(lease, impossible(), batch.tasks.len()).await;
    assert_eq!(broken.dismissed().await.code(), Code::InvalidArgument);
    drop(slow);
    let workers = [3, 4].map(|machine| Honest::join(&cluster, folder.path(), machine));
    cluster.finish(&campaign).await;
    assert_eq!(cluster.digest(&campaign).await, expected);
    for worker in workers {
        worker.leave().await;
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_embedder_that_was_trained_on_lies_is_trained_anew() {
    let folder = tempfile::tempdir().unwrap();
    let spec = small_latent_spec("");
    let options = Options {
        // The liar sends no heartbeat while it draws and compresses pictures.
        silence_limit: Duration::from_secs(20),
        ..audited("0")
    };
    let mut cluster = Cluster::start_with(folder.path(), 0, options).await;
    let campaign = cluster.create(&spec).await;
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let pictures = 200;
    tell_lies(&mut liar, pictures).await;
    // The trainer learns from the lies, and the search begins. Only then may the liar go: answers on their way would be lost.
    let searching = |status: &v1::Campaign| !status.checkpoint.is_empty();
    let status = cluster.watch_until(&campaign, searching).await;
    drop(liar);
    assert_eq!(status.error, "");
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let (lease, batch) = liar.lease(1).await;
    liar.answer(lease, impossible(), batch.tasks.len()).await;
    assert_eq!(liar.dismissed().await.code(), Code::InvalidArgument);
    let worker = Honest::join(&cluster, folder.path(), 3);
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    let message = notices(&last);
    assert!(
        message.contains("picture 0 of the dataset was wrong"),
        "{message}"
    );
    assert_eq!(cluster.digest(&campaign).await, undisturbed(&spec).await);
    worker.leave().await;
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_that_differ_without_a_third_fail_the_campaign_aloud() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_with(folder.path(), 0, audited("1")).await;
    let campaign = cluster.create(&small_spec("")).await;
    let mut first = connect(&cluster, (2, 1)).await.unwrap();
    let mut second = connect(&cluster, (3, 1)).await.unwrap();
    let (lease, batch) = first.lease(1).await;
    first.answer(lease, lie(), batch.tasks.len()).await;
    // The coordinator handles a worker's messages in order: another lease proves that the coordinator has handled the answer.
    first.lease(1).await;
    let (lease, same) = second.lease(1).await;
    assert_eq!(batch, same, "an audit comes first");
    let other = v1::Evaluation {
        features: vec![0.5; 5],
        ..lie()
    };
    second.answer(lease, other, same.tasks.len()).await;
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Failed);
    assert!(last.error.contains("disagree about task 0"), "{}", last.error);
    let who = [
        "(impostor at 127.0.0.2 and impostor at 127.0.0.3)",
        "(impostor at 127.0.0.3 and impostor at 127.0.0.2)",
    ];
    assert!(who.iter().any(|who| last.error.contains(who)), "{}", last.error);
    assert!(
        last.error.contains("start a worker on another machine"),
        "{}",
        last.error
    );
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_takes_three_workers_is_poisoned_and_the_campaign_goes_on() {
    let spec = small_spec("");
    let mut digests = Vec::new();
    for _ in 0..2 {
        let folder = tempfile::tempdir().unwrap();
        let mut cluster = Cluster::start(folder.path(), 0).await;
        let campaign = cluster.create(&spec).await;
        for (victim, expected) in [(1, 5), (2, 1), (3, 1)] {
            let mut victim = connect(&cluster, (2, victim)).await.unwrap();
            let (_, batch) = victim.lease(5).await;
            assert_eq!(batch.tasks.len(), expected, "after the first, it goes out alone");
            drop(victim);
            while cluster.status(&campaign).await.workers > 0 {
                tokio::task::yield_now().await;
            }
        }
        let worker = Honest::join(&cluster, folder.path(), 3);
        let last = cluster.finish(&campaign).await;
        assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
        let message = notices(&last);
        assert!(
            message.contains("the task of individual 0 was poisoned"),
            "{message}"
        );
        assert!(
            message.contains("3 workers were lost while they ran this task"),
            "{message}"
        );
        assert_eq!(message.matches("impostor at 127.0.0.2").count(), 3, "{message}");
        digests.push(cluster.digest(&campaign).await);
        worker.leave().await;
        cluster.stop().await;
    }
    assert_eq!(digests[0], digests[1], "what takes its place is always the same");
    assert_ne!(digests[0], undisturbed(&small_spec("")).await);
}
