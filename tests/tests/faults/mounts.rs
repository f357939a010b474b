//! Two coordinators reach one data directory through two mounts, whose locks do not exclude each other.

use super::{
    Scale,
    campaign::{SERVE, Undisturbed, campaign},
    table::Row,
};
use murmuration_tests::{BoundFolder, Murmuration, ProcessCluster, Running, binary};
use std::{fs, path::Path, process::Command, thread, time::Duration};

/// A coordinator with a worker, which cannot see whether a process of the first mount runs, as on another machine.
fn elsewhere(data: &Path) -> Running {
    let mut command = Command::new("unshare");
    command
        .args(["--pid", "--fork", "--kill-child"])
        .arg(binary("murmuration"))
        .args(SERVE)
        .arg("--data")
        .arg(data);
    Running::start(command)
}

pub fn two_coordinators(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let folder = tempfile::tempdir().unwrap();
    let [back, data, other] = ["back", "data", "other"].map(|name| folder.path().join(name));
    let _mounts = [BoundFolder::new(&back, &data), BoundFolder::new(&back, &other)];
    let spec = campaign(scale, 600, 1000);
    let mut first = ProcessCluster::start_in(folder, 2, Vec::new());
    let id = first.submit(&spec);
    first.wait_to_strike(&id, |status| status.generations_done > 3);
    let (code, refused) = elsewhere(&other).wait_and_hear();
    assert_eq!(code, Some(1), "{refused}");
    assert!(refused.contains("is in use by process"), "{refused}");
    let done = first.check_running(&id).generations_done;
    first.coordinator().signal("STOP");
    let mut second = elsewhere(&other);
    second.wait_for("  pages:");
    assert!(
        second.output().contains("did not give it back"),
        "{}",
        second.output()
    );
    first.coordinator().signal("CONT");
    let (code, told) = first.coordinator_ends();
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("another process has taken over"), "{told}");
    let by_other = Murmuration::over(&other);
    while by_other.latest()["state"] != "completed" {
        thread::sleep(Duration::from_millis(200));
    }
    let digest = by_other.run(&["digest", "latest", "--json"]).last_line();
    let digest = digest["digest"].as_str().unwrap().to_owned();
    // `unshare` does not pass signals on.
    let child = fs::read_to_string(format!("/proc/{0}/task/{0}/children", second.id())).unwrap();
    let sent = Command::new("kill").arg(child.trim()).status().unwrap();
    assert!(sent.success());
    let (code, log) = second.wait_and_hear();
    assert_eq!(code, Some(0), "{log}");
    let doctor = by_other.run(&["doctor"]);
    assert_eq!(doctor.code, Some(0), "{}{}", doctor.stdout, doctor.stderr);
    Row {
        done: format!(
            "a second coordinator started through another mount, whose locks are its own; the first stopped after {done} \
             generations, and continued when the second had taken over"
        ),
        found: format!(
            "the second was refused while the first was heard; the first ended by itself; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}
