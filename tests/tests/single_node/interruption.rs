//! Tests `kill -9` at random moments: a resumed campaign ends with the digest of an undisturbed campaign.

use murmuration_swarm::{Purpose, RandomStream};
use murmuration_tests::{Murmuration, longer_spec};
use rand::RngExt as _;
use serde_json::Value;
use std::{fs, path::Path, thread, time::Duration};

/// The file of a campaign of 400 generations, which is long enough to kill its process five times.
fn longest_spec(folder: &Path) -> String {
    let spec = longer_spec(folder);
    let text = fs::read_to_string(&spec).unwrap();
    fs::write(&spec, text.replace("generations = 240", "generations = 400")).unwrap();
    spec
}

fn generations(campaign: &Value) -> u64 {
    campaign["generations_done"].as_u64().unwrap()
}

#[test]
fn killed_again_and_again_it_ends_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longest_spec(folder.path());
    let undisturbed = Murmuration::over(&folder.path().join("undisturbed"));
    assert_eq!(undisturbed.run(&["run", &spec]).code, Some(0));

    let killed = Murmuration::over(&folder.path().join("killed"));
    let mut dice = RandomStream::derive(1, Purpose::Jitter, 0);
    let mut done = 0;
    let mut command: Vec<&str> = vec!["run", &spec, "--workers", "1"];
    for _ in 0..5 {
        let mut process = killed.start(&command);
        process.wait_for("generation");
        // Each run gets further than the run before, and is killed at a random moment after that.
        killed.latest_when(|latest| generations(latest) > done);
        thread::sleep(Duration::from_millis(dice.random_range(0..150)));
        process.kill();
        command = vec!["resume", "latest", "--workers", "1"];
        let now = generations(&killed.latest());
        assert!(
            (done + 1..400).contains(&now),
            "it was killed at the wrong time: {done} generations before, {now} after"
        );
        done = now;
    }
    assert_eq!(killed.run(&["resume", "latest"]).code, Some(0));
    assert_eq!(killed.digest(), undisturbed.digest());
}

#[test]
fn terminated_politely_it_says_how_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longest_spec(folder.path());
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let mut process = murmuration.start(&["run", &spec]);
    process.wait_for("generation");
    murmuration.latest_when(|latest| generations(latest) > 0);
    let (code, message) = process.terminate_and_hear();
    assert_eq!(code, Some(1), "{message}");
    assert!(
        message.contains("complete generations are kept; next: murmuration resume small-1"),
        "{message}"
    );
    let kept = generations(&murmuration.latest());
    assert!(
        (1..200).contains(&kept),
        "it was terminated after {kept} generations"
    );
    let resumed = murmuration.run(&["resume", "small-1"]);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
}
