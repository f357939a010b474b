//! Damaged data directories: detected at the start, examined, salvaged.

use crate::data_directory::{generations, undisturbed};
use murmuration_tests::{Murmuration, small_spec};
use std::{fs, path::Path};

const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");

/// A data directory with a completed campaign, the file of which is left beside.
fn completed(folder: &Path) -> Murmuration {
    let spec = folder.join("small.toml");
    fs::write(&spec, small_spec("").to_toml()).unwrap();
    let murmuration = Murmuration::over(&folder.join("data"));
    let run = murmuration.run(&["run", &spec.display().to_string()]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    murmuration
}

/// The error that a damaged database causes.
#[track_caller]
fn check_named(murmuration: &Murmuration, file: &str) {
    let list = murmuration.run(&["list"]);
    assert_eq!(list.code, Some(1));
    let named = list.stderr.contains(file) && list.stderr.contains("`murmuration doctor`");
    assert!(named, "{}", list.stderr);
}

pub fn what_is_whole_of_a_damaged_archive_is_saved_and_the_rest_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = completed(folder.path());
    let digest = murmuration.digest();
    let healthy = murmuration.run(&["doctor"]);
    assert_eq!(healthy.code, Some(0), "{}", healthy.stderr);
    assert!(
        healthy.stdout.contains("campaign small-1 (completed): undamaged"),
        "{}",
        healthy.stdout
    );

    let database = folder.path().join("data/murmuration.sqlite");
    let sound = fs::read(&database).unwrap();
    let mut generations_saved = Vec::new();
    // Behind the pages of the schema, without which nothing can be read.
    for part in [4, 5, 7, 9] {
        let mut torn = sound.clone();
        let from = sound.len() * part / 10 / 4096 * 4096;
        torn[from..from + 4096].fill(0xa5);
        fs::write(&database, &torn).unwrap();
        check_named(&murmuration, "murmuration.sqlite");
        let examined = murmuration.run(&["doctor"]);
        assert_eq!(examined.code, Some(1), "{}", examined.stdout);
        assert!(
            examined.stderr.contains("doctor --salvage"),
            "{}",
            examined.stderr
        );
        assert_eq!(fs::read(&database).unwrap(), torn, "examining changed something");

        let saved = folder.path().join(format!("saved-{part}"));
        let salvaged = murmuration.run(&["doctor", "--json", "--salvage", &saved.display().to_string()]);
        assert!(
            salvaged
                .stderr
                .contains("salvaged 1 of 1 campaign and 0 of 0 checkpoints"),
            "{}",
            salvaged.stderr
        );
        generations_saved.push(
            salvaged.last_line()["campaigns"][0]["whole"]["generations"]
                .as_u64()
                .unwrap(),
        );
        let saved = Murmuration::over(&saved);
        assert_eq!(saved.run(&["doctor"]).code, Some(0));
        assert_eq!(Some(&generations(&saved.latest())), generations_saved.last());
        if saved.latest()["state"] != "completed" {
            let resumed = saved.run(&["resume", "latest"]);
            assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
        }
        assert_eq!(saved.digest(), digest);
    }
    assert!(
        generations_saved.iter().any(|&saved| saved > 0),
        "{generations_saved:?}"
    );
}

pub fn a_salvage_that_can_save_nothing_says_so_and_fails() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = completed(folder.path());
    let database = folder.path().join("data/murmuration.sqlite");
    let mut torn = fs::read(&database).unwrap();
    // The pages of the table of campaigns: no other names them.
    let named = |page: &&mut [u8]| page.windows(7).any(|bytes| bytes == b"small-1");
    let pages = torn.chunks_exact_mut(4096).filter(named);
    assert!(pages.map(|page| page.fill(0xa5)).count() > 0);
    fs::write(&database, &torn).unwrap();

    let saved = folder.path().join("saved");
    let salvaged = murmuration.run(&["doctor", "--salvage", &saved.display().to_string()]);
    assert_eq!(salvaged.code, Some(1), "{}{}", salvaged.stdout, salvaged.stderr);
    assert!(
        salvaged.stderr.contains("nothing of") && salvaged.stderr.contains("could be salvaged"),
        "{}",
        salvaged.stderr
    );
    assert!(!saved.exists());
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
    let digest = imported["checkpoint"].as_str().unwrap();
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
    // What was in the log of the one that was killed is seen, and stays there.
    let log = folder.path().join("data/murmuration.sqlite-wal");
    let before = fs::read(&log).unwrap();
    assert!(!before.is_empty());
    let examined = murmuration.run(&["doctor"]);
    assert_eq!(examined.code, Some(0), "{} {}", examined.stdout, examined.stderr);
    assert_eq!(fs::read(&log).unwrap(), before);
}
