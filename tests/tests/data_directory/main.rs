//! What is on disk, when the disk is not what it should be: full, failing, damaged; copied, examined, put back.

mod backup;
mod disk;
mod doctor;
mod mount;

use murmuration_tests::{Murmuration, longer_spec};
use serde_json::Value;
use std::path::Path;

/// The file of a campaign of some seconds, and the digest that it ends with.
fn undisturbed(folder: &Path) -> (String, String) {
    let spec = longer_spec(folder);
    let murmuration = Murmuration::over(&folder.join("undisturbed"));
    let run = murmuration.run(&["run", &spec]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    (spec, murmuration.digest())
}

fn generations(campaign: &Value) -> u64 {
    campaign["generations_done"].as_u64().unwrap()
}

fn waits_for(campaign: &Value, what: &str) -> bool {
    campaign["waiting"].as_str().unwrap().contains(what)
}
