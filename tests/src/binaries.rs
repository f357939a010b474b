//! The real binaries, in real processes.

use crate::{FaultyLibc, binary, small_spec};
use serde_json::Value;
use std::{
    ffi::OsString,
    io::{BufRead as _, BufReader, Read as _},
    path::{Path, PathBuf},
    process::{Child, ChildStderr, Command, Stdio},
    time::{Duration, Instant},
};

/// A `murmuration` command line over one data directory.
#[derive(Debug, Clone)]
pub struct Murmuration {
    data: PathBuf,
    /// What its processes have in their environment besides.
    environment: Vec<(&'static str, OsString)>,
}

/// A command that has ended.
#[derive(Debug)]
pub struct Finished {
    /// Exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    /// What it printed as data.
    pub stdout: String,
    /// What it said to people.
    pub stderr: String,
}

/// A command that runs; killed with SIGKILL when dropped.
#[derive(Debug)]
pub struct Running {
    child: Child,
    /// What it says, where that is captured.
    stderr: Option<BufReader<ChildStderr>>,
}

impl Finished {
    /// What it printed as JSON, a value a line. It must have succeeded.
    #[must_use]
    #[track_caller]
    pub fn lines(&self) -> Vec<Value> {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        let lines = self.stdout.lines();
        lines.map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The last of its [`Finished::lines`].
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

    /// Starts a coordinator at `listen`, an address whose port may be 0, with further arguments of `serve`; its URL.
    #[must_use]
    pub fn serve(&self, listen: &str, more: &[&str]) -> (Running, String) {
        let mut coordinator = self.start(&[&["serve", "--listen", listen], more].concat());
        let said = coordinator.wait_for("serving");
        let url = said.rsplit(' ').next().unwrap().to_owned();
        (coordinator, url)
    }

    /// The same commands, subject to faults.
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

    /// The newest campaign as soon as it `is` as wished. Panics after a minute.
    #[track_caller]
    pub fn latest_when(&self, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let shown = self.run(&["show", "latest", "--json"]);
            // Until its coordinator listens there may be none.
            let latest = (shown.code == Some(0)).then(|| shown.last_line());
            if let Some(latest) = latest.as_ref().filter(|latest| is(latest)) {
                return latest.clone();
            }
            assert!(
                begun.elapsed() < Duration::from_secs(60),
                "{latest:?} {}",
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

    /// Runs a command to its end.
    #[must_use]
    pub fn run(&self, arguments: &[&str]) -> Finished {
        let output = self.command(arguments).output().unwrap();
        Finished {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Starts a command, its stderr captured.
    #[must_use]
    pub fn start(&self, arguments: &[&str]) -> Running {
        self.start_with(arguments, &[])
    }

    /// As [`Murmuration::start`], with these variables in its environment.
    #[must_use]
    pub fn start_with(&self, arguments: &[&str], variables: &[(&str, &str)]) -> Running {
        let mut command = self.command(arguments);
        command.envs(variables.iter().copied());
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        Running::spawn(command)
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

impl Running {
    /// Starts a worker process of one thread for the coordinator at `url`.
    #[must_use]
    pub fn worker(url: &str) -> Self {
        let cache = std::env::temp_dir().join("murmuration-tests-cache");
        let mut command = Command::new(binary("murmuration-worker"));
        command.args(["--threads", "1"]).arg("--cache").arg(cache);
        Self::helper(command, url)
    }

    /// As [`Running::worker`], with these variables in its environment.
    #[must_use]
    pub fn worker_with(url: &str, variables: &[(&str, &str)]) -> Self {
        let mut command = Command::new(binary("murmuration-worker"));
        command.args(["--threads", "1"]).envs(variables.iter().copied());
        Self::helper(command, url)
    }

    /// Starts a trainer process for the coordinator at `url`.
    #[must_use]
    pub fn trainer(url: &str) -> Self {
        Self::helper(Command::new(binary("murmuration-trainer")), url)
    }

    fn helper(mut command: Command, url: &str) -> Self {
        command
            .args(["--coordinator", url])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        Self::spawn(command)
    }

    fn spawn(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let stderr = child.stderr.take().map(BufReader::new);
        Self { child, stderr }
    }

    /// Reads its stderr until a line that contains `sign`; that line.
    pub fn wait_for(&mut self, sign: &str) -> String {
        let stderr = self.stderr.as_mut().expect("started with its stderr captured");
        let mut said = String::new();
        for line in stderr.lines() {
            let line = line.unwrap();
            if line.contains(sign) {
                return line;
            }
            said += &line;
            said.push('\n');
        }
        panic!("it ended without saying {sign:?}:\n{said}");
    }

    /// Waits until it ends by itself; its exit code.
    pub fn wait(self) -> Option<i32> {
        self.exit().0
    }

    /// SIGKILL, and waits until it is dead. Panics if it had ended by itself: then the fault did not fire.
    pub fn kill(mut self) {
        assert_eq!(
            self.child.try_wait().unwrap(),
            None,
            "it had ended before it was killed"
        );
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGTERM, and waits for its exit code.
    pub fn terminate(self) -> Option<i32> {
        self.terminate_and_hear().0
    }

    /// SIGTERM, and waits for its exit code; and what it said that nobody has waited for.
    pub fn terminate_and_hear(self) -> (Option<i32>, String) {
        let signalled = Command::new("kill")
            .arg(self.child.id().to_string())
            .status()
            .unwrap();
        assert!(signalled.success());
        self.exit()
    }

    fn exit(mut self) -> (Option<i32>, String) {
        let mut rest = String::new();
        if let Some(stderr) = self.stderr.as_mut() {
            stderr.read_to_string(&mut rest).unwrap();
        }
        (self.child.wait().unwrap().code(), rest)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
