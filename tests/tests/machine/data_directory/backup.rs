//! Tests backups of a running coordinator, and restoring them.

use crate::data_directory::{generations, undisturbed};
use murmuration_model::study_records::StudyRecordKind;
use murmuration_store::Store;
use murmuration_tests::Murmuration;
use std::{fs, os::unix::fs::symlink, path::Path};

/// An embedder's ONNX file.
pub const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/small.onnx");

pub fn a_backup_of_a_running_campaign_goes_on_to_the_same_digest() {
    let folder = tempfile::tempdir().unwrap();
    let (spec, digest) = undisturbed(folder.path());
    let at_work = Murmuration::over(&folder.path().join("at-work"));
    assert_eq!(at_work.run(&["checkpoints", "import", MODEL]).code, Some(0));
    // Only this file stores the classes that people gave on the page of a study. An earlier version of the program made such a
    // folder.
    let study = folder.path().join("at-work/studies/small");
    let classes = "cell,index,class,by\nabc,3,milling,ann\n";
    fs::create_dir_all(&study).unwrap();
    fs::write(study.join("study.toml"), "name = \"small\"").unwrap();
    fs::write(study.join("classes.csv"), classes).unwrap();
    let mut run = at_work.start(&["run", &spec, "--workers", "1"]);
    // Before the run owns the data directory, another command could take the directory.
    run.wait_for("generation");
    at_work.latest_when(|latest| generations(latest) > 2);
    let path = folder.path().join("backup");
    let backup = path.display().to_string();
    let made = at_work.run(&["backup", &backup, "--json"]).last_line();
    assert_eq!(made["checkpoints"].as_array().unwrap().len(), 1);
    run.kill();
    let again = at_work.run(&["backup", &backup]);
    assert_eq!(again.code, Some(2));
    assert!(again.stderr.contains("is not empty"), "{}", again.stderr);

    // The backup is a data directory, so the doctor can examine it.
    let examined = Murmuration::over(&path).run(&["doctor", "--json"]).last_line();
    assert_eq!(
        (&examined["healthy"], &examined["campaigns"][0]["condition"]),
        (&true.into(), &"whole".into())
    );

    let restored = Murmuration::over(&folder.path().join("restored"));
    let put_back = restored.run(&["restore", &backup]);
    assert_eq!(put_back.code, Some(0), "{}", put_back.stderr);
    assert_eq!(restored.run(&["checkpoints", "list", "--json"]).lines().len(), 1);
    let (store, _) = Store::look(&folder.path().join("restored"), true).unwrap();
    let put_back = store.study_content("small", StudyRecordKind::Classes, "");
    assert_eq!(put_back.unwrap().unwrap(), classes.as_bytes());
    drop(store);
    let done = generations(&restored.latest());
    assert!((2..240).contains(&done), "{done} generations");
    let resumed = restored.run(&["resume", "latest"]);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    assert_eq!(restored.digest(), digest);
    // A restore never overwrites anything.
    assert_eq!(restored.run(&["restore", &backup]).code, Some(2));

    let database = path.join("murmuration.sqlite");
    let mut bytes = fs::read(&database).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&database, bytes).unwrap();
    let elsewhere = folder.path().join("elsewhere");
    let refused = Murmuration::over(&elsewhere).run(&["restore", &backup]);
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("is damaged"), "{}", refused.stderr);
    assert!(!elsewhere.exists());
}

pub fn a_backup_makes_the_folders_above_it() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    assert_eq!(murmuration.run(&["checkpoints", "import", MODEL]).code, Some(0));
    let backup = folder.path().join("backups/of/monday").display().to_string();
    let made = murmuration.run(&["backup", &backup]);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let restored = Murmuration::over(&folder.path().join("data/of/tuesday"));
    let put_back = restored.run(&["restore", &backup]);
    assert_eq!(put_back.code, Some(0), "{}", put_back.stderr);
}

pub fn what_is_no_backup_is_not_put_back() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::over(&folder.path().join("data"));
    let refused = murmuration.run(&["restore", &folder.path().display().to_string()]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.stderr.contains("is not a backup"), "{}", refused.stderr);
    let nothing = murmuration.run(&[
        "backup",
        &folder.path().join("backups/monday").display().to_string(),
    ]);
    assert_eq!(nothing.code, Some(2));
    assert!(
        nothing.stderr.contains("there is no data directory"),
        "{}",
        nothing.stderr
    );
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

pub fn a_backup_is_refused_where_it_cannot_be_kept() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let murmuration = Murmuration::over(&data);
    assert_eq!(murmuration.run(&["checkpoints", "import", MODEL]).code, Some(0));
    let [unmounted, lost, link, empty, within] =
        ["unmounted", "lost", "link", "empty", "within"].map(|name| folder.path().join(name));
    symlink(&unmounted, &lost).unwrap();
    symlink(&data, &within).unwrap();
    fs::create_dir(&empty).unwrap();
    symlink(&empty, &link).unwrap();
    let inside = "is in the data directory";
    for (target, code, expected) in [
        (Path::new("/dev/null/x"), 1, "Not a directory"),
        (&lost, 1, "unmounted, which does not exist"),
        (&data.join("backups/monday"), 2, inside),
        (&within.join("monday"), 2, inside),
    ] {
        let target = target.display().to_string();
        let refused = murmuration.run(&["backup", &target]);
        assert!(
            refused.code == Some(code)
                && refused.stderr.contains(&target)
                && refused.stderr.contains(expected),
            "{target}: {:?} {}",
            refused.code,
            refused.stderr
        );
    }
    assert!(!unmounted.exists() && !data.join("backups").exists() && !data.join("monday").exists());
    // A link to an empty folder counts as that folder.
    let made = murmuration.run(&["backup", &link.display().to_string()]);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    assert!(empty.join("murmuration.sqlite").exists());
}
