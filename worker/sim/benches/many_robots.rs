//! Benchmark: CPU time of one robot's step in swarms of 24 to 10,000 robots. The benchmark compares checks of all pairs of robots
//! with the swarm's default lookup. The two variants take turns; each figure is the best of its rounds. Worlds grow with their
//! swarms: each robot has as much area as in the paper, up to the largest allowed world.
//!
//! `ROUNDS=20 cargo bench --workspace --bench many_robots` sets the number of rounds; the default is 5.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]
#![expect(clippy::print_stdout, reason = "what it prints is what it is for")]

mod cpu_time;

use cpu_time::timed;
use murmuration_proto::v1;
use murmuration_sim::simulate::{Arch, Start, Swarm};
use murmuration_swarm::{Controller, Preset, World};
use std::{env, hint::black_box};

const ROBOTS: [u32; 6] = [24, 100, 256, 512, 1_000, 10_000];
/// The paper's milling controller, a controller that aggregates, and a controller that goes straight on.
const CONTROLLERS: [(&str, [f64; 4]); 3] = [
    ("milling", [0.6, 1.0, 0.4, 0.5]),
    ("aggregation", [-0.7, -1.0, 1.0, -1.0]),
    ("straight on", [1.0, 1.0, 1.0, 1.0]),
];
/// Number of steps before the measured steps.
const SETTLING: u32 = 400;

fn main() {
    let rounds = env::var("ROUNDS").map_or(5, |rounds| rounds.parse().unwrap());
    println!(
        "{:<12} {:>7} {:>15} {:>15} {:>7}",
        "CONTROLLER", "ROBOTS", "ALL PAIRS, ns", "AS IT IS, ns", "RATIO"
    );
    for (name, genes) in CONTROLLERS {
        let controller = Controller::new(Preset::SingleSensor, &genes).unwrap();
        for robots in ROBOTS {
            let [pairs, own] = measured(&controller, robots, rounds);
            println!(
                "{name:<12} {robots:>7} {pairs:>15.0} {own:>15.0} {:>7.2}",
                pairs / own
            );
        }
    }
}

/// Nanoseconds per step of one robot: with checks of all pairs, and with the default lookup.
fn measured(controller: &Controller, robots: u32, rounds: u32) -> [f64; 2] {
    let side = (500.0 * (f64::from(robots) / 24.0).sqrt()).min(10_000.0);
    let message = v1::World {
        width: Some(side),
        height: Some(side),
        agents: Some(robots),
        ..World::default().into()
    };
    let world = World::try_from(message).unwrap();
    let mut settled = Swarm::new(controller, &world, &Start::seeded(1)).unwrap();
    settled.advance(SETTLING);
    let poses = settled
        .agents()
        .map(|agent| [agent.position[0], agent.position[1], agent.theta]);
    let start = Start::at(poses.collect()).unwrap();
    let steps = (50_000 / robots).clamp(4, 2_000);
    let fresh = [
        Swarm::pairwise(Arch::new(), controller, &world, &start).unwrap(),
        Swarm::new(controller, &world, &start).unwrap(),
    ];
    let mut best = [f64::INFINITY; 2];
    for _ in 0..rounds {
        for (best, fresh) in best.iter_mut().zip(&fresh) {
            let mut swarm = fresh.clone();
            let took = timed(|| swarm.advance(steps));
            black_box(swarm);
            *best = best.min(took * 1e9 / f64::from(steps * robots));
        }
    }
    best
}
