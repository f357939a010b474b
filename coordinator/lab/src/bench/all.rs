//! `bench all`: short measurements of every speed, each beside its peer if it has one, in one table.

mod archives;
mod evaluations;
mod peer;
mod training;

use super::{RESULT, SIMULATION, cluster::ClusterBench, pipeline::PipelineBench, span};
use crate::json::{self, Machine};
use murmuration_cli::{
    CliError,
    table::{Table, left, right},
};
use murmuration_link::{OutputError, errln, outln};
use murmuration_sim::simulate::Arch;
use murmuration_swarm::{Preset, grouped};
use std::{fs, thread, time::Duration};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
A short form of the other benchmarks, one row per item; each item and its peer run in turns. The ratio is our figure divided by the \
peer's; figures of one thread are CPU time, and each figure is the best of its rounds.

The peers of simulation and training are a loop in numba and a step in PyTorch, which Python runs (option --python). Where \
Python lacks them the row has \"-\". A campaign's peer is the same evaluations in a plain loop; the peer of a latent campaign trains \
nothing. The peer of novelty is brute force; the peer of k-medoids is FasterPAM on the whole archive. Null evaluations have peers in benches/null_tasks_beside_dask_and_ray.py, novelty has a further one in \
benches/novelty_against_scikit_learn.py.

The floor is what one result takes at least, counted by hand: docs/performance.md says how.

Example:
  murmuration lab bench all --seconds 0.1")]
pub struct AllBench {
    /// Seconds that each measurement takes. For each second, the campaign has 10 generations (at most 100 in all), and the latent
    /// campaign's dataset has 200 controllers
    #[arg(long, default_value_t = 5.0)]
    seconds: f64,
    /// Python program with the packages numba and torch, which are the peers
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    python: String,
}

/// A row of the table, with speeds in results a second.
#[derive(Debug)]
struct Row {
    item: String,
    unit: &'static str,
    ours: f64,
    peer: Option<f64>,
    peer_name: Option<&'static str>,
    floor: Floor,
}

/// The minimum work per result.
#[derive(Debug, Clone, Copy)]
struct Floor {
    count: u64,
    of: &'static str,
}

impl Row {
    fn ratio(&self) -> Option<f64> {
        self.peer.map(|peer| self.ours / peer)
    }

    fn document(&self, machine: &Machine) -> json::BenchAll {
        json::BenchAll {
            item: self.item.clone(),
            unit: self.unit,
            ours: self.ours,
            peer: self.peer,
            peer_name: self.peer_name,
            ratio: self.ratio(),
            floor: self.floor.count,
            floor_unit: self.floor.of,
            machine: machine.clone(),
        }
    }

    fn cells(&self) -> [String; 7] {
        let or_none = |cell: Option<String>| cell.unwrap_or_else(|| "-".to_owned());
        [
            self.item.clone(),
            self.unit.to_owned(),
            rate(self.ours),
            or_none(self.peer.map(rate)),
            or_none(self.peer_name.map(str::to_owned)),
            or_none(self.ratio().map(|ratio| format!("{ratio:.2}"))),
            format!("{} {}", grouped(self.floor.count), self.floor.of),
        ]
    }
}

/// A rate with at least three digits.
fn rate(rate: f64) -> String {
    if rate < 100.0 {
        format!("{rate:.2}")
    } else {
        grouped(rate.round() as u64)
    }
}

impl AllBench {
    pub(super) async fn execute(self, as_json: bool) -> Result<(), CliError> {
        let span = span(self.seconds)?;
        let machine = this_machine();
        let mut printed = Printed::new(as_json, machine);
        for model in Preset::PAPER {
            for row in evaluations::rows(model, span, &self.python)? {
                printed.tell(&row)?;
            }
        }
        for row in self.cluster().await? {
            printed.tell(&row)?;
        }
        printed.tell(&self.pipeline().await?)?;
        printed.tell(&training::row(span, &self.python)?)?;
        printed.tell(&archives::novelty(span)?)?;
        printed.tell(&archives::medoids(span)?)?;
        printed.end()?;
        if printed.misses_a_peer {
            errln!(
                "{} does not run every peer: `pip install numba torch` in an environment of Python, and name its program by \
                 --python",
                self.python
            );
        }
        Ok(())
    }

