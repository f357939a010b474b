//! Tests damaged data directories: commands must detect the damage, and the doctor must examine it.

use crate::data_directory::{generations, undisturbed};
use murmuration_tests::{Murmuration, small_spec};
use serde_json::Value;
use std::{fs, path::Path};

const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");

/// A data directory with a completed campaign, and the campaign's file beside it.
fn completed(folder: &Path) -> Murmuration {
    let spec = folder.join("small.toml");
    fs::write(&spec, small_spec("").to_toml()).unwrap();
    let murmuration = Murmuration::over(&folder.join("data"));
    let run = murmuration.run(&["run", &spec.display().to_string()]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    murmuration
}

/// Checks the error for a damaged database.
#[track_caller]
fn check_named(murmuration: &Murmuration, file: &str) {
    let list = murmuration.run(&["list"]);
    assert_eq!(list.code, Some(1));
    let named = list.stderr.contains(file) && list.stderr.contains("`murmuration doctor`");
    assert!(named, "{}", list.stderr);
}

pub fn a_damaged_archive_is_named_and_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = completed(folder.path());
    let healthy = murmuration.run(&["doctor"]);
    assert_eq!(healthy.code, Some(0), "{}", healthy.stderr);
    assert!(
        healthy.stdout.contains("campaign small-1 (completed): undamaged"),
        "{}",
        healthy.stdout
    );

    let database = folder.path().join("data/murmuration.sqlite");
    let sound = fs::read(&database).unwrap();
    let mut generations_whole = Vec::new();
    // The test damages pages that come after the pages of the schema, because nothing can be read without a schema.
    for part in [4, 5, 7, 9] {
        let mut torn = sound.clone();
        let from = sound.len() * part / 10 / 4096 * 4096;
        torn[from..from + 4096].fill(0xa5);
        fs::write(&database, &torn).unwrap();
        check_named(&murmuration, "murmuration.sqlite");
        let examined = murmuration.run(&["doctor", "--json"]);
        assert_eq!(examined.code, Some(1), "{}", examined.stdout);
        assert!(
            examined.stderr.contains("`murmuration restore"),
            "{}",
            examined.stderr
        );
        assert_eq!(fs::read(&database).unwrap(), torn, "examining changed something");
        let examined: Value = serde_json::from_str(&examined.stdout).unwrap();
        // The doctor cannot list a campaign whose own row is damaged.
        let whole = &examined["campaigns"][0]["whole"]["generations"];
        generations_whole.push(whole.as_u64().unwrap_or(0));
    }
    assert!(
        generations_whole.iter().any(|&whole| whole > 0),
        "{generations_whole:?}"
    );
}

pub fn a_database_that_was_cut_off_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = completed(folder.path());
    let database = folder.path().join("data/murmuration.sqlite");
    let length = database.metadata().unwrap().len();
    for rest in [length / 2, 100, 0] {
        fs::File::options()
            .write(true)
            .open(&database)
            .unwrap()
            .set_len(rest)
            .unwrap();
        check_named(&murmuration, "murmuration.sqlite");
        assert_eq!(murmuration.run(&["doctor"]).code, Some(1));
    }
}

pub fn a_checkpoint_that_is_torn_is_named_and_one_that_is_gone_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let imported = murmuration
        .run(&["checkpoints", "import", MODEL, "--json"])
        .last_line();
    let digest = imported["digest"].as_str().unwrap();
    let file = folder.path().join(format!("data/checkpoints/{digest}.onnx"));
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    check_named(&murmuration, digest);
    let examined = murmuration.run(&["doctor"]);
    assert!(
        examined.stdout.contains(&format!("checkpoint {digest}: damaged")),
        "{}",
        examined.stdout
    );
    fs::remove_file(&file).unwrap();
    let examined = murmuration.run(&["doctor", "--json"]);
    assert_eq!(examined.code, Some(1));
    assert!(
        examined.stdout.contains("\"condition\":\"missing\""),
        "{}",
        examined.stdout
    );
    assert_eq!(murmuration.run(&["checkpoints", "import", MODEL]).code, Some(0));
    assert_eq!(murmuration.run(&["doctor"]).code, Some(0));
}

pub fn a_data_directory_in_use_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (spec, _) = undisturbed(folder.path());
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let run = murmuration.start(&["run", &spec, "--workers", "1"]);
    murmuration.latest_when(|latest| generations(latest) > 0);
    let examined = murmuration.run(&["doctor"]);
    assert_eq!(examined.code, Some(1));
    assert!(
        examined.stderr.contains("is in use by process"),
        "{}",
        examined.stderr
    );
    run.kill();
    // The doctor reads the log that the killed process left, and does not change it.
    let log = folder.path().join("data/murmuration.sqlite-wal");
    let before = fs::read(&log).unwrap();
    assert!(!before.is_empty());
    let examined = murmuration.run(&["doctor"]);
    assert_eq!(examined.code, Some(0), "{} {}", examined.stdout, examined.stderr);
    assert_eq!(fs::read(&log).unwrap(), before);
}
