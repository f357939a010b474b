//! Tests disks that are full, read-only or failing: campaigns must wait, and no acknowledged change may be lost.

use crate::data_directory::{backup::MODEL, generations, undisturbed, waits_for};
use murmuration_tests::{FaultyLibc, Murmuration, SmallDisk, longer_spec, small_spec};
use std::{fs, path::Path, thread, time::Duration};

/// A file with a label of individual 0.
fn label(folder: &Path, name: &str, class: &str) -> String {
    let path = folder.join(name);
    fs::write(&path, format!("index,class,annotator,time\n0,{class},ana,\n")).unwrap();
    path.display().to_string()
}

fn labels(murmuration: &Murmuration) -> Vec<String> {
    let lines = murmuration.run(&["labels", "latest", "--json"]).lines();
    let class = |label: &serde_json::Value| label["answer"]["answer"].as_str().unwrap().to_owned();
    lines.iter().map(class).collect()
}

pub fn on_a_full_disk_a_campaign_waits_for_room() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("small-disk");
    let disk = SmallDisk::new(&data, "24m");
    let (spec, digest) = undisturbed(folder.path());
    let murmuration = Murmuration::over(&data);
    let run = murmuration.start(&["run", &spec, "--workers", "1"]);
    murmuration.latest_when(|latest| generations(latest) > 0);
    let filler = disk.fill();
    let waiting = murmuration.latest_when(|latest| waits_for(latest, "is full"));
    assert_eq!(
        (&waiting["state"], &waiting["active"]),
        (&"running".into(), &true.into())
    );
    assert!(generations(&waiting) < 240);
    assert!(murmuration.run(&["list"]).stdout.contains("waiting"));
    // The part of the log that is already on the disk may have room for some labels. Acknowledged labels must be stored; refused
    // labels must not.
    let mut acknowledged = Vec::new();
    let refused = (0..100).find_map(|class| {
        let class = format!("class {class}");
        let file = label(folder.path(), "label.csv", &class);
        let message = murmuration.run(&["label", "latest", "--csv", &file]);
        if message.code == Some(0) {
            acknowledged = vec![class];
            return None;
        }
        Some(message.stderr)
    });
    let refused = refused.expect("there was room for every label");
    assert!(refused.contains("is full: make room"), "{refused}");
    assert_eq!(labels(&murmuration), acknowledged);

    fs::remove_file(filler).unwrap();
    assert_eq!(run.wait(), Some(0));
    assert_eq!(murmuration.digest(), digest);
    assert_eq!(labels(&murmuration), acknowledged);
}

pub fn what_a_failing_disk_has_not_confirmed_is_not_acknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let (spec, digest) = undisturbed(folder.path());
    let faults = FaultyLibc::new(folder.path());
    let murmuration = Murmuration::over(&folder.path().join("failing")).under(&faults);
    let run = murmuration.start(&["run", &spec, "--workers", "1"]);
    murmuration.latest_when(|latest| generations(latest) > 0);
    faults.fail_syncs(true);
    let waiting = murmuration.latest_when(|latest| waits_for(latest, "cannot be written"));
    let file = label(folder.path(), "label.csv", "ring");
    let refused = murmuration.run(&["label", "latest", "--csv", &file]);
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("cannot be written"), "{}", refused.stderr);
    // The campaign has made no progress while syncs fail.
    let still = murmuration.latest();
    assert_eq!(generations(&still), generations(&waiting));

    faults.fail_syncs(false);
    murmuration.latest_when(|latest| generations(latest) > generations(&waiting));
    assert_eq!(labels(&murmuration), [""; 0]);
    faults.fail_syncs(true);
    murmuration.latest_when(|latest| waits_for(latest, "cannot be written"));
    run.kill();

    faults.fail_syncs(false);
    let resumed = murmuration.run(&["resume", "latest"]);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    assert_eq!(murmuration.digest(), digest);
}

pub fn a_read_only_disk_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longer_spec(folder.path());
    let data = folder.path().join("read-only");
    let disk = SmallDisk::new(&data, "2m");
    disk.make_read_only();
    let run = Murmuration::over(&data).run(&["run", &spec]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let named =
        run.stderr.to_lowercase().contains("read-only") && run.stderr.contains(&data.display().to_string());
    assert!(named && !run.stderr.contains("panicked"), "{}", run.stderr);
}

pub fn a_read_only_disk_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("snapshot");
    let disk = SmallDisk::new(&data, "24m");
    let spec = folder.path().join("small.toml");
    fs::write(&spec, small_spec("").to_toml()).unwrap();
    let murmuration = Murmuration::over(&data);
    let run = murmuration.run(&["run", &spec.display().to_string()]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let digest = murmuration.digest();
    // A part of the database is still in its log, as in the snapshot of a file system.
    let serve = murmuration.start(&["serve", "--listen", "127.0.0.1:0"]);
    while !data.join("access.json").exists() {
        thread::sleep(Duration::from_millis(20));
    }
    let file = label(folder.path(), "label.csv", "mill");
    let labelled = murmuration.run(&["label", "latest", "--csv", &file]);
    assert_eq!(labelled.code, Some(0), "{}", labelled.stderr);
    serve.kill();
    let log = fs::metadata(data.join("murmuration.sqlite-wal")).unwrap();
    assert!(log.len() > 0);
    disk.make_read_only();

    assert_eq!(murmuration.digest(), digest);
    assert_eq!(labels(&murmuration), ["mill"]);
    let out = |name: &str| folder.path().join(name).display().to_string();
    let (report, export) = (out("report"), out("export"));
    for command in [
        vec!["list"],
        vec!["show", "latest"],
        vec!["show", "latest", "--taxonomy"],
        vec!["doctor"],
        vec!["report", "latest", "--out", &report],
        vec!["export", "latest", &export],
    ] {
        let read = murmuration.run(&command);
        assert_eq!(read.code, Some(0), "{command:?}: {}", read.stderr);
    }
    for command in [
        vec!["label", "latest", "--csv", &file],
        vec!["delete", "small-1", "--yes"],
        vec!["resume", "latest"],
    ] {
        let refused = murmuration.run(&command);
        assert_eq!(refused.code, Some(1), "{command:?}: {}", refused.stderr);
        let data = data.display().to_string();
        assert!(refused.stderr.contains(&data), "{command:?}: {}", refused.stderr);
    }
}

pub fn what_does_not_fit_on_a_disk_leaves_nothing_in_the_way() {
    let folder = tempfile::tempdir().unwrap();
    let data = Murmuration::over(&folder.path().join("data"));
    assert_eq!(data.run(&["checkpoints", "import", MODEL]).code, Some(0));
    let backup = folder.path().join("backup").display().to_string();
    assert_eq!(data.run(&["backup", &backup]).code, Some(0));

    let disk = folder.path().join("disk");
    let mounted = SmallDisk::new(&disk, "64k");
    let place = disk.join("restored");
    let refused = Murmuration::over(&place).run(&["restore", &backup]);
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    assert!(!place.exists(), "what was begun is in the way");
    drop(mounted);
    let restored = Murmuration::over(&place).run(&["restore", &backup]);
    assert_eq!(restored.code, Some(0), "{}", restored.stderr);
}
