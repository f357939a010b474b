//! Tests a database on a volume that is not mounted: no command may treat the database as absent.

use murmuration_tests::Murmuration;
use std::{fs, os::unix::fs::symlink};

pub fn a_database_whose_volume_is_not_mounted_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let digest = murmuration.digest();
    let (data, volume) = (folder.path().join("data"), folder.path().join("volume"));
    fs::create_dir(&volume).unwrap();
    let (database, moved) = (data.join("murmuration.sqlite"), volume.join("murmuration.sqlite"));
    fs::rename(&database, &moved).unwrap();
    symlink(&moved, &database).unwrap();
    assert_eq!(murmuration.digest(), digest);

    let elsewhere = folder.path().join("elsewhere");
    fs::rename(&volume, &elsewhere).unwrap();
    let spec = folder.path().join("small.toml").display().to_string();
    let backup = folder.path().join("backup").display().to_string();
    for command in [
        &["list"][..],
        &["run", &spec],
        &["resume", "latest"],
        &["serve", "--listen", "127.0.0.1:0"],
        &["doctor"],
        &["backup", &backup],
    ] {
        let message = murmuration.run(command);
        assert_ne!(message.code, Some(0), "{command:?}");
        assert!(
            message.stderr.contains(&moved.display().to_string()),
            "{command:?}: {}",
            message.stderr
        );
        assert_eq!(fs::read_link(&database).unwrap(), moved, "{command:?}");
    }
    assert!(!volume.exists());

    fs::rename(&elsewhere, &volume).unwrap();
    assert_eq!(murmuration.digest(), digest);
}
