//! What people say about behaviours: kept once it is acknowledged, said once however often it is sent, asked once
//! whoever asks.

mod annotator;
mod durability;
mod files;
mod service;

use murmuration_tests::{Murmuration, small_spec};
use std::fs;
use tempfile::TempDir;

/// A data directory with a completed campaign of 100 individuals, and a folder beside it.
fn campaign() -> (TempDir, Murmuration) {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("small.toml");
    fs::write(&spec, small_spec("").to_toml()).unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let run = murmuration.run(&["run", &spec.display().to_string()]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    (folder, murmuration)
}
