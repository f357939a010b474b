//! The clock jumps forward and back while a campaign runs.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    table::Row,
};
use murmuration_proto::v1;
use murmuration_tests::{FaultyLibc, ProcessCluster};
use std::cell::Cell;

const DAY: i64 = 86_400;

pub fn jumps(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let jumps = [DAY, -DAY, 3600, -400 * DAY, 0];
    let spec = campaign(scale, 20 * jumps.len() as u32, 1000);
    let folder = tempfile::tempdir().unwrap();
    let clock = FaultyLibc::new(folder.path());
    let mut cluster = ProcessCluster::start_in(folder, 2, clock.environment().to_vec());
    let id = cluster.submit(&spec);
    // The smallest number of connected workers, observed while the campaign runs, after both workers have joined.
    let fewest = Cell::new(2);
    let look = |status: &v1::Campaign| fewest.set(fewest.get().min(status.workers));
    for (generation, seconds) in (2..).step_by(15).zip(jumps) {
        cluster.wait_to_strike(&id, |status| {
            look(status);
            status.generations_done >= generation
        });
        clock.shift_clock(seconds);
    }
    let last = cluster.wait_until(&id, |status| {
        look(status);
        false
    });
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    assert_eq!(last.workers.min(fewest.get()), 2, "a worker was taken for silent");
    let digest = cluster.digest(&id);
    Row {
        done: "the time of day set a day ahead, a day back, an hour ahead, 400 days back, and right again"
            .to_owned(),
        found: format!("no worker was missed; {}", undisturbed.check(&spec, &digest)),
    }
}
