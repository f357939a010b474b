//! People's decisions at bad moments: while the coordinator starts, while a campaign is created, while an archive is clustered.
//! Acknowledged decisions must last, and no decision may wait for a computation.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    table::Row,
};
use murmuration_model::Weight;
use murmuration_proto::{parts::whole, v1};
use murmuration_store::{ArchivedIndividual, DataDirectory, GenerationRecord, Provenance, Store, Trial};
use murmuration_swarm::{CampaignSpec, Controller, Purpose, RandomStream};
use murmuration_tests::{ProcessClient, ProcessCluster};
use rand::RngExt as _;
use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};
use tonic::Code;

/// Number of campaigns for each kill of the coordinator. All but one of these campaigns are cancelled at the next start. The
/// number is large, so that the coordinator needs a while to read the campaigns.
const CAMPAIGNS_A_KILL: usize = 40;
/// Number of campaigns that are cancelled while they are created.
const CREATED: usize = 30;
/// Number of clients that cancel the same campaign at once.
const CANCELLERS: usize = 4;
/// Number of individuals in the archive that is clustered.
const CLUSTERED: u32 = 60_000;
/// Number of medoids. With so many medoids, clustering lasts until all faults have struck.
const MEDOIDS: u32 = 1_000;
/// Processor time of the coordinator after which it has read the archive and is clustering it.
const READ: Duration = Duration::from_secs(2);
/// Longest permitted answer time while an archive is clustered.
const LIMIT: Duration = Duration::from_secs(10);

/// Kills the coordinator, and cancels campaigns while it starts again. Then cancels further campaigns while they are created.
pub fn cancels(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let kills = scale.coordinator_kills as usize;
    let spec = campaign(scale, 4, 100);
    // Without workers every campaign makes no progress until all cancels are acknowledged.
    let mut cluster = ProcessCluster::start(0);
    let ids: Vec<_> = (0..kills * CAMPAIGNS_A_KILL)
        .map(|_| cluster.submit(&spec))
        .collect();
    let (to_cancel, to_complete): (Vec<_>, Vec<_>) = ids
        .into_iter()
        .enumerate()
        .partition(|(place, _)| place % CAMPAIGNS_A_KILL != 0);
    let to_complete: Vec<String> = to_complete.into_iter().map(|(_, id)| id).collect();
    let mut cancelled: Vec<String> = to_cancel.into_iter().map(|(_, id)| id).collect();
    for part in cancelled.chunks(CAMPAIGNS_A_KILL - 1) {
        cluster.kill_coordinator();
        let cancels: Vec<_> = part
            .iter()
            .map(|id| cluster.runtime().spawn(cancel(cluster.client(), id.clone())))
            .collect();
        cluster.start_coordinator();
        for acknowledged in cancels {
            cluster.runtime().block_on(acknowledged).unwrap();
        }
        // The coordinator has resumed all running campaigns by now.
        for id in part {
            assert!(!cluster.try_status(id).unwrap().active, "{id} goes on, cancelled");
        }
    }
    cancelled.extend(cancels_at_creation(&mut cluster, &spec));

    cluster.add_worker();
    cluster.add_worker();
    for id in &to_complete {
        assert_eq!(cluster.finish(id), undisturbed.digest(&spec));
    }
    // A wrongly started search would have occupied the workers by now.
    cluster.wait_for_idleness();
    for id in &cancelled {
        let status = cluster.try_status(id).unwrap();
        assert_eq!(
            (status.state(), status.active, status.generations_done),
            (v1::CampaignState::Cancelled, false, 0),
            "the cancel of {id} was acknowledged"
        );
    }
    Row {
        done: format!(
            "{} campaigns cancelled while a killed coordinator started, {CREATED} while they were created",
            cancelled.len() - CREATED
        ),
        found: format!(
            "all stayed cancelled; {} others: {}",
            to_complete.len(),
            undisturbed.check(&spec, &undisturbed.digest(&spec))
        ),
    }
}

/// Creates campaigns that clients try to cancel before the campaigns exist; returns the campaigns' ids.
fn cancels_at_creation(cluster: &mut ProcessCluster, spec: &CampaignSpec) -> Vec<String> {
    let last = cluster.submit(spec);
    let number: usize = last.rsplit('-').next().unwrap().parse().unwrap();
    let mut created = Vec::new();
    for next in number + 1..=number + CREATED {
        let id = format!("{}-{next}", spec.name().as_str());
        let cancels: Vec<_> = (0..CANCELLERS)
            .map(|_| cluster.runtime().spawn(cancel(cluster.client(), id.clone())))
            .collect();
        assert_eq!(cluster.submit(spec), id);
        for acknowledged in cancels {
            cluster.runtime().block_on(acknowledged).unwrap();
        }
        created.push(id);
    }
    // Cancels the first campaign, whose number predicted the ids of the other campaigns.
    cluster.runtime().block_on(cancel(cluster.client(), last));
    created
}

/// Requests a cancel until the campaign is cancelled, by this client or by another client.
async fn cancel(mut client: ProcessClient, id: String) {
    let begun = Instant::now();
    loop {
        let request = v1::CancelCampaignRequest { campaign: id.clone() };
        match client.cancel_campaign(request).await {
            Ok(_) => return,
            Err(refused) if refused.code() == Code::FailedPrecondition => {
                assert!(refused.message().contains("cancelled"), "{refused}");
                return;
            }
            // The coordinator does not listen yet, or the campaign does not exist yet.
            Err(error) => assert!(begun.elapsed() < murmuration_tests::PATIENCE, "{error}"),
        }
        tokio::task::yield_now().await;
    }
}

