//! Tests of the command line: exit codes, messages, JSON.

mod campaigns;
mod commands;
mod errors;
mod output;
mod serving;
mod together;

use murmuration_tests::{Finished, Murmuration, small_spec};
use std::fs;
use tempfile::TempDir;

/// A folder with a campaign file and a data directory.
struct Desk {
    folder: TempDir,
    murmuration: Murmuration,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let murmuration = Murmuration::over(&folder.path().join("data"));
        fs::write(folder.path().join("small.toml"), small_spec("").to_toml()).unwrap();
        Self { folder, murmuration }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.folder.path().join(name), text).unwrap();
        self.path(name)
    }

    #[track_caller]
    fn check(&self, arguments: &[&str], code: i32, expected: &str) {
        let Finished {
            code: got, stderr, ..
        } = self.murmuration.run(arguments);
        assert!(
            got == Some(code) && stderr.contains(expected),
            "{arguments:?}: exit code {got:?}\n{stderr}\nnot {expected:?}"
        );
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
}
