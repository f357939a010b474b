//! One of the programs in a process of its own: what it says, and how it ends.

use std::{
    fs,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};
use tempfile::NamedTempFile;

/// Longer than anything takes that works, on a machine that is busy.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A program that runs. What it says on standard error goes into a file, so that it never waits for a reader. It is killed
/// with SIGKILL when this is dropped.
#[derive(Debug)]
pub struct Running {
    child: Child,
    log: NamedTempFile,
    /// So many bytes of the log have been waited for.
    heard: usize,
}

impl Running {
    /// Starts a program.
    #[must_use]
    #[track_caller]
    pub fn start(mut command: Command) -> Self {
        let log = NamedTempFile::new().unwrap();
        let child = command
            .env("RUST_BACKTRACE", "0")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log.reopen().unwrap())
            .spawn()
            .unwrap_or_else(|error| panic!("{command:?}: {error}"));
        Self { child, log, heard: 0 }
    }

    /// Its process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Everything that it has said.
    #[must_use]
    pub fn output(&self) -> String {
        fs::read_to_string(self.log.path()).unwrap()
    }

    /// Waits for a line that contains `sign`, after the line that was waited for before; that line.
    #[track_caller]
    pub fn wait_for(&mut self, sign: &str) -> String {
        self.wait_for_line(sign, |line| line.contains(sign))
    }

    /// Waits until a coordinator has accepted this worker or trainer: a fault that strikes earlier strikes nothing.
    #[track_caller]
    pub fn wait_until_joined(&mut self) {
        let joined = |line: &str| line.contains("connected") && !line.contains("not connected");
        self.wait_for_line("connected", joined);
    }

    #[track_caller]
    fn wait_for_line(&mut self, sign: &str, is: impl Fn(&str) -> bool) -> String {
        let begun = Instant::now();
        loop {
            // Before its log is read: what it said last is read, too.
            let ended = self.child.try_wait().unwrap();
            let message = self.output();
            let mut heard = self.heard;
            for line in message[heard..]
                .split_inclusive('\n')
                .filter(|line| line.ends_with('\n'))
            {
                heard += line.len();
                if is(line) {
                    self.heard = heard;
                    return line.trim_end().to_owned();
                }
            }
            assert_eq!(ended, None, "it ended without saying {sign:?}:\n{message}");
            assert!(begun.elapsed() < PATIENCE, "it never said {sign:?}:\n{message}");
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Sends a signal, such as `STOP` or `CONT`.
    pub fn signal(&self, name: &str) {
        let sent = Command::new("kill")
            .args(["-s", name, &self.id().to_string()])
            .status();
        assert!(sent.unwrap().success());
    }

    /// SIGKILL, and waits until it is dead. Panics if it had ended by itself: then the fault did not fire.
    #[track_caller]
    pub fn kill(mut self) {
        let ended = self.child.try_wait().unwrap();
        assert_eq!(ended, None, "it had ended before it was killed:\n{}", self.output());
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGTERM, and waits for its exit code; `None` if a signal ended it.
    pub fn terminate(self) -> Option<i32> {
        self.terminate_and_hear().0
    }

    /// SIGTERM, and waits for its exit code; and everything that it has said.
    pub fn terminate_and_hear(mut self) -> (Option<i32>, String) {
        self.signal("TERM");
        let code = self.child.wait().unwrap().code();
        (code, self.output())
    }

    /// Waits until it ends by itself; its exit code.
    pub fn wait(mut self) -> Option<i32> {
        self.child.wait().unwrap().code()
    }

    /// Processor time that it has used.
    #[must_use]
    pub fn cpu_time(&self) -> Duration {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.id())).unwrap();
        // The name, in parentheses, may hold spaces; utime and stime are fields 14 and 15, in hundredths of a second.
        let (_, fields) = stat.rsplit_once(')').unwrap();
        let ticks = fields.split_whitespace().skip(11).take(2);
        let ticks: u64 = ticks.map(|ticks| ticks.parse::<u64>().unwrap()).sum();
        Duration::from_millis(10 * ticks)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