/// Pauses, resumes and cancels a campaign, and shuts the coordinator down, while the coordinator clusters the campaign's whole
/// archive.
pub fn clustering(_: &Scale, _: &Undisturbed) -> Row {
    let folder = tempfile::tempdir().unwrap();
    let id = unclustered(&folder.path().join("data"));
    let mut cluster = ProcessCluster::start_in(folder, 0, Vec::new());
    let before = cluster.digest(&id);
    let mut slowest = Duration::ZERO;

    clusters(&mut cluster, &id);
    let watched = Watched::begin(&cluster);
    let paused = timed(&mut slowest, || cluster.pause(&id));
    assert_eq!(paused.state(), v1::CampaignState::Paused);
    cluster.resume(&id);
    clusters(&mut cluster, &id);
    slowest = slowest.max(watched.end());

    let begun = Instant::now();
    cluster.terminate_coordinator();
    let ended = begun.elapsed();
    assert!(ended < LIMIT, "the coordinator took {ended:?} to end");
    cluster.start_coordinator();

    clusters(&mut cluster, &id);
    let client = cluster.client();
    timed(&mut slowest, || {
        cluster.runtime().block_on(cancel(client, id.clone()))
    });
    let status = cluster.try_status(&id).unwrap();
    assert_eq!(
        (status.state(), status.active),
        (v1::CampaignState::Cancelled, false)
    );
    assert_eq!(
        cluster.taxonomy(&id).unwrap_err().code(),
        Code::FailedPrecondition
    );
    assert_eq!(cluster.digest(&id), before);
    assert!(slowest < LIMIT, "an answer took {slowest:?}");
    Row {
        done: format!(
            "a campaign paused, resumed and cancelled, and its coordinator ended, while {CLUSTERED} individuals were clustered"
        ),
        found: format!(
            "answered within {} ms, list, page and metrics too; ended within {} ms; the archive as it was, no taxonomy",
            slowest.as_millis(),
            ended.as_millis()
        ),
    }
}

/// Makes a data directory with a campaign that lacks only its taxonomy; returns its id.
fn unclustered(data: &Path) -> String {
    let text = format!(
        "name = \"whole\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n\
         [search]\npopulation = {CLUSTERED}\ngenerations = 1\n[taxonomy]\nmedoids = {MEDOIDS}\n\
         choose = \"medoids\"\n"
    );
    let spec = CampaignSpec::from_toml(&text).unwrap();
    let store = Store::open(&DataDirectory::hold(data).unwrap()).unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 1).unwrap();
    let mut dice = RandomStream::derive(1, Purpose::Jitter, 9);
    let individuals: Vec<_> = (0..u64::from(CLUSTERED))
        .map(|index| ArchivedIndividual {
            seed: index,
            trials: vec![Trial {
                features: dice.random(),
                ..Trial::default()
            }],
            novelty: 0.5,
            ..ArchivedIndividual::unmeasured(index, 0, Controller::new(spec.model(), &[0.0; 4]).unwrap())
        })
        .collect();
    let generation = GenerationRecord::of(0, &[0.5], 0);
    store
        .commit_generation(&id, &generation, &individuals, &Provenance::default())
        .unwrap();
    id.as_str().to_owned()
}

/// Waits until the coordinator has read the archive and is clustering it.
fn clusters(cluster: &mut ProcessCluster, id: &str) {
    let status = cluster.wait_until(id, |status| status.active);
    assert_eq!(
        (status.state(), status.stage()),
        (v1::CampaignState::Running, v1::CampaignStage::Taxonomy)
    );
    let enough = cluster.coordinator().cpu_time() + READ;
    let begun = Instant::now();
    while cluster.coordinator().cpu_time() < enough {
        assert!(
            begun.elapsed() < murmuration_tests::PATIENCE,
            "nothing is computed"
        );
        thread::sleep(Duration::from_millis(20));
    }
}

fn timed<T>(slowest: &mut Duration, ask: impl FnOnce() -> T) -> T {
    let begun = Instant::now();
    let answer = ask();
    *slowest = (*slowest).max(begun.elapsed());
    answer
}

/// A client that requests all lists and pages again and again.
struct Watched {
    done: Arc<AtomicBool>,
    slowest: thread::JoinHandle<Duration>,
}

impl Watched {
    fn begin(cluster: &ProcessCluster) -> Self {
        let done = Arc::new(AtomicBool::new(false));
        let (until, url) = (done.clone(), cluster.url());
        let (mut client, runtime) = (cluster.client(), cluster.runtime().handle().clone());
        let slowest = thread::spawn(move || {
            let mut slowest = Duration::ZERO;
            while !until.load(Ordering::Relaxed) {
                let listed = timed(&mut slowest, || {
                    runtime.block_on(async {
                        let parts = client.list_campaigns(v1::ListCampaignsRequest {}).await?;
                        whole(parts.into_inner()).await
                    })
                });
                assert_eq!(listed.unwrap().campaigns.len(), 1);
                for page in ["/", "/metrics"] {
                    let got = timed(&mut slowest, || {
                        runtime.block_on(murmuration_tests::http::get(format!("{url}{page}")))
                    });
                    assert_eq!(got.unwrap().status(), 200);
                }
            }
            slowest
        });
        Self { done, slowest }
    }

    /// Stops the client; returns the slowest answer's time.
    fn end(self) -> Duration {
        self.done.store(true, Ordering::Relaxed);
        self.slowest.join().unwrap()
    }
}
