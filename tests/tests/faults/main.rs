//! Injects faults into the real processes. Each fault follows a seed and is certain to fire. The test compares the outcome with
//! an undisturbed run.
//!
//! Faults fire one after the other, and a table lists each fault and its outcome; `-- 'clock jumps'` fires only this fault.
//! `MURMURATION_SEED` determines which processes faults strike, and when. `MURMURATION_SCALE=long` (`make faults`) fires more
//! faults of every kind, and writes the table to `docs/reliability.md` if every fault was fired. `MURMURATION_BINARIES` names a
//! folder of binaries, so that a build during the hour does not replace the binaries of the test.

mod campaign;
mod clock;
mod decisions;
mod disk;
mod kills;
mod mirror;
mod mounts;
mod network;
mod overload;
mod proxy;
mod soak;
mod table;
mod workers;

use campaign::Undisturbed;
use murmuration_tests::{
    Requirement::{self, BoundFolders, Mount, NetworkNamespace, OpenFiles},
    Test, run_one_by_one,
};
use std::{
    process::ExitCode,
    sync::{Arc, Mutex},
};
use table::{Row, Table};

/// Sizes of the scenarios.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Seed of the moments and targets of faults.
    pub seed: u64,
    /// Kills of workers.
    pub worker_kills: u32,
    /// Kills of the coordinator.
    pub coordinator_kills: u32,
    /// Kills of the trainer.
    pub trainer_kills: u32,
    /// Network partitions.
    pub partitions: u32,
    /// Connections that send nothing.
    pub connections: usize,
    /// Length of the soak test, seconds.
    pub soak_seconds: u64,
    /// Factor on the length of campaigns, for machines where campaigns end before the faults have struck.
    pub stretch: u32,
}

impl Scale {
    const SHORT: Self = Self {
        seed: 1,
        worker_kills: 10,
        coordinator_kills: 5,
        trainer_kills: 3,
        partitions: 1,
        connections: 2_000,
        soak_seconds: 10,
        stretch: 1,
    };
    const LONG: Self = Self {
        seed: 1,
        worker_kills: 100,
        coordinator_kills: 50,
        trainer_kills: 20,
        partitions: 5,
        connections: 10_000,
        soak_seconds: 3600,
        stretch: 1,
    };
}

type Scenario = fn(&Scale, &Undisturbed) -> Row;

/// Faults and their requirements.
const SCENARIOS: [(&str, Scenario, &[Requirement]); 24] = [
    ("workers killed", kills::workers, &[]),
    ("coordinator killed", kills::coordinator, &[]),
    ("trainer killed", kills::trainer, &[]),
    ("cancels", decisions::cancels, &[]),
    ("clustering", decisions::clustering, &[]),
    ("partitions", network::partitions, &[]),
    ("latency", network::latency, &[]),
    ("packet loss", network::loss, &[NetworkNamespace]),
    ("slow worker", workers::slow, &[]),
    ("hung worker", workers::hung, &[]),
    ("wrong bits", workers::wrong_bits, &[]),
    ("impossible results", workers::impossible, &[]),
    ("foreign leases", workers::foreign_leases, &[]),
    ("a liar's connections", workers::connections_of_a_liar, &[]),
    ("unfit workers", workers::unfit, &[]),
    ("full disk", disk::full, &[Mount]),
    ("failing disk", disk::failing, &[]),
    ("read-only disk", disk::read_only, &[]),
    ("two coordinators", mounts::two_coordinators, &[BoundFolders]),
    ("mirror", mirror::goes_on, &[]),
    ("clock jumps", clock::jumps, &[]),
    ("connections", overload::connections, &[]),
    ("limits", overload::limits, &[OpenFiles(overload::FILES)]),
    ("soak", soak::soak, &[]),
];

fn main() -> ExitCode {
    let long = std::env::var("MURMURATION_SCALE").is_ok_and(|scale| scale == "long");
    let mut scale = if long { Scale::LONG } else { Scale::SHORT };
    if let Ok(seed) = std::env::var("MURMURATION_SEED") {
        scale.seed = seed.parse().unwrap();
    }
    let undisturbed = Arc::new(Undisturbed::new());
    let table = Arc::new(Mutex::new(Table::new(scale.seed)));
    let tests = SCENARIOS.map(|(name, scenario, needs)| {
        let (undisturbed, table) = (undisturbed.clone(), table.clone());
        let fire = move || {
            let fire = |stretch| scenario(&Scale { stretch, ..scale }, &undisturbed);
            let fired = table.lock().unwrap().run(name, fire);
            // The table lists the failed fault too.
            fired.unwrap_or_else(|found| panic!("{found}"));
        };
        let test = Test::new(name, fire);
        needs
            .iter()
            .fold(test, |test, &requirement| test.needs(requirement))
    });
    let code = run_one_by_one(tests.into());
    let table = table.lock().unwrap();
    eprintln!("\n{table}");
    if long && table.len() == SCENARIOS.len() {
        table.publish();
    }
    code
}
