//! `kill -9` at any instant: resumed, a campaign ends with the digest of an undisturbed one.

use murmuration_proto::{Purpose, Stream};
use murmuration_tests::{Murmuration, longer_spec};
use std::{thread, time::Duration};

#[test]
fn killed_again_and_again_it_ends_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longer_spec(folder.path());
    let undisturbed = Murmuration::over(&folder.path().join("undisturbed"));
    assert_eq!(undisturbed.run(&["run", &spec]).code, Some(0));

    let killed = Murmuration::over(&folder.path().join("killed"));
    let mut dice = Stream::derive(1, Purpose::Jitter, 0);
    let mut kills = 0;
    let mut command: Vec<&str> = vec!["run", &spec, "--workers", "1"];
    while kills < 5 {
        let mut process = killed.start(&command);
        process.wait_for("generation");
        thread::sleep(Duration::from_millis(30 + dice.below(150)));
        process.kill();
        kills += 1;
        command = vec!["resume", "latest", "--workers", "1"];
        assert!(
            killed.latest()["generations_done"].as_u64().unwrap() < 60,
            "it was killed too late to be interrupted"
        );
    }
    assert_eq!(killed.run(&["resume", "latest"]).code, Some(0));
    assert_eq!(killed.digest(), undisturbed.digest());
}

#[test]
fn terminated_politely_it_says_how_to_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longer_spec(folder.path());
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let mut process = murmuration.start(&["run", &spec]);
    process.wait_for("generation");
    assert_eq!(process.terminate(), Some(1));
    let resumed = murmuration.run(&["resume", "small-1"]);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
}
