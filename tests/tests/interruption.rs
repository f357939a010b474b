//! `kill -9` at any instant, full and read-only disks: resumed, a campaign ends with the digest of an undisturbed one.

use murmuration_proto::{Purpose, Stream};
use murmuration_tests::{Murmuration, small_spec};
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    thread,
    time::Duration,
};

/// A campaign of some seconds, so that there is something to interrupt.
fn longer_spec(folder: &Path) -> String {
    let text = small_spec("seed = 5").to_toml();
    let text = text
        .replace("generations = 5", "generations = 60")
        .replace("horizon = 200", "horizon = 600");
    let path = folder.join("longer.toml");
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

fn digest(murmuration: &Murmuration) -> String {
    let finished = murmuration.run(&["digest", "latest"]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    finished.stdout
}

fn generations_done(murmuration: &Murmuration) -> u64 {
    let shown = murmuration.run(&["show", "latest", "--json"]).stdout;
    serde_json::from_str::<serde_json::Value>(&shown).unwrap()["generations_done"]
        .as_u64()
        .unwrap()
}

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
            generations_done(&killed) < 60,
            "it was killed too late to be interrupted"
        );
    }
    assert_eq!(killed.run(&["resume", "latest"]).code, Some(0));
    assert_eq!(digest(&killed), digest(&undisturbed));
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

/// A mounted file system of its own, unmounted when dropped.
struct Mount(PathBuf);

impl Mount {
    /// `None`, with a line that says so, where mounting is not allowed.
    fn new(at: &Path, size: &str) -> Option<Self> {
        fs::create_dir_all(at).unwrap();
        let options = format!("size={size}");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &options, "tmpfs"])
            .arg(at)
            .output();
        if mounted.is_ok_and(|output| output.status.success()) {
            return Some(Self(at.to_owned()));
        }
        eprintln!("skipped: mounting a small file system needs root");
        None
    }

    fn remount(&self, options: &str) {
        let options = format!("remount,{options}");
        assert!(
            Command::new("mount")
                .args(["-o", &options])
                .arg(&self.0)
                .status()
                .unwrap()
                .success()
        );
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        // Lazily: a test that failed may have left a process in it.
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

#[test]
fn a_full_disk_stops_it_by_name_and_room_lets_it_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longer_spec(folder.path());
    let data = folder.path().join("small-disk");
    let Some(mount) = Mount::new(&data, "2m") else {
        return;
    };
    let murmuration = Murmuration::over(&data);
    let run = murmuration.run(&["run", &spec]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    assert!(
        run.stderr
            .contains("is full: make room, then `murmuration resume latest`"),
        "{}",
        run.stderr
    );
    assert!(!run.stderr.contains("panicked"), "{}", run.stderr);

    mount.remount("size=100m");
    let before = generations_done(&murmuration);
    assert!((1..60).contains(&before), "{before} generations");
    let resumed = murmuration.run(&["resume", "latest"]);
    assert_eq!(resumed.code, Some(0), "{}", resumed.stderr);
    let undisturbed = Murmuration::over(&folder.path().join("undisturbed"));
    assert_eq!(undisturbed.run(&["run", &spec]).code, Some(0));
    assert_eq!(digest(&murmuration), digest(&undisturbed));
}

#[test]
fn a_read_only_disk_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let spec = longer_spec(folder.path());
    let data = folder.path().join("read-only");
    let Some(mount) = Mount::new(&data, "2m") else {
        return;
    };
    mount.remount("ro");
    let run = Murmuration::over(&data).run(&["run", &spec]);
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let named = run.stderr.contains("read-only") && run.stderr.contains(&data.display().to_string());
    assert!(named && !run.stderr.contains("panicked"), "{}", run.stderr);
}
