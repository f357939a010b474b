//! A peer: another implementation in a Python process, which runs one round per input line.

use super::CliError;
use std::{
    io::{self, BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

/// A peer that is ready for rounds.
pub(super) struct Peer {
    name: &'static str,
    process: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Peer {
    /// Runs the text of a script with an argument, and sends the script a line. Returns `None` if Python or the package is
    /// missing.
    pub(super) fn start(
        python: &str,
        package: &'static str,
        script: &str,
        argument: &str,
        line: &str,
    ) -> Option<Self> {
        let mut process = Command::new(python)
            .args(["-c", script, argument])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let (to, from) = (process.stdin.take()?, BufReader::new(process.stdout.take()?));
        let mut peer = Self {
            name: package,
            process,
            to,
            from,
        };
        if !line.is_empty() {
            writeln!(peer.to, "{line}").ok()?;
        }
        // The script's first output line reports readiness; a script that fails ends without output.
        peer.line().ok()?;
        Some(peer)
    }

    /// Runs a round. Returns the output of the script.
    pub(super) fn round(&mut self) -> Result<String, CliError> {
        let answer = writeln!(self.to).and_then(|()| self.line());
        answer.map_err(|error| self.failed(&error.to_string()))
    }

    /// The error for an unusable answer.
    pub(super) fn failed(&self, why: &str) -> CliError {
        CliError::Failed(format!("{} ended or answered something else: {why}", self.name))
    }

    fn line(&mut self) -> io::Result<String> {
        let mut line = String::new();
        match self.from.read_line(&mut line)? {
            0 => Err(io::ErrorKind::UnexpectedEof.into()),
            _ => Ok(line.trim().to_owned()),
        }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