    async fn pipeline(&self) -> Result<Row, CliError> {
        let controllers = (200.0 * self.seconds).clamp(100.0, 10_000.0) as u32;
        let generations = (controllers / 100).max(1);
        let measured = PipelineBench::short(controllers, generations).measure().await?;
        let [pipeline, plain] = measured.rates();
        Ok(Row {
            item: "latent campaign from nothing".to_owned(),
            unit: "simulations/s",
            ours: pipeline,
            peer: Some(plain),
            peer_name: Some("plain loop"),
            floor: Floor {
                count: measured.floor(),
                of: "operations",
            },
        })
    }

    async fn cluster(&self) -> Result<[Row; 2], CliError> {
        let generations = (10.0 * self.seconds).clamp(1.0, 100.0) as u32;
        let cluster = ClusterBench::short(generations, generations);
        let [campaign, plain] = cluster.campaign_and_loop().await?;
        let null = cluster.null_results().await?;
        let campaign = Row {
            item: "campaign, two workers".to_owned(),
            unit: "evaluations/s",
            ours: campaign,
            peer: Some(plain),
            peer_name: Some("plain loop"),
            floor: Floor {
                count: SIMULATION,
                of: "operations",
            },
        };
        let null = Row {
            item: "coordinator, null evaluations".to_owned(),
            unit: "results/s of CPU",
            ours: null,
            peer: None,
            peer_name: None,
            floor: Floor {
                count: RESULT,
                of: "bytes received",
            },
        };
        Ok([campaign, null])
    }
}

struct Printed {
    as_json: bool,
    machine: Machine,
    table: Table,
    misses_a_peer: bool,
}

impl Printed {
    fn new(as_json: bool, machine: Machine) -> Self {
        let table = Table::new([
            left("ITEM"),
            left("UNIT"),
            right("OURS"),
            right("PEER"),
            left("PEER'S NAME"),
            right("RATIO"),
            right("FLOOR"),
        ]);
        Self {
            as_json,
            machine,
            table,
            misses_a_peer: false,
        }
    }

    fn tell(&mut self, row: &Row) -> Result<(), OutputError> {
        errln!("measured: {}", row.item);
        self.misses_a_peer |= row.peer.is_none() && row.peer_name.is_some();
        if self.as_json {
            json::print(row.document(&self.machine))?;
        }
        self.table.row(row.cells());
        Ok(())
    }

    fn end(&self) -> Result<(), OutputError> {
        if self.as_json {
            return Ok(());
        }
        self.table.print()?;
        outln!("machine: {}", machine_in_words(&self.machine))
    }
}

/// Times two kinds of work in turns for as long as `span`, and each at least once. Returns the least CPU time of each kind, in
/// seconds. `round` runs both kinds and returns both times, with `None` for a missing peer.
fn in_turns(
    span: Duration,
    mut round: impl FnMut() -> Result<(f64, Option<f64>), CliError>,
) -> Result<(f64, Option<f64>), CliError> {
    let (mut ours, mut peer) = round()?;
    let mut spent = ours + peer.unwrap_or_default();
    while spent < span.as_secs_f64() {
        let (took, peer_took) = round()?;
        spent += took + peer_took.unwrap_or_default();
        ours = ours.min(took);
        peer = peer.zip(peer_took).map(|(least, took)| least.min(took));
    }
    Ok((ours, peer))
}

fn this_machine() -> Machine {
    Machine {
        cpu: fs::read_to_string("/proc/cpuinfo")
            .ok()
            .and_then(|text| cpu(&text)),
        cores: thread::available_parallelism().map_or(1, usize::from),
        vector_bits: vector_bits(Arch::new()),
    }
}

/// A description of the machine for people.
fn machine_in_words(machine: &Machine) -> String {
    let cpu = machine.cpu.as_deref().unwrap_or("unknown CPU");
    format!(
        "{cpu}, cores: {}, vectors of {} bits",
        machine.cores, machine.vector_bits
    )
}

/// The CPU's name from the text of /proc/cpuinfo; on aarch64, that file has no name.
fn cpu(text: &str) -> Option<String> {
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

const fn vector_bits(arch: Arch) -> u32 {
    match arch {
        Arch::Scalar => 64,
        #[cfg(target_arch = "x86_64")]
        Arch::V3(_) => 256,
        #[cfg(target_arch = "x86_64")]
        Arch::V4(_) => 512,
        // NEON has vectors of 128 bits.
        _ => 128,
    }
}

#[cfg(test)]
mod tests;
