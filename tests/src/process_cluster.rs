//! A cluster of real processes. Tests can kill the coordinator, workers and trainers, and restart them in the same place.

use crate::{PATIENCE, Running, binary, page};
use murmuration_proto::{
    parts::whole,
    v1::{self, campaign_service_client::CampaignServiceClient},
};
use std::{
    ffi::OsString,
    net::Ipv4Addr,
    path::Path,
    process::Command,
    thread,
    time::{Duration, Instant},
};
use tokio::runtime::Runtime;
use tonic::{
    Request, Status,
    transport::{Channel, Endpoint},
};

/// A client of a coordinator. The client reconnects when the coordinator restarts.
pub type ProcessClient = CampaignServiceClient<Channel>;

/// Additional environment variables of processes.
pub type Environment = Vec<(&'static str, OsString)>;

/// The beginning of the panic message of a campaign that completes before all its faults have struck. The machine was faster than
/// the test expects: no error was found, but the faults were not tested.
pub const OVER_TOO_EARLY: &str = "the campaign was over too early";

fn check_state(status: &v1::Campaign) {
    let generations = status.generations_done;
    if status.state() == v1::CampaignState::Completed {
        panic!("{OVER_TOO_EARLY}, after {generations} generations");
    }
    assert_eq!(status.state(), v1::CampaignState::Running, "{}", status.error);
}

/// A coordinator over a data directory, and the processes that work for it.
#[derive(Debug)]
pub struct ProcessCluster {
    folder: tempfile::TempDir,
    environment: Environment,
    address: String,
    coordinator: Option<Running>,
    /// Workers that [`ProcessCluster::add_worker`] started.
    pub workers: Vec<Running>,
    started: u32,
    runtime: Runtime,
    client: ProcessClient,
}

impl ProcessCluster {
    /// Starts a coordinator that repeats one evaluation in ten on another worker, and `workers` workers of one thread. Waits
    /// until the workers have joined.
    pub fn start(workers: usize) -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), workers, Vec::new())
    }

    /// Starts a cluster as [`ProcessCluster::start`] does, in an existing folder, with additional environment variables for every
    /// process. The data directory is `data` in this folder.
    pub fn start_in(folder: tempfile::TempDir, workers: usize, environment: Environment) -> Self {
        let coordinator = Command::new(binary("murmuration"));
        Self::start_of(coordinator, folder, workers, environment)
    }

    /// Starts a cluster as [`ProcessCluster::start`] does; the coordinator may have `files` open files.
    pub fn start_with_open_files(files: u64, workers: usize) -> Self {
        let mut coordinator = Command::new("sh");
        let limited = format!("ulimit -n {files} && exec \"$0\" \"$@\"");
        coordinator.args(["-c", &limited]).arg(binary("murmuration"));
        Self::start_of(coordinator, tempfile::tempdir().unwrap(), workers, Vec::new())
    }

    fn start_of(
        coordinator: Command,
        folder: tempfile::TempDir,
        workers: usize,
        environment: Environment,
    ) -> Self {
        let mut coordinator = serve(coordinator, folder.path(), "127.0.0.1:0", &environment);
        coordinator.wait_for("  pages:");
        let log = coordinator.output();
        let (_, rest) = log.split_once("http://").unwrap();
        let address = rest.split_whitespace().next().unwrap().to_owned();
        let runtime = Runtime::new().unwrap();
        let channel = {
            let _inside = runtime.enter();
            Endpoint::from_shared(format!("http://{address}"))
                .unwrap()
                .connect_lazy()
        };
        let mut cluster = Self {
            folder,
            environment,
            address,
            coordinator: Some(coordinator),
            workers: Vec::new(),
            started: 0,
            runtime,
            client: CampaignServiceClient::new(channel),
        };
        for _ in 0..workers {
            cluster.add_worker();
        }
        cluster
    }

    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// A new client.
    pub fn client(&self) -> ProcessClient {
        self.client.clone()
    }

    /// The async runtime of the cluster's clients.
    pub fn runtime(&self) -> &Runtime {
        &self.runtime
    }

    /// The coordinator's process. Panics if the coordinator is not running.
    pub fn coordinator(&self) -> &Running {
        self.coordinator.as_ref().unwrap()
    }

    /// Kills the coordinator and restarts it at the same address.
    pub fn restart_coordinator(&mut self) {
        self.kill_coordinator();
        self.start_coordinator();
    }

    pub fn kill_coordinator(&mut self) {
        self.coordinator.take().unwrap().kill();
    }

    /// Sends SIGTERM; the coordinator must exit successfully.
    pub fn terminate_coordinator(&mut self) {
        let (code, log) = self.coordinator.take().unwrap().terminate_and_hear();
        assert_eq!(code, Some(0), "{log}");
    }

    /// Waits until the coordinator ends by itself; returns its exit code and standard error.
    pub fn coordinator_ends(&mut self) -> (Option<i32>, String) {
        self.coordinator.take().unwrap().wait_and_hear()
    }

    /// Restarts the coordinator at the same address.
    pub fn start_coordinator(&mut self) {
        let mut coordinator = serve(
            Command::new(binary("murmuration")),
            self.folder.path(),
            &self.address,
            &self.environment,
        );
        coordinator.wait_for("  pages:");
        self.coordinator = Some(coordinator);
    }

    /// Adds a worker that, to the coordinator, runs on a machine of its own.
    pub fn add_worker(&mut self) {
        let cache = self.folder.path().join("cache");
        let worker = self.odd_worker(&cache, &[]);
        self.workers.push(worker);
    }

    /// Starts a worker that, to the coordinator, runs on a machine of its own. The worker has additional environment variables,
    /// and keeps its checkpoints in `cache`.
    pub fn odd_worker(&mut self, cache: &Path, variables: &[(&str, &str)]) -> Running {
        let mut command = Command::new(binary("murmuration-worker"));
        let [high, low] = (self.started as u16 + 1).to_be_bytes();
        let machine = Ipv4Addr::new(127, 2, high, low).to_string();
        command
            .args(["--local-address", &machine])
            .arg("--cache")
            .arg(cache);
        command.envs(variables.iter().copied());
        self.start_worker(command, &self.url(), "murmuration-worker")
    }

    /// Starts a worker or trainer that connects to the coordinator at `url`, and waits until the process has joined.
    pub fn worker(&mut self, url: &str, name: &str) -> Running {
        let mut command = Command::new(binary(name));
        if name == "murmuration-worker" {
            command.arg("--cache").arg(self.folder.path().join("cache"));
        }
        self.start_worker(command, url, name)
    }

    /// Starts a worker in a network namespace, and waits until the worker has joined.
    pub fn worker_in(&mut self, namespace: &str, url: &str) -> Running {
        let mut command = Command::new("ip");
        let name = "murmuration-worker";
        command.args(["netns", "exec", namespace]).arg(binary(name));
        command.arg("--cache").arg(self.folder.path().join("cache"));
        self.start_worker(command, url, name)
    }

    fn start_worker(&mut self, mut command: Command, url: &str, name: &str) -> Running {
        self.started += 1;
        command
            .args(["--coordinator", url])
            .envs(self.environment.clone());
        if name == "murmuration-worker" {
            command.args(["--threads", "1"]);
            command.args(["--name", &format!("worker-{}", self.started)]);
        }
        let mut process = Running::start(command);
        process.wait_until_joined();
        process
    }

    /// Starts a campaign; returns its id.
    pub fn submit(&mut self, spec: &murmuration_swarm::CampaignSpec) -> String {
        let request = v1::CreateCampaignRequest {
            campaign: Some(v1::create_campaign_request::Campaign::Spec(spec.into())),
            ..v1::CreateCampaignRequest::default()
        };
        let created = self.runtime.block_on(self.client.create_campaign(request));
        created.unwrap().into_inner().id
    }

    /// The current status of the campaign, or the error of the request.
    pub fn try_status(&mut self, campaign: &str) -> Result<v1::Campaign, Status> {
        let request = v1::GetCampaignRequest {
            campaign: campaign.to_owned(),
        };
        Ok(self
            .runtime
            .block_on(self.client.get_campaign(request))?
            .into_inner())
    }

    /// Pauses a campaign. The coordinator must answer within a minute.
    pub fn pause(&mut self, campaign: &str) -> v1::Campaign {
        let mut request = Request::new(v1::PauseCampaignRequest {
            campaign: campaign.to_owned(),
        });
        request.set_timeout(Duration::from_secs(60));
        let paused = self.runtime.block_on(self.client.pause_campaign(request));
        paused.unwrap().into_inner()
    }

    /// Resumes a campaign.
    pub fn resume(&mut self, campaign: &str) -> v1::Campaign {
        let request = v1::ResumeCampaignRequest {
            campaign: campaign.to_owned(),
        };
        let resumed = self.runtime.block_on(self.client.resume_campaign(request));
        resumed.unwrap().into_inner()
    }

    /// The taxonomy, or the error of the request.
    pub fn taxonomy(&mut self, campaign: &str) -> Result<v1::Taxonomy, Status> {
        let request = v1::GetTaxonomyRequest {
            campaign: campaign.to_owned(),
        };
        let parts = self.runtime.block_on(self.client.get_taxonomy(request))?;
        self.runtime.block_on(whole(parts.into_inner()))
    }

    /// Polls the campaign until `until` holds or the campaign has ended. Panics if the campaign makes no progress.
    pub fn wait_until(&mut self, campaign: &str, until: impl Fn(&v1::Campaign) -> bool) -> v1::Campaign {
        let mut begun = Instant::now();
        let mut seen = None;
        loop {
            if let Ok(status) = self.try_status(campaign) {
                if until(&status) || !matches!(status.state(), v1::CampaignState::Running) {
                    return status;
                }
                let now = Some((
                    status.stage,
                    status.generations_done,
                    status.dataset_done,
                    status.training,
                    (status.labelled, status.embedded),
                ));
                if seen != now {
                    (seen, begun) = (now, Instant::now());
                }
            }
            assert!(begun.elapsed() < PATIENCE, "no progress since {seen:?}");
            thread::sleep(Duration::from_millis(3));
        }
    }

    /// Waits until `until` holds, and checks that the campaign still runs: a later fault would have no effect.
    pub fn wait_to_strike(&mut self, campaign: &str, until: impl Fn(&v1::Campaign) -> bool) -> v1::Campaign {
        let status = self.wait_until(campaign, until);
        check_state(&status);
        status
    }

    /// Checks that the campaign still runs, so that a fault strikes, or has struck, in time.
    pub fn check_running(&mut self, campaign: &str) -> v1::Campaign {
        let status = self.try_status(campaign).unwrap();
        check_state(&status);
        status
    }

    /// Waits until the campaign is complete; returns its digest.
    pub fn finish(&mut self, campaign: &str) -> String {
        let last = self.wait_until(campaign, |_| false);
        assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
        self.digest(campaign)
    }

    /// The value of one of the coordinator's metrics.
    pub fn metric(&self, name: &str) -> f64 {
        let page = page(&format!("{}/metrics", self.url()));
        let value = page
            .lines()
            .find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        value.unwrap().parse().unwrap()
    }

    /// Waits until no task is queued and none is leased.
    pub fn wait_for_idleness(&self) {
        let begun = Instant::now();
        loop {
            let page = page(&format!("{}/metrics", self.url()));
            let idle = |gauge| page.contains(&format!("{gauge}{{peer=\"worker\"}} 0\n"));
            if idle("murmuration_leases") && idle("murmuration_tasks_pending") {
                return;
            }
            assert!(
                begun.elapsed() < PATIENCE,
                "leases or tasks of nobody are left:\n{page}"
            );
            thread::sleep(Duration::from_millis(50));
        }
    }

    /// The digest of a campaign's archive.
    pub fn digest(&mut self, campaign: &str) -> String {
        let request = v1::GetDigestRequest {
            campaign: campaign.to_owned(),
        };
        let answer = self.runtime.block_on(self.client.get_digest(request));
        answer.unwrap().into_inner().digest
    }
}

fn serve(mut command: Command, folder: &Path, listen: &str, environment: &Environment) -> Running {
    command
        .args([
            "serve",
            "--workers",
            "0",
            "--trainers",
            "0",
            "--audit",
            "0.1",
            "--listen",
            listen,
            // Tests of credentials are elsewhere.
            "--insecure-listen",
        ])
        .env("MURMURATION_DATA", folder.join("data"))
        .envs(environment.clone());
    Running::start(command)
}
