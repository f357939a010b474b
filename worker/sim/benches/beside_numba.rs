//! Benchmark: evaluations of the paper's world per second of CPU time, compared with the same loop in numba. The two programs
//! take turns, so that other load on the machine disturbs both programs equally. Each figure is the best of its rounds.
//!
//! `PYTHON` names a Python that has numba; without numba, the benchmark prints this library's rates only.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]
#![expect(clippy::print_stdout, reason = "what it prints is what it is for")]

mod cpu_time;

use cpu_time::timed;
use murmuration_proto::v1;
use murmuration_sim::{
    evaluate::Evaluator,
    simulate::{Start, Swarm},
};
use murmuration_swarm::{
    Controller, ControllerSpace, ImageFormat, Preset, Purpose, RandomStream, RobotController, World,
};
use serde_json::json;
use std::{
    env,
    f64::consts::FRAC_PI_3,
    hint::black_box,
    io::{BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

/// Number of swarms in a population: as many as an AVX-512 vector has lanes.
const SWARMS: u64 = 8;
/// Number of uniformly drawn populations: more than one, because the rates of populations differ.
const DRAWS: u64 = 6;

type Tasks = Vec<(Controller, Start)>;

fn main() {
    let rounds = env::var("ROUNDS").map_or(15, |rounds| rounds.parse().unwrap());
    println!(
        "{:<26} {:>9} {:>9} {:>10} {:>9} | x numba: {:>6} {:>6} {:>6}",
        "POPULATION", "NUMBA", "ALONE", "NO PICTURE", "FULL", "ALONE", "NO PIC", "FULL"
    );
    for (name, populations) in populations() {
        let mut seconds = [0.0; 4];
        for tasks in &populations {
            for (sum, took) in seconds.iter_mut().zip(measured(tasks, rounds)) {
                *sum += took;
            }
        }
        let swarms = (SWARMS * populations.len() as u64) as f64;
        let [numba, alone, bare, full] = seconds.map(|took| swarms / took);
        let beside = |rate: f64| {
            if numba > 0.0 {
                format!("{:>6.2}", rate / numba)
            } else {
                format!("{:>6}", "-")
            }
        };
        let [by_alone, by_bare, by_full] = [alone, bare, full].map(beside);
        println!(
            "{name:<26} {numba:>9.0} {alone:>9.0} {bare:>10.0} {full:>9.0} |          {by_alone} {by_bare} {by_full}"
        );
    }
}

/// Seconds for the loop in numba, for swarms simulated one by one, and for all swarms evaluated at once, without and with a
/// picture.
fn measured(tasks: &Tasks, rounds: u32) -> [f64; 4] {
    let world = World::default();
    let picture = |window| {
        let message = v1::ImageFormat {
            window,
            ..ImageFormat::default().into()
        };
        ImageFormat::for_swarm(message, &world, &Preset::SingleSensor.into()).unwrap()
    };
    // The first step of a window clears the canvas, so a window of 2 draws one step.
    let mut bare = Evaluator::new(&world, &picture(Some(2))).unwrap();
    let mut full = Evaluator::new(&world, &picture(None)).unwrap();
    let mut numba = Numba::start(tasks, &world);
    let mut best = [f64::INFINITY; 4];
    for _ in 0..rounds {
        let took = [
            numba.as_mut().map_or(f64::INFINITY, Numba::round),
            timed(|| {
                for (controller, start) in tasks {
                    let mut swarm = Swarm::new(controller, &world, start).unwrap();
                    swarm.advance(world.horizon());
                    black_box(swarm);
                }
            }),
            timed(|| drop(black_box(bare.evaluate_all(tasks).unwrap()))),
            timed(|| drop(black_box(full.evaluate_all(tasks).unwrap()))),
        ];
        for (best, took) in best.iter_mut().zip(took) {
            *best = best.min(took);
        }
    }
    best
}

/// The paper's controllers, an aggregation controller, uniform samples, samples that pass the filter, and an evolved generation.
fn populations() -> Vec<(&'static str, Vec<Tasks>)> {
    let milling = [0.6, 1.0, 0.4, 0.5];
    let aggregation = [-0.7, -1.0, 1.0, -1.0];
    let nested = [0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -FRAC_PI_3];
    let [single, two] = [Preset::SingleSensor, Preset::TwoSensor];
    vec![
        ("one sensor, milling", vec![same(single, &milling)]),
        ("one sensor, aggregation", vec![same(single, &aggregation)]),
        ("one sensor, uniform", uniform(single)),
        ("one sensor, filtered", listed("filtered", "single", single)),
        ("one sensor, evolved", listed("evolved", "single", single)),
        ("two sensors, nested cycle", vec![same(two, &nested)]),
        ("two sensors, uniform", uniform(two)),
        ("two sensors, filtered", listed("filtered", "two", two)),
        ("two sensors, evolved", listed("evolved", "two", two)),
    ]
}

fn same(model: Preset, genes: &[f64]) -> Tasks {
    let controller = Controller::new(model, genes).unwrap();
    (0..SWARMS)
        .map(|seed| (controller.clone(), Start::seeded(seed)))
        .collect()
}

fn uniform(model: Preset) -> Vec<Tasks> {
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), &model.into()).unwrap();
    let mut stream = RandomStream::derive(1, Purpose::Propose, 0);
    let mut draw = |seed| (space.sample(&mut stream), Start::seeded(seed));
    (0..DRAWS)
        .map(|number| (0..SWARMS).map(|i| draw(number * SWARMS + i)).collect())
        .collect()
}

