//! One of the programs in its own process: reads the program's output, and ends the program.

use std::{
    fs,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};
use tempfile::NamedTempFile;

/// Longer than any successful operation takes on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A running program. The program's standard error goes into a file, so that the program never waits for a reader. Dropping a
/// `Running` kills its program with SIGKILL.
#[derive(Debug)]
pub struct Running {
    child: Child,
    log: NamedTempFile,
    /// Bytes of the log up to the end of the last line that was waited for.
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

    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// The program's standard error so far.
    #[must_use]
    pub fn output(&self) -> String {
        fs::read_to_string(self.log.path()).unwrap()
    }

    /// Waits for a line that contains `sign`, after the last line that was waited for. Returns the line.
    #[track_caller]
    pub fn wait_for(&mut self, sign: &str) -> String {
        self.wait_for_line(sign, |line| line.contains(sign))
    }

    /// Waits until a coordinator has accepted this worker or trainer. A fault before that would have no effect.
    #[track_caller]
    pub fn wait_until_joined(&mut self) {
        let joined = |line: &str| line.contains("connected") && !line.contains("not connected");
        self.wait_for_line("connected", joined);
    }

    #[track_caller]
    fn wait_for_line(&mut self, sign: &str, is: impl Fn(&str) -> bool) -> String {
        let begun = Instant::now();
        loop {
            // The program's end is checked before the log is read, so that the last lines are read too.
            let ended = self.child.try_wait().unwrap();
            let log = self.output();
            let mut heard = self.heard;
            for line in log[heard..]
                .split_inclusive('\n')
                .filter(|line| line.ends_with('\n'))
            {
                heard += line.len();
                if is(line) {
                    self.heard = heard;
                    return line.trim_end().to_owned();
                }
            }
            assert_eq!(ended, None, "it ended without saying {sign:?}:\n{log}");
            assert!(begun.elapsed() < PATIENCE, "it never said {sign:?}:\n{log}");
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

    /// Sends SIGKILL and waits for the program's end. Panics if the program had already ended, because the fault then had no
    /// effect.
    #[track_caller]
    pub fn kill(mut self) {
        let ended = self.child.try_wait().unwrap();
        assert_eq!(
            ended,
            None,
            "it had ended before it was killed:\n{}",
            self.output()
        );
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Sends SIGTERM and waits for the exit code; `None` if a signal ended the program.
    pub fn terminate(self) -> Option<i32> {
        self.terminate_and_hear().0
    }

    /// Ends the program as [`Running::terminate`] does; returns the standard error too.
    pub fn terminate_and_hear(mut self) -> (Option<i32>, String) {
        self.signal("TERM");
        let code = self.child.wait().unwrap().code();
        (code, self.output())
    }

    /// Waits until the program ends by itself; returns its exit code.
    pub fn wait(self) -> Option<i32> {
        self.wait_and_hear().0
    }

    /// Waits as [`Running::wait`] does; returns the standard error too.
    pub fn wait_and_hear(mut self) -> (Option<i32>, String) {
        let code = self.child.wait().unwrap().code();
        (code, self.output())
    }

    #[must_use]
    pub fn cpu_time(&self) -> Duration {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.id())).unwrap();
        // The program's name, in parentheses, may contain spaces. Fields 14 and 15 are utime and stime, in hundredths of a
        // second.
        let (_, fields) = stat.rsplit_once(')').unwrap();
        let ticks = fields.split_whitespace().skip(11).take(2);
        let ticks: u64 = ticks.map(|ticks| ticks.parse::<u64>().unwrap()).sum();
        Duration::from_millis(10 * ticks)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // The program may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
