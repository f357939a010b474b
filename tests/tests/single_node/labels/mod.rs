//! Tests of labels. The coordinator keeps acknowledged labels, and stores a label once even if it is sent again. No two people
//! get the same query.

mod annotator;
mod counts;
mod durability;
mod files;
mod service;

use murmuration_tests::Murmuration;
use tempfile::TempDir;

/// A data directory with a completed campaign of 100 individuals, and the folder that contains it.
fn campaign() -> (TempDir, Murmuration) {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    (folder, murmuration)
}
