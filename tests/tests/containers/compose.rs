//! A cluster of containers. Dropping a [`ComposeCluster`] stops the containers.

use murmuration_tests::{
    Finished, Murmuration,
    requirements::{base_images, compose},
};
use serde_json::Value;
use std::{
    fs,
    net::TcpListener,
    path::Path,
    process::{Command, Output},
    thread,
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Time limit of every wait: far longer than anything takes, also beside other tests on a busy machine.
const LIMIT: Duration = Duration::from_secs(900);
const PAUSE: Duration = Duration::from_millis(100);
/// Files of the coordinator that its clients need too.
const CA: &str = "ca.pem";
const TOKEN: &str = "operator.token";

/// Containers of deploy/compose.yaml.
pub struct ComposeCluster {
    /// Base images of the Dockerfile: for building, and for running.
    bases: (String, String),
    project: String,
    port: u16,
    /// The command line's token, and the certificate of the authority that the command line trusts.
    secrets: TempDir,
    /// The host's command line, without a data directory.
    murmuration: Murmuration,
}

impl ComposeCluster {
    /// Builds the image, and starts a coordinator, a trainer and `workers` workers.
    pub fn up(workers: usize) -> Self {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        let cluster = Self {
            bases: base_images().expect("the harness asks first whether there are images"),
            project: format!("murmuration-tests-{}", std::process::id()),
            port: free.local_addr().unwrap().port(),
            secrets: tempfile::tempdir().unwrap(),
            murmuration: Murmuration::over(Path::new("/nowhere")),
        };
        drop(free);
        cluster.compose(&["build", "coordinator"]);
        cluster.compose(&["up", "--detach", "--scale", &format!("worker={workers}")]);
        for secret in [CA, TOKEN] {
            let inside = format!("/etc/murmuration/{secret}");
            let held = docker(&[
                "exec",
                &cluster.containers(Some("coordinator"))[0],
                "cat",
                &inside,
            ]);
            fs::write(cluster.secret(secret), held).unwrap();
        }
        cluster
    }

    /// Runs a command on this machine against the coordinator in its container.
    pub fn murmuration(&self, arguments: &[&str]) -> Finished {
        let url = format!("https://127.0.0.1:{}", self.port);
        let (ca, token) = (self.secret(CA), self.secret(TOKEN));
        let to = ["--coordinator", &url, "--ca", &ca, "--token-file", &token];
        self.murmuration.run(&[arguments, &to].concat())
    }

    fn secret(&self, name: &str) -> String {
        self.secrets.path().join(name).to_str().unwrap().to_owned()
    }

    /// Waits until the health check of every container succeeds.
    pub fn wait_until_healthy(&self) {
        let containers = self.containers(None);
        assert!(containers.len() > 2, "{containers:?}");
        for container in containers {
            until("a healthy container", || {
                inspect(&container)["State"]["Health"]["Status"] == "healthy"
            });
        }
    }

    /// Waits until the newest campaign satisfies `described`. The coordinator may restart meanwhile.
    pub fn wait_for(&self, what: &str, described: impl Fn(&Value) -> bool) {
        until(what, || {
            let shown = self.murmuration(&["show", "latest", "--json"]);
            if shown.code != Some(0) {
                return false;
            }
            let status = shown.last_line();
            assert_ne!(status["state"], "failed", "{status}");
            let described = described(&status);
            assert!(
                described || status["state"] != "completed",
                "{what}: was missed, {status}"
            );
            described
        });
    }

    /// Kills a container of a service with SIGKILL, checks that SIGKILL ended the container, and starts the container again.
    pub fn kill_one(&self, service: &str) {
        let container = &self.containers(Some(service))[0];
        docker(&["kill", "--signal", "KILL", container]);
        until("a dead container", || {
            inspect(container)["State"]["Running"] == false
        });
        assert_eq!(
            inspect(container)["State"]["ExitCode"],
            137,
            "{service} was not killed"
        );
        docker(&["start", container]);
    }

    /// Checks that a service's containers have no privileges, and can write only to the folders that they need.
    pub fn check_confined(&self, service: &str) {
        let container = &self.containers(Some(service))[0];
        let user = docker(&["exec", container, "id", "-u"]);
        assert_eq!(user.trim(), "10001");
        let status = docker(&["exec", container, "cat", "/proc/self/status"]);
        let line = |name: &str| {
            let found = status.lines().find_map(|line| line.strip_prefix(name));
            found.unwrap_or_default().trim().to_owned()
        };
        assert_eq!(line("CapBnd:"), "0000000000000000");
        assert_eq!(line("NoNewPrivs:"), "1");
        let written = Command::new("docker")
            .args(["exec", container, "touch", "/usr/local/bin/new"])
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&written.stderr).into_owned();
        assert!(message.contains("Read-only file system"), "{message}");
    }

    fn containers(&self, service: Option<&str>) -> Vec<String> {
        let project = format!("label=com.docker.compose.project={}", self.project);
        let mut arguments = vec!["ps", "--quiet", "--no-trunc", "--filter", &project];
        let service = service.map(|service| format!("label=com.docker.compose.service={service}"));
        if let Some(service) = &service {
            arguments.extend(["--filter", service]);
        }
        docker(&arguments).lines().map(str::to_owned).collect()
    }

    fn compose(&self, arguments: &[&str]) {
        let output = self.try_compose(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "compose {arguments:?}:\n{message}");
    }

    fn try_compose(&self, arguments: &[&str]) -> Output {
        compose_file()
            .args(["--project-name", &self.project])
            .args(arguments)
            .env("BUILD_BASE", &self.bases.0)
            .env("RUNTIME_BASE", &self.bases.1)
            .env("MURMURATION_IMAGE", "murmuration-tests/murmuration")
            .env("MURMURATION_PORT", self.port.to_string())
            .output()
            .unwrap()
    }
}

impl Drop for ComposeCluster {
    fn drop(&mut self) {
        if thread::panicking() {
            let logs = self.try_compose(&["logs", "--no-color", "--tail", "40"]);
            eprintln!("{}", String::from_utf8_lossy(&logs.stdout));
        }
        // Prints why containers cannot be removed.
        let down = self.try_compose(&["down", "--volumes", "--timeout", "2"]);
        if !down.status.success() {
            eprintln!("{}", String::from_utf8_lossy(&down.stderr));
        }
    }
}

/// The compose command for deploy/compose.yaml.
pub fn compose_file() -> Command {
    let mut command = compose().expect("the harness asks first whether there is compose");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/compose.yaml");
    command.arg("--file").arg(file);
    command
}

fn docker(arguments: &[&str]) -> String {
    let output = Command::new("docker").args(arguments).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "docker {arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

fn inspect(container: &str) -> Value {
    let shown: Value = serde_json::from_str(&docker(&["inspect", container])).unwrap();
    shown[0].clone()
}

fn until(what: &str, mut arrived: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !arrived() {
        assert!(begun.elapsed() < LIMIT, "waited too long for {what}");
        thread::sleep(PAUSE);
    }
}
