//! The requirements of tests besides this repository, and checks whether a machine meets them.

use crate::{BoundFolder, SmallDisk};
use std::{
    env,
    process::{Command, Stdio},
    sync::Mutex,
};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requirement {
    /// Chromium and chromedriver.
    Chromium,
    /// A Docker engine, and the images made by `tests/containers/base-images`.
    Containers,
    /// `docker compose` or `docker-compose`, without an engine.
    Compose,
    /// A `python3` with these modules, separated by commas.
    Python(&'static str),
    /// Permission to mount a file system in memory.
    Mount,
    /// The programs `bindfs` and `unshare`, and permission to mount a folder a second time and to make a namespace of processes.
    BoundFolders,
    /// Permission to make a network namespace, and the programs `ip` and `iptables` to drop the namespace's packets.
    NetworkNamespace,
    /// At least this many open files allowed per process.
    OpenFiles(u64),
}

/// An unmet requirement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missing {
    /// A text: what is missing, and how to get it.
    pub reason: String,
    /// Whether the requirement could be installed here. False means that this machine does not allow it.
    pub can_be_had: bool,
}

impl Requirement {
    /// Returns what this machine lacks for the requirement. A process checks each requirement once.
    #[must_use]
    pub fn missing(self) -> Option<Missing> {
        static KNOWN: Mutex<Vec<(Requirement, Option<Missing>)>> = Mutex::new(Vec::new());
        let mut known = KNOWN.lock().unwrap();
        if let Some((_, missing)) = known.iter().find(|(requirement, _)| *requirement == self) {
            return missing.clone();
        }
        let missing = self.look().err();
        known.push((self, missing.clone()));
        missing
    }

    fn look(self) -> Result<(), Missing> {
        match self {
            Self::Chromium => installed(
                chromium().is_some(),
                "there is no Chromium with its chromedriver here (`scripts/browser` installs them)",
            ),
            Self::Containers => installed(
                base_images().is_some(),
                "there are no images to build containers on (`make test-containers` makes them, with a Docker engine)",
            ),
            Self::Compose => installed(compose().is_some(), "there is no docker compose here"),
            Self::Python(modules) => installed(
                succeeds("python3", &["-c", &format!("import {modules}")]),
                &format!("python3 has not all of {modules} (`make test` fetches them)"),
            ),
            Self::Mount => {
                installed(on_path("mount").is_some(), "there is no `mount` here")?;
                let folder = tempfile::tempdir().unwrap();
                let disk = SmallDisk::mount(&folder.path().join("disk"), "1m");
                allowed(
                    disk.is_some(),
                    "mounting a small file system is not allowed here: it needs root",
                )
            }
            Self::BoundFolders => {
                let reason = "there is no `bindfs` here (Debian: apt-get install bindfs)";
                installed(on_path("bindfs").is_some(), reason)?;
                let folder = tempfile::tempdir().unwrap();
                let [of, at] = ["of", "at"].map(|name| folder.path().join(name));
                let is_possible = BoundFolder::mount(&of, &at).is_some()
                    && succeeds("unshare", &["--pid", "--fork", "--kill-child", "true"]);
                allowed(
                    is_possible,
                    "mounting a folder with `bindfs`, or `unshare --pid`, is not allowed here: it needs root and /dev/fuse",
                )
            }
            Self::NetworkNamespace => {
                for program in ["ip", "iptables"] {
                    let reason =
                        format!("there is no `{program}` here (Debian: apt-get install iproute2 iptables)");
                    installed(on_path(program).is_some(), &reason)?;
                }
                allowed(
                    loses_packets(),
                    "a network namespace that loses packets is not allowed here: it needs root, and the kernel's `statistic`",
                )
            }
            Self::OpenFiles(wanted) => {
                let most = rlimit::increase_nofile_limit(u64::MAX).unwrap();
                let reason =
                    format!("a process may have {most} open files here, and needs {wanted} (`ulimit -Hn`)");
                allowed(most >= wanted, &reason)
            }
        }
    }
}

fn installed(is_there: bool, reason: &str) -> Result<(), Missing> {
    found(is_there, reason, true)
}

fn allowed(is_allowed: bool, reason: &str) -> Result<(), Missing> {
    found(is_allowed, reason, false)
}

fn found(is_there: bool, reason: &str, can_be_had: bool) -> Result<(), Missing> {
    let reason = reason.to_owned();
    is_there.then_some(()).ok_or(Missing { reason, can_be_had })
}

/// Chromium and its driver, if both are installed.
#[must_use]
pub fn chromium() -> Option<(String, String)> {
    let browsers = ["chromium", "chromium-browser", "google-chrome"];
    browsers
        .into_iter()
        .find_map(on_path)
        .zip(on_path("chromedriver"))
}

/// The base images for building and for running containers, from `MURMURATION_TEST_BASES`.
#[must_use]
pub fn base_images() -> Option<(String, String)> {
    let [build, runtime, _] = images()?;
    Some((build, runtime))
}

/// The image of a node of a Slurm cluster.
#[must_use]
pub fn slurm_image() -> Option<String> {
    let [_, _, slurm] = images()?;
    Some(slurm)
}

/// The images that `tests/containers/base-images` made.
fn images() -> Option<[String; 3]> {
    let named = env::var("MURMURATION_TEST_BASES").ok()?;
    let names: Vec<_> = named.split_whitespace().map(str::to_owned).collect();
    names.try_into().ok()
}

/// The command `docker compose` or, if the machine lacks it, `docker-compose`.
#[must_use]
pub fn compose() -> Option<Command> {
    if succeeds("docker", &["compose", "version"]) {
        let mut docker = Command::new("docker");
        docker.arg("compose");
        return Some(docker);
    }
    on_path("docker-compose").map(Command::new)
}

fn on_path(name: &str) -> Option<String> {
    let folders = env::var_os("PATH")?;
    env::split_paths(&folders)
        .map(|folder| folder.join(name))
        .find(|path| path.is_file())
        .map(|path| path.display().to_string())
}

/// Whether a network namespace with random packet loss can be made.
fn loses_packets() -> bool {
    let name = format!("murmuration-try-{}", std::process::id());
    if !succeeds("ip", &["netns", "add", &name]) {
        return false;
    }
    let drops = "iptables -A INPUT -m statistic --mode random --probability 0.05 -j DROP";
    let inside = ["netns", "exec", &name].into_iter().chain(drops.split(' '));
    let loses = succeeds("ip", &inside.collect::<Vec<_>>());
    succeeds("ip", &["netns", "del", &name]) && loses
}

fn succeeds(program: &str, arguments: &[&str]) -> bool {
    let status = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    status.is_ok_and(|status| status.success())
}
