//! A clock that somebody sets, forward and back, while everything runs.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    processes::Cluster,
    table::Row,
};
use murmuration_proto::v1;
use murmuration_tests::FaultyLibc;

const DAY: i64 = 86_400;

pub fn jumps(_: &Scale, undisturbed: &Undisturbed) -> Row {
    let jumps = [DAY, -DAY, 3600, -400 * DAY, 0];
    let spec = campaign(20 * jumps.len() as u32, 1000);
    let folder = tempfile::tempdir().unwrap();
    let clock = FaultyLibc::new(folder.path());
    let mut cluster = Cluster::start_in(folder, 2, clock.environment().to_vec());
    let id = cluster.submit(&spec);
    let mut fewest = u32::MAX;
    for (generation, seconds) in (2..).step_by(15).zip(jumps) {
        let status = cluster.wait_until(&id, |status| status.generations_done >= generation);
        assert_eq!(
            status.state(),
            v1::CampaignState::Running,
            "over before the last jump"
        );
        clock.shift_clock(seconds);
        fewest = fewest.min(status.workers);
    }
    let digest = cluster.finish(&id);
    let status = cluster.try_status(&id).unwrap();
    assert_eq!(status.workers.min(fewest), 2, "a worker was taken for silent");
    Row {
        done: "the time of day set a day ahead, a day back, an hour ahead, 400 days back, and right again"
            .to_owned(),
        found: format!("no worker was missed; {}", undisturbed.check(&spec, &digest)),
    }
}
