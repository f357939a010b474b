//! SIGKILL, at random instants of a campaign; each must strike while it runs.

use super::{
    Scale,
    campaign::{Undisturbed, campaign, latent},
    processes::Cluster,
    table::Row,
};
use murmuration_proto::{Purpose, Stream, v1};
use std::{thread, time::Duration};

fn dice(scale: &Scale, of: u64) -> Stream {
    Stream::derive(scale.seed, Purpose::Jitter, of)
}

fn pause(dice: &mut Stream, most_ms: u64) {
    thread::sleep(Duration::from_millis(dice.below(most_ms)));
}

/// Waits until a share of the campaign is done; it must not be over.
fn reach(cluster: &mut Cluster, id: &str, generation: u32) {
    let status = cluster.wait_until(id, |status| status.generations_done >= generation);
    assert_eq!(
        status.state(),
        v1::CampaignState::Running,
        "over before the last kill: {}",
        status.error
    );
}

pub fn workers(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let kills = scale.worker_kills;
    let spec = campaign(2 * kills + 20, 1000);
    let mut cluster = Cluster::start(3);
    let id = cluster.submit(&spec);
    let mut dice = dice(scale, 1);
    for kill in 0..kills {
        reach(&mut cluster, &id, 2 * kill);
        pause(&mut dice, 20);
        let victim = dice.below(cluster.workers.len() as u64) as usize;
        cluster.workers.swap_remove(victim).kill();
        cluster.add_worker();
    }
    let status = cluster.try_status(&id).unwrap();
    assert_eq!(
        status.state(),
        v1::CampaignState::Running,
        "over before the last kill"
    );
    let digest = cluster.finish(&id);
    Row {
        done: format!("{kills} of three workers killed at random, each replaced"),
        found: undisturbed.check(&spec, &digest),
    }
}

pub fn coordinator(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let kills = scale.coordinator_kills;
    let spec = campaign(4 * kills + 20, 300);
    let mut cluster = Cluster::start(2);
    let id = cluster.submit(&spec);
    let mut dice = dice(scale, 2);
    for kill in 0..kills {
        reach(&mut cluster, &id, 4 * kill);
        // A generation takes some ten milliseconds, half of them its commit.
        pause(&mut dice, 20);
        cluster.restart_coordinator();
    }
    let status = cluster.wait_until(&id, |_| true);
    assert!(
        status.generations_done < spec.search().generations(),
        "over before the last kill"
    );
    let digest = cluster.finish(&id);
    Row {
        done: format!("coordinator killed {kills} times, started again"),
        found: undisturbed.check(&spec, &digest),
    }
}

pub fn trainer(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let kills = scale.trainer_kills;
    let spec = latent(10 * kills + 10);
    let mut cluster = Cluster::start(2);
    let url = cluster.url();
    let mut trainer = cluster.worker(&url, "murmuration-trainer");
    let id = cluster.submit(&spec);
    let mut dice = dice(scale, 3);
    for kill in 0..kills {
        let epoch = u64::from(10 * kill + 1);
        let status = cluster.wait_until(&id, |status| {
            status.training.is_some_and(|training| training.epoch >= epoch)
        });
        let training = status
            .training
            .unwrap_or_else(|| panic!("over before the last kill: {}", status.error));
        assert!(training.epoch < training.epochs, "over before the last kill");
        pause(&mut dice, 30);
        trainer.kill();
        trainer = cluster.worker(&url, "murmuration-trainer");
    }
    let digest = cluster.finish(&id);
    Row {
        done: format!("trainer killed {kills} times in one training, replaced"),
        found: undisturbed.check(&spec, &digest),
    }
}
