//! What people say about behaviours: kept once it is acknowledged, said once however often it is sent, asked once
//! whoever asks.

mod annotator;
mod counts;
mod durability;
mod files;
mod service;

use murmuration_tests::Murmuration;
use tempfile::TempDir;

/// A data directory with a completed campaign of 100 individuals, and a folder beside it.
fn campaign() -> (TempDir, Murmuration) {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    (folder, murmuration)
}
