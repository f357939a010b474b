//! A soak test: campaign after campaign runs, while workers come and go. The coordinator's memory and open files must not grow,
//! nor a worker's memory.

use super::{
    Scale,
    campaign::{Undisturbed, campaign},
    table::Row,
};
use murmuration_swarm::{Purpose, RandomStream};
use murmuration_tests::ProcessCluster;
use rand::RngExt as _;
use std::{
    fs,
    time::{Duration, Instant},
};

/// The memory and the open files of a process.
#[derive(Debug, Clone, Copy)]
struct Held {
    memory_mib: f64,
    files: usize,
}

impl Held {
    fn by(process: u32) -> Self {
        Self {
            memory_mib: memory_mib(process),
            files: fs::read_dir(format!("/proc/{process}/fd")).unwrap().count(),
        }
    }
}

/// Memory of a process without pages shared with files, MiB.
pub fn memory_mib(process: u32) -> f64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"));
    let kib: f64 = line.unwrap().trim().trim_end_matches(" kB").parse().unwrap();
    kib / 1024.0
}

pub fn soak(scale: &Scale, undisturbed: &Undisturbed) -> Row {
    let spec = campaign(scale, 20, 300);
    let mut cluster = ProcessCluster::start(2);
    let mut dice = RandomStream::derive(scale.seed, Purpose::Jitter, 9);
    let whole = Duration::from_secs(scale.soak_seconds);
    let begun = Instant::now();
    let (mut campaigns, mut replaced) = (0, 0);
    let mut warm = None;
    while begun.elapsed() < whole || warm.is_none() {
        let id = cluster.submit(&spec);
        let digest = cluster.finish(&id);
        undisturbed.check(&spec, &digest);
        campaigns += 1;
        if dice.random_bool(0.3) {
            cluster.workers.remove(0).kill();
            cluster.add_worker();
            replaced += 1;
        }
        if warm.is_none() && begun.elapsed() > whole / 4 {
            let worker = cluster.workers[1].id();
            warm = Some((Held::by(cluster.coordinator().id()), worker, Held::by(worker)));
        }
    }
    cluster.wait_for_idleness();
    let (first, worker, worker_first) = warm.unwrap();
    let last = Held::by(cluster.coordinator().id());
    let grown = last.memory_mib - first.memory_mib;
    assert!(
        grown < 16.0 + 0.2 * first.memory_mib,
        "the coordinator grew from {first:?} to {last:?}"
    );
    assert!(
        last.files <= first.files + 8,
        "the coordinator keeps files: {first:?}, {last:?}"
    );
    let mut of_worker = String::new();
    if cluster.workers.iter().any(|process| process.id() == worker) {
        let worker_last = Held::by(worker);
        let limit = 16.0 + 1.2 * worker_first.memory_mib;
        assert!(
            worker_last.memory_mib < limit,
            "a worker grew from {worker_first:?} to {worker_last:?}"
        );
        of_worker = format!(
            ", a worker {:.0} to {:.0} MiB",
            worker_first.memory_mib, worker_last.memory_mib
        );
    }
    Row {
        done: format!(
            "{campaigns} campaigns in {} s, a worker killed and replaced {replaced} times",
            begun.elapsed().as_secs()
        ),
        found: format!(
            "coordinator {:.0} to {:.0} MiB and {} to {} files{of_worker}; no lease left; digests as undisturbed",
            first.memory_mib, last.memory_mib, first.files, last.files
        ),
    }
}
