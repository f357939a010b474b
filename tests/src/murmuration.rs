//! Runs the command-line program over a data directory, and worker and trainer programs.

use crate::{FaultyLibc, Running, binary, small_spec};
use serde_json::Value;
use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

/// A `murmuration` command line over one data directory.
#[derive(Debug, Clone)]
pub struct Murmuration {
    data: PathBuf,
    /// Additional environment variables of the command line's processes.
    environment: Vec<(&'static str, OsString)>,
}

/// A command that has ended.
#[derive(Debug)]
pub struct Finished {
    /// Exit code; `None` if a signal ended the command.
    pub code: Option<i32>,
    /// Data, on standard output.
    pub stdout: String,
    /// Messages, on standard error.
    pub stderr: String,
}

impl Finished {
    /// The command's output as JSON, one value per line. Panics unless the command succeeded.
    #[must_use]
    #[track_caller]
    pub fn lines(&self) -> Vec<Value> {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        let lines = self.stdout.lines();
        lines.map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    #[must_use]
    #[track_caller]
    pub fn last_line(&self) -> Value {
        self.lines().pop().expect("it printed something")
    }
}

impl Murmuration {
    /// Commands over the data directory `data`.
    #[must_use]
    pub fn over(data: &Path) -> Self {
        Self {
            data: data.to_owned(),
            environment: Vec::new(),
        }
    }

    /// Commands over a data directory in `folder` with a completed campaign, `small-1`, of 100 individuals.
    #[must_use]
    #[track_caller]
    pub fn with_campaign(folder: &Path) -> Self {
        let spec = folder.join("small.toml");
        std::fs::write(&spec, small_spec("").to_toml()).unwrap();
        let murmuration = Self::over(&folder.join("data"));
        let run = murmuration.run(&["run", &spec.display().to_string()]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        murmuration
    }

    /// Starts a coordinator at `listen`, an address whose port can be 0, with `more` arguments of `serve`. Returns the
    /// coordinator's process and URL. Without `--tokens`, the coordinator requires no token.
    #[must_use]
    pub fn serve(&self, listen: &str, more: &[&str]) -> (Running, String) {
        let mut coordinator =
            self.start(&[&["serve", "--insecure-listen", "--listen", listen], more].concat());
        let line = coordinator.wait_for("serving");
        let url = line.rsplit(' ').next().unwrap().to_owned();
        (coordinator, url)
    }

    /// Commands over the same data directory, with faults injected.
    #[must_use]
    pub fn under(mut self, faults: &FaultyLibc) -> Self {
        self.environment.extend(faults.environment());
        self
    }

    /// The newest campaign, as `show --json` prints it.
    #[must_use]
    #[track_caller]
    pub fn latest(&self) -> Value {
        self.run(&["show", "latest", "--json"]).last_line()
    }

    /// The newest campaign, as soon as `is` holds. Panics after ten minutes: busy machines are slow.
    #[track_caller]
    pub fn latest_when(&self, is: impl Fn(&Value) -> bool) -> Value {
        self.campaign_when("latest", is)
    }

    /// A campaign, as soon as `is` holds. Panics after ten minutes: busy machines are slow.
    #[track_caller]
    pub fn campaign_when(&self, id: &str, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let shown = self.run(&["show", id, "--json"]);
            // The campaign may not exist until its coordinator listens.
            let campaign = (shown.code == Some(0)).then(|| shown.last_line());
            if let Some(campaign) = campaign.as_ref().filter(|campaign| is(campaign)) {
                return campaign.clone();
            }
            assert!(
                begun.elapsed() < Duration::from_secs(600),
                "{campaign:?} {}",
                shown.stderr
            );
        }
    }

    /// The digest of the newest campaign.
    #[must_use]
    #[track_caller]
    pub fn digest(&self) -> String {
        let digest = self.run(&["digest", "latest"]);
        assert_eq!(digest.code, Some(0), "{}", digest.stderr);
        digest.stdout
    }

    /// Runs a command and waits for its end.
    #[must_use]
    pub fn run(&self, arguments: &[&str]) -> Finished {
        finished(&mut self.command(arguments))
    }

    /// Runs a command in a folder and waits for its end.
    #[must_use]
    pub fn run_in(&self, folder: &Path, arguments: &[&str]) -> Finished {
        finished(self.command(arguments).current_dir(folder))
    }

    #[must_use]
    pub fn start(&self, arguments: &[&str]) -> Running {
        self.start_with(arguments, &[])
    }

    /// Starts a command as [`Murmuration::start`] does, with additional environment variables.
    #[must_use]
    pub fn start_with(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Running {
        let mut command = self.command(arguments);
        command.envs(variables.iter().copied());
        Running::start(command)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(binary("murmuration"));
        command
            .args(arguments)
            .env("MURMURATION_DATA", &self.data)
            .env("RUST_BACKTRACE", "0")
            .envs(self.environment.iter().map(|(name, value)| (name, value)))
            .stdin(Stdio::null());
        command
    }
}

fn finished(command: &mut Command) -> Finished {
    let output = command.output().unwrap();
    Finished {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// A whole number in a document, such as a seed. A number that a double cannot represent exactly is a string in the document.
#[must_use]
pub fn whole_number(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Starts a worker process of one thread for the coordinator at `url`.
#[must_use]
pub fn start_worker(url: &str) -> Running {
    let cache = std::env::temp_dir().join("murmuration-tests-cache");
    start_worker_with(url, &[("MURMURATION_CACHE", &cache.display().to_string())])
}

/// Starts a worker as [`start_worker`] does, with additional environment variables.
#[must_use]
pub fn start_worker_with(url: &str, variables: &[(&str, &str)]) -> Running {
    let mut command = Command::new(binary("murmuration-worker"));
    command
        .args(["--coordinator", url, "--threads", "1"])
        .envs(variables.iter().copied());
    Running::start(command)
}

/// Starts a trainer process for the coordinator at `url`.
#[must_use]
pub fn start_trainer(url: &str) -> Running {
    let mut command = Command::new(binary("murmuration-trainer"));
    command.args(["--coordinator", url]);
    Running::start(command)
}
