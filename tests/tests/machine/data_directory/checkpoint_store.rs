//! Tests checkpoints that are stored outside the data directory. The program checks the location at its start, and the location
//! has every acknowledged checkpoint.

use crate::data_directory::bucket::Bucket;
use murmuration_tests::{FaultyLibc, Murmuration, small_spec};
use std::{fs, path::Path};

const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");
const BUCKET: &str = "s3://behaviours/checkpoints";

fn spec(folder: &Path) -> String {
    let path = folder.join("small.toml");
    fs::write(&path, small_spec("").to_toml()).unwrap();
    path.display().to_string()
}

pub fn a_bucket_that_takes_nothing_is_named_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let bucket = Bucket::new(false);
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let command = ["run", &spec(folder.path()), "--checkpoint-store", BUCKET];
    let message = murmuration
        .start_with(&command, &bucket.environment())
        .wait_for("cannot be kept");
    assert!(
        message.contains(BUCKET) && message.contains("--checkpoint-store"),
        "{message}"
    );
    assert_eq!(murmuration.run(&["list", "--json"]).stdout, "");
}

pub fn a_bucket_is_tried_out_and_left_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let bucket = Bucket::new(true);
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let command = ["run", &spec(folder.path()), "--checkpoint-store", BUCKET];
    let run = murmuration.start_with(&command, &bucket.environment());
    assert_eq!(run.wait(), Some(0));
    assert_eq!(bucket.seen(), (1, 0));
}

pub fn a_folder_that_cannot_be_made_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let url = format!("file://{}/checkpoints", spec(folder.path()));
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let run = murmuration.run(&["run", &spec(folder.path()), "--checkpoint-store", &url]);
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.contains(&url), "{}", run.stderr);
}

pub fn a_checkpoint_in_a_folder_elsewhere_is_acknowledged_once_it_is_on_disk() {
    let folder = tempfile::tempdir().unwrap();
    let elsewhere = folder.path().join("elsewhere");
    let url = format!("file://{}", elsewhere.display());
    let sound = Murmuration::with_campaign(folder.path());
    let faults = FaultyLibc::new(folder.path());
    let failing = sound.clone().under(&faults);
    fs::create_dir(&elsewhere).unwrap();
    let import = ["checkpoints", "import", MODEL, "--checkpoint-store", &url];

    faults.fail_syncs(true);
    let refused = failing.run(&import);
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    // A file with the final name would look like a whole checkpoint.
    assert_eq!(fs::read_dir(&elsewhere).unwrap().count(), 0);

    faults.fail_syncs(false);
    let kept = failing.run(&import);
    assert_eq!(kept.code, Some(0), "{}", kept.stderr);
    assert_eq!(fs::read_dir(&elsewhere).unwrap().count(), 1);
    let doctor = sound.run(&["doctor", "--checkpoint-store", &url]);
    assert_eq!(doctor.code, Some(0), "{}", doctor.stderr);
}
