//! Disks that are full, read-only or failing for a while.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    table::Row,
};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{FaultyLibc, OVER_TOO_EARLY, ProcessCluster, SmallDisk};
use std::{fs, thread, time::Duration};

pub fn full(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let folder = tempfile::tempdir().unwrap();
    let disk = SmallDisk::new(&folder.path().join("data"), "8m");
    let spec = campaign(scale, 60, 1000);
    let mut cluster = ProcessCluster::start_in(folder, 2, Vec::new());
    let id = cluster.submit(&spec);
    cluster.wait_to_strike(&id, |status| status.generations_done >= 5);
    let ballast = disk.fill();
    let before = waits(&mut cluster, &id, &spec);
    fs::remove_file(&ballast).unwrap();
    let digest = cluster.finish(&id);
    drop(cluster);
    Row {
        done: format!("disk full after {before} generations, room again later"),
        found: format!(
            "waited, and went on by itself; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

pub fn failing(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let fails = "syncs that fail (EIO)";
    refused(scale, undisturbed, fails, |faults, refuse| {
        faults.fail_syncs(refuse)
    })
}

pub fn read_only(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let fails = "a disk that became read-only (EROFS)";
    refused(scale, undisturbed, fails, |faults, refuse| {
        faults.read_only(refuse)
    })
}

/// In the middle of a campaign, a disk refuses the coordinator's writes for a while.
fn refused(scale: &Scale, undisturbed: &Undisturbed, what: &str, set: impl Fn(&FaultyLibc, bool)) -> Row {
    let folder = tempfile::tempdir().unwrap();
    let faults = FaultyLibc::new(folder.path());
    let spec = campaign(scale, 60, 1000);
    let mut cluster = ProcessCluster::start_in(folder, 2, faults.environment().into());
    let id = cluster.submit(&spec);
    cluster.wait_to_strike(&id, |status| status.generations_done >= 5);
    set(&faults, true);
    let before = waits(&mut cluster, &id, &spec);
    set(&faults, false);
    let digest = cluster.finish(&id);
    Row {
        done: format!("{what} after {before} generations, sound again later"),
        found: format!(
            "waited, and went on by itself; {}",
            undisturbed.check(&spec, &digest)
        ),
    }
}

/// Waits until the campaign waits for its disk; returns the number of generations that are done.
fn waits(cluster: &mut ProcessCluster, id: &str, spec: &CampaignSpec) -> u32 {
    // The database may still have a little room in its own files.
    let mut before = cluster.try_status(id).unwrap().generations_done;
    loop {
        thread::sleep(Duration::from_secs(2));
        let now = cluster.check_running(id);
        if now.generations_done == before && !now.waiting.is_empty() {
            break;
        }
        before = now.generations_done;
    }
    let all = spec.search().generations();
    assert!(
        before < all,
        "{OVER_TOO_EARLY} for the disk to refuse a generation"
    );
    before
}
