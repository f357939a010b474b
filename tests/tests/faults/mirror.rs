//! A coordinator goes on from the mirror of another one, which is stopped, and later continues.

use super::{
    Scale,
    campaign::{SERVE, Undisturbed, campaign},
    table::Row,
};
use murmuration_tests::{Murmuration, ProcessCluster};
use std::fs;

pub fn goes_on(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let folder = tempfile::tempdir().unwrap();
    let [mirror, other, labels] = ["mirror", "other", "labels.csv"].map(|name| folder.path().join(name));
    let spec = campaign(scale, 600, 1000);
    let environment = vec![("MURMURATION_MIRROR", mirror.clone().into_os_string())];
    let mut first = ProcessCluster::start_in(folder, 2, environment);
    let id = first.submit(&spec);
    first.wait_to_strike(&id, |status| status.generations_done > 3);
    fs::write(&labels, "index,class\n0,ring\n1,clump\n").unwrap();
    let by_first = Murmuration::over(&other.with_file_name("data"));
    let labelled = by_first.run(&[
        "label",
        "latest",
        "--csv",
        &labels.display().to_string(),
        "--annotator",
        "ana",
    ]);
    assert_eq!(labelled.code, Some(0), "{}", labelled.stderr);
    let done = first.check_running(&id).generations_done;
    first.coordinator().signal("STOP");
    let by_other = Murmuration::over(&other);
    let mirror = mirror.display().to_string();
    let from_mirror = ["--mirror", &mirror, "--from-mirror"];
    let mut second = by_other.start(&[SERVE.as_slice(), &from_mirror].concat());
    second.wait_for("  pages:");
    let resumed = by_other.latest();
    let at = resumed["generations_done"].as_u64().unwrap_or_default();
    first.coordinator().signal("CONT");
    let (code, told) = first.coordinator_ends();
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("has gone on from the mirror"), "{told}");
    by_other.latest_when(|campaign| campaign["state"] == "completed");
    let digest = by_other.run(&["digest", "latest", "--json"]).last_line();
    let digest = digest["digest"].as_str().unwrap().to_owned();
    let kept = by_other.run(&["labels", "latest", "--json"]);
    let has_both = kept.stdout.contains("ring") && kept.stdout.contains("clump");
    assert!(has_both, "{}{}", kept.stdout, kept.stderr);
    assert_eq!(second.terminate(), Some(0));
    let doctor = by_other.run(&["doctor"]);
    assert_eq!(doctor.code, Some(0), "{}{}", doctor.stdout, doctor.stderr);
    Row {
        done: format!(
            "a coordinator with a mirror stopped after {done} generations and two labels; another went on from the mirror, after \
             {at} generations; the first continued"
        ),
        found: format!(
            "the first ended by itself; both labels are there; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}
