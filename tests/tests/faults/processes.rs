//! Coordinators, workers and trainers as processes that can be killed, and started again where they were.

use murmuration_proto::v1::{self, campaign_service_client::CampaignServiceClient};
use murmuration_tests::binary;
use std::{
    ffi::OsString,
    fs::{self, File},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};
use tokio::runtime::Runtime;
use tonic::{
    Status,
    transport::{Channel, Endpoint},
};

/// Long enough for a busy machine; nothing takes that long that works.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// What processes find in their environment.
pub type Environment = Vec<(&'static str, OsString)>;

/// A process that writes its log to a file, and is killed with this.
pub struct Process {
    child: Child,
    log: PathBuf,
}

impl Process {
    pub fn start(mut command: Command, log: &Path) -> Self {
        let file = File::create(log).unwrap();
        let command = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(file);
        let child = command.env("RUST_BACKTRACE", "0").spawn().unwrap();
        Self {
            child,
            log: log.to_owned(),
        }
    }

    /// SIGKILL. Panics if it had ended by itself: then the fault did not fire.
    pub fn kill(mut self) {
        let ended = self.child.try_wait().unwrap();
        assert!(
            ended.is_none(),
            "it had ended before it was killed: {}",
            self.said()
        );
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Stops and continues it (SIGSTOP, SIGCONT).
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill")
            .args(["-s", name, &self.child.id().to_string()])
            .status();
        assert!(sent.unwrap().success());
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// What it has logged.
    pub fn said(&self) -> String {
        fs::read_to_string(&self.log).unwrap_or_default()
    }

    /// Waits until it has logged something.
    pub fn wait_for(&mut self, sign: &str) {
        let begun = Instant::now();
        while !self.said().contains(sign) {
            let ended = self.child.try_wait().unwrap();
            assert!(
                ended.is_none(),
                "it ended without saying {sign:?}: {}",
                self.said()
            );
            assert!(
                begun.elapsed() < PATIENCE,
                "it never said {sign:?}: {}",
                self.said()
            );
            thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A coordinator over a data directory, and whoever works for it.
pub struct Cluster {
    folder: tempfile::TempDir,
    environment: Environment,
    address: String,
    coordinator: Option<Process>,
    pub workers: Vec<Process>,
    started: u32,
    runtime: Runtime,
    client: CampaignServiceClient<Channel>,
}

impl Cluster {
    /// A coordinator that repeats one evaluation in ten on another worker, with `workers` workers of one thread.
    pub fn start(workers: usize) -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), workers, Vec::new())
    }

    /// The same in a folder that is ready, where the data directory is `data`, and with more in the environment of every
    /// process.
    pub fn start_in(folder: tempfile::TempDir, workers: usize, environment: Environment) -> Self {
        let mut coordinator = serve(folder.path(), "127.0.0.1:0", 0, &environment);
        coordinator.wait_for("  pages:");
        let said = coordinator.said();
        let (_, rest) = said.split_once("http://").unwrap();
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

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    pub fn address(&self) -> &str {
        &self.address
    }

    pub fn runtime(&self) -> &Runtime {
        &self.runtime
    }

    pub fn coordinator(&self) -> &Process {
        self.coordinator.as_ref().unwrap()
    }

    /// Kills the coordinator and starts it again where it was.
    pub fn restart_coordinator(&mut self) {
        self.coordinator.take().unwrap().kill();
        self.started += 1;
        let mut coordinator = serve(self.folder.path(), &self.address, self.started, &self.environment);
        coordinator.wait_for("  pages:");
        self.coordinator = Some(coordinator);
    }

    pub fn add_worker(&mut self) {
        let worker = self.worker(&self.url(), "murmuration-worker");
        self.workers.push(worker);
    }

    /// Starts a worker or trainer that looks for its coordinator at `url`.
    pub fn worker(&mut self, url: &str, name: &str) -> Process {
        self.start_worker(Command::new(binary(name)), url, name)
    }

    /// Starts a worker in a network namespace.
    pub fn worker_in(&mut self, namespace: &str, url: &str) -> Process {
        let mut command = Command::new("ip");
        let name = "murmuration-worker";
        command.args(["netns", "exec", namespace]).arg(binary(name));
        self.start_worker(command, url, name)
    }

    fn start_worker(&mut self, mut command: Command, url: &str, name: &str) -> Process {
        self.started += 1;
        command
            .args(["--coordinator", url])
            .envs(self.environment.clone());
        if name == "murmuration-worker" {
            let cache = self.folder.path().join("cache");
            command.args(["--threads", "1"]).arg("--cache").arg(cache);
            command.args(["--name", &format!("worker-{}", self.started)]);
        }
        Process::start(command, &self.folder.path().join(format!("{}.log", self.started)))
    }

    pub fn submit(&mut self, spec: &murmuration_proto::CampaignSpec) -> String {
        let request = v1::CreateCampaignRequest {
            spec: Some(spec.into()),
            weight: None,
        };
        let created = self.runtime.block_on(self.client.create_campaign(request));
        created.unwrap().into_inner().id
    }

    /// The campaign as it stands, or why that cannot be known.
    pub fn try_status(&mut self, campaign: &str) -> Result<v1::Campaign, Status> {
        let request = v1::GetCampaignRequest {
            campaign: campaign.to_owned(),
        };
        Ok(self
            .runtime
            .block_on(self.client.get_campaign(request))?
            .into_inner())
    }

    /// Looks at the campaign until `until` is so, or it has ended, or that takes too long.
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
                ));
                if seen != now {
                    (seen, begun) = (now, Instant::now());
                }
            }
            assert!(begun.elapsed() < PATIENCE, "no progress since {seen:?}");
            thread::sleep(Duration::from_millis(3));
        }
    }

    /// Waits until the campaign is complete; its digest.
    pub fn finish(&mut self, campaign: &str) -> String {
        let last = self.wait_until(campaign, |_| false);
        assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
        self.digest(campaign)
    }

    /// Waits until no task waits for a worker and none is with one.
    pub fn wait_for_idleness(&self) {
        let begun = Instant::now();
        loop {
            let page = ureq::get(format!("{}/metrics", self.url())).call().unwrap();
            let page = page.into_body().read_to_string().unwrap();
            let idle = |gauge| page.contains(&format!("{gauge}{{party=\"worker\"}} 0\n"));
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

    pub fn digest(&mut self, campaign: &str) -> String {
        let request = v1::GetDigestRequest {
            campaign: campaign.to_owned(),
        };
        let answer = self.runtime.block_on(self.client.get_digest(request));
        answer.unwrap().into_inner().digest
    }
}

fn serve(folder: &Path, listen: &str, number: u32, environment: &Environment) -> Process {
    let mut command = Command::new(binary("murmuration"));
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
        ])
        .env("MURMURATION_DATA", folder.join("data"))
        .envs(environment.clone());
    Process::start(command, &folder.join(format!("coordinator-{number}.log")))
}
