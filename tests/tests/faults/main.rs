//! Faults against the real processes: seeded, fired for certain, and the outcome compared with an undisturbed run.
//!
//! One after the other, with a table of what was done and what was found. `MURMURATION_SEED` decides when and whom they
//! strike; `MURMURATION_SCALE=long` has more of everything (`make faults`), and writes the table to
//! `docs/reliability.md`. `MURMURATION_BINARIES` names a folder of built binaries: an hour is long enough for somebody to
//! build others.

mod campaign;
mod clock;
mod crowd;
mod disk;
mod kills;
mod network;
mod processes;
mod proxy;
mod soak;
mod table;
mod workers;

use campaign::Undisturbed;
use table::{Row, Table};

/// How much of everything.
#[derive(Debug, Clone, Copy)]
pub struct Scale {
    /// Seed of what strikes when.
    pub seed: u64,
    /// Kills of workers.
    pub worker_kills: u32,
    /// Kills of the coordinator.
    pub coordinator_kills: u32,
    /// Kills of the trainer.
    pub trainer_kills: u32,
    /// Times that the wire is cut.
    pub partitions: u32,
    /// Connections that say nothing.
    pub connections: usize,
    /// How long the soak is, seconds.
    pub soak_seconds: u64,
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
    };
    const LONG: Self = Self {
        seed: 1,
        worker_kills: 100,
        coordinator_kills: 50,
        trainer_kills: 20,
        partitions: 5,
        connections: 10_000,
        soak_seconds: 3600,
    };
}

type Scenario = fn(&Scale, &Undisturbed) -> Row;

const SCENARIOS: [(&str, Scenario); 18] = [
    ("workers killed", kills::workers),
    ("coordinator killed", kills::coordinator),
    ("trainer killed", kills::trainer),
    ("partitions", network::partitions),
    ("latency", network::latency),
    ("packet loss", network::loss),
    ("slow worker", workers::slow),
    ("hung worker", workers::hung),
    ("wrong bits", workers::wrong_bits),
    ("impossible results", workers::impossible),
    ("foreign leases", workers::foreign_leases),
    ("full disk", disk::full),
    ("failing disk", disk::failing),
    ("read-only disk", disk::read_only),
    ("clock jumps", clock::jumps),
    ("connections", crowd::connections),
    ("limits", crowd::limits),
    ("soak", soak::soak),
];

#[test]
fn faults() {
    let long = std::env::var("MURMURATION_SCALE").is_ok_and(|scale| scale == "long");
    let mut scale = if long { Scale::LONG } else { Scale::SHORT };
    if let Ok(seed) = std::env::var("MURMURATION_SEED") {
        scale.seed = seed.parse().unwrap();
    }
    let wanted = std::env::var("MURMURATION_FAULT").unwrap_or_default();
    let undisturbed = Undisturbed::new();
    let mut table = Table::new(scale.seed);
    for (name, scenario) in SCENARIOS.into_iter().filter(|(name, _)| name.contains(&wanted)) {
        eprintln!("{name} ...");
        table.run(name, || scenario(&scale, &undisturbed));
    }
    eprintln!("\n{table}");
    if long && wanted.is_empty() {
        table.publish();
    }
    assert!(table.all_held(), "see the table above");
}
