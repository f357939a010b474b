//! Kills processes with SIGKILL at random moments of a campaign. Each kill must strike while the campaign runs.

use super::{
    Scale,
    campaign::{Undisturbed, campaign, latent},
    table::Row,
};
use murmuration_swarm::{Purpose, RandomStream};
use murmuration_tests::{OVER_TOO_EARLY, ProcessCluster};
use rand::RngExt as _;
use std::{thread, time::Duration};

fn dice(scale: &Scale, of: u64) -> RandomStream {
    RandomStream::derive(scale.seed, Purpose::Jitter, of)
}

fn pause(dice: &mut RandomStream, most_ms: u64) {
    thread::sleep(Duration::from_millis(dice.random_range(0..most_ms)));
}

pub fn workers(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let kills = scale.worker_kills;
    // The search continues while a killed process is replaced. On a machine where starting is slow, the search does some twenty
    // generations in this time.
    let spec = campaign(scale, 20 * kills + 20, 1000);
    let mut cluster = ProcessCluster::start(3);
    let id = cluster.submit(&spec);
    let mut dice = dice(scale, 1);
    for kill in 0..kills {
        cluster.wait_to_strike(&id, |status| {
            status.workers == 3 && status.generations_done > 2 * kill
        });
        pause(&mut dice, 20);
        let victim = dice.random_range(0..cluster.workers.len());
        cluster.workers.swap_remove(victim).kill();
        cluster.check_running(&id);
        cluster.add_worker();
    }
    let digest = cluster.finish(&id);
    Row {
        done: format!("{kills} of three workers killed at random, each replaced"),
        found: undisturbed.check(&spec, &digest),
    }
}

pub fn coordinator(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let kills = scale.coordinator_kills;
    // The first worker to reconnect works alone until the other worker reconnects.
    let spec = campaign(scale, 40 * kills + 20, 300);
    let mut cluster = ProcessCluster::start(2);
    let id = cluster.submit(&spec);
    let mut dice = dice(scale, 2);
    for kill in 0..kills {
        cluster.wait_to_strike(&id, |status| {
            status.workers == 2 && status.generations_done > 4 * kill
        });
        // A generation takes some ten milliseconds, half of this time for its commit.
        pause(&mut dice, 20);
        cluster.restart_coordinator();
    }
    cluster.check_running(&id);
    let digest = cluster.finish(&id);
    Row {
        done: format!("coordinator killed {kills} times, started again"),
        found: undisturbed.check(&spec, &digest),
    }
}

pub fn trainer(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let kills = scale.trainer_kills;
    let spec = latent(scale, 10 * kills + 10);
    let mut cluster = ProcessCluster::start(2);
    let url = cluster.url();
    let mut trainer = cluster.worker(&url, "murmuration-trainer");
    let id = cluster.submit(&spec);
    let mut dice = dice(scale, 3);
    for kill in 0..kills {
        let epoch = u64::from(10 * kill + 1);
        let status = cluster.wait_to_strike(&id, |status| {
            status.trainers == 1 && status.training.is_some_and(|training| training.epoch >= epoch)
        });
        let training = status.training.expect("a training was waited for");
        assert!(
            training.epoch < training.epochs,
            "{OVER_TOO_EARLY}: all epochs are done"
        );
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