/// The controllers of `controllers.txt` with these two words before their genes.
fn listed(kind: &str, name: &str, model: Preset) -> Vec<Tasks> {
    let list = include_str!("controllers.txt").lines();
    let genes = list.filter_map(|line| line.strip_prefix(kind)?.strip_prefix(' ')?.strip_prefix(name));
    let controllers: Vec<_> = genes
        .map(|genes| {
            let genes: Vec<f64> = genes
                .split_whitespace()
                .map(|gene| gene.parse().unwrap())
                .collect();
            Controller::new(model, &genes).unwrap()
        })
        .collect();
    let starts = (0..).map(Start::seeded);
    let tasks: Tasks = controllers.into_iter().zip(starts).collect();
    tasks.chunks(SWARMS as usize).map(<[_]>::to_vec).collect()
}

/// A Python process that simulates the same tasks with numba.
struct Numba {
    process: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Numba {
    /// Starts the Python process; `None` without numba.
    fn start(tasks: &Tasks, world: &World) -> Option<Self> {
        let python = env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/numba_loop.py");
        let mut process = Command::new(python)
            .arg(script)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let (mut to, from) = (process.stdin.take()?, BufReader::new(process.stdout.take()?));
        let message: Vec<_> = tasks
            .iter()
            .map(|(controller, start)| {
                let swarm = Swarm::new(controller, world, start).unwrap();
                let pose = |agent: murmuration_sim::simulate::Agent| {
                    [agent.position[0], agent.position[1], agent.theta]
                };
                json!({
                    "poses": swarm.agents().map(pose).collect::<Vec<_>>(),
                    "speeds": controller.robots().flat_map(|robot| robot.pairs().as_flattened()).collect::<Vec<_>>(),
                    "angle": controller.robots().flat_map(RobotController::angles).last(),
                    "sensors": controller.model().species()[0].robot().sensors().len(),
                })
            })
            .collect();
        writeln!(to, "{}", json!(message)).ok()?;
        let mut numba = Self { process, to, from };
        (numba.line()? == "ready").then_some(numba)
    }

    fn line(&mut self) -> Option<String> {
        let mut line = String::new();
        let read = self.from.read_line(&mut line).ok()?;
        (read > 0).then(|| line.trim().to_owned())
    }

    fn round(&mut self) -> f64 {
        writeln!(self.to).unwrap();
        self.line().unwrap().parse().unwrap()
    }
}

impl Drop for Numba {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
