//! `bench`: the speed of this machine, and the accuracy that an embedding gains from labels.

mod all;
mod cluster;
mod labels;
mod pipeline;

use crate::json;
use murmuration_cli::{
    CliError, Global,
    table::{Table, left, right},
};
use murmuration_link::errln;
use murmuration_proto::v1;
use murmuration_sim::{
    evaluate::Evaluator,
    simulate::{Arch, Start, Swarm},
};
use murmuration_swarm::{
    Controller, ControllerSpace, ImageFormat, Preset, Purpose, RandomStream, World, grouped,
};
use murmuration_train::bench as train;
use rand::RngExt as _;
use rustix::time::{ClockId, clock_gettime};
use std::{
    hint::black_box,
    time::{Duration, Instant},
};

// Minimum work, counted by hand as in docs/performance.md.

/// Pairs of robots in a simulation of the paper's world, over all steps: 24 robots, 1,200 steps.
const PAIRS: u64 = 24 * 23 * 1200;
/// Operations in a step, per pair of robots with one sensor.
const ONE_SENSOR: u64 = 14;
/// Operations in a step, per pair of robots with two sensors.
const TWO_SENSORS: u64 = 21;
/// Operations of a simulation of the paper's world with one sensor.
const SIMULATION: u64 = PAIRS * ONE_SENSOR;
/// Multiply-adds per picture in training with the compact network, forward and back.
const TRAINED_PICTURE: u64 = 4_546_112;
/// Bytes of a result that the coordinator receives: a picture of 50 x 50 pixels, and five features in f64.
const RESULT: u64 = 50 * 50 + 5 * 8;

#[derive(Debug, clap::Subcommand)]
pub enum Bench {
    /// Measure simulation, campaigns, training, novelty and k-medoids briefly, each beside another implementation, in one table
    All(all::AllBench),
    /// Measure evaluations a second on one core, with and without SIMD
    Simulate {
        /// Seconds that each measurement takes
        #[arg(long, default_value_t = 2.0)]
        seconds: f64,
    },
    /// Compare a campaign with its evaluations alone, and measure the coordinator alone
    Cluster(cluster::ClusterBench),
    /// Measure the time of each stage of a latent campaign, from its dataset to its taxonomy
    Pipeline(pipeline::PipelineBench),
    /// Measure the time of a training step and epoch on all cores, and peak memory
    Train {
        /// Number of behaviours to train on; a campaign trains on 10,000
        #[arg(long, default_value_t = 10_000)]
        behaviours: usize,
    },
    /// Measure the accuracy of an embedding against the number of labels, by query strategy
    Labels(labels::LabelsBench),
}

impl Bench {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let as_json = global.json;
        match self {
            Self::All(all) => all.execute(as_json).await,
            Self::Simulate { seconds } => simulations(seconds, as_json),
            Self::Cluster(cluster) => cluster.execute(global).await,
            Self::Pipeline(pipeline) => pipeline.execute(global).await,
            Self::Train { behaviours } => trainings(behaviours, as_json),
            Self::Labels(labels) => labels.execute(as_json),
        }
    }
}

fn trainings(behaviours: usize, as_json: bool) -> Result<(), CliError> {
    let mut table = Table::new([
        left("NETWORK"),
        left("RECIPE"),
        right("WEIGHTS"),
        right("TRIPLETS/STEP"),
        right("S/STEP"),
        right("S/EPOCH"),
        right("PEAK MEMORY"),
    ]);
    let mut printed = Ok(());
    let report = |figures: train::Figures| {
        if as_json && printed.is_ok() {
            printed = json::print(json::BenchTrain::from(&figures));
        }
        let memory = figures
            .peak_memory
            .map_or("-".to_owned(), |bytes| format!("{} MiB", grouped(bytes >> 20)));
        errln!("measured: network {}, recipe {}", figures.network, figures.recipe);
        table.row([
            figures.network.to_owned(),
            figures.recipe.to_owned(),
            grouped(figures.weights as u64),
            grouped(figures.triplets_per_step),
            format!("{:.3}", figures.step_seconds),
            format!("{:.2}", figures.epoch_seconds),
            memory,
        ]);
    };
    train::train(behaviours, report).map_err(|error| CliError::Input(error.to_string()))?;
    printed?;
    if !as_json {
        table.print()?;
    }
    Ok(())
}

fn simulations(seconds: f64, as_json: bool) -> Result<(), CliError> {
    let span = span(seconds)?;
    let mut table = Table::new([
        left("MODEL"),
        left("WHAT"),
        right("EVALUATIONS/S"),
        right("x SCALAR"),
    ]);
    for model in Preset::PAPER {
        for (what, full) in [("simulation", false), ("simulation + features + image", true)] {
            let [scalar, fast] = alternately(model, full, span)?;
            let ratio = fast / scalar;
            errln!("measured: {what}, {model}");
            if as_json {
                json::print(json::BenchSimulate {
                    model: model.name(),
                    what,
                    evaluations_per_second_per_core: fast,
                    ratio_to_scalar: ratio,
                })?;
            }
            table.row([
                model.name().to_owned(),
                what.to_owned(),
                grouped(fast.round() as u64),
                format!("{ratio:.2}"),
            ]);
        }
    }
    if !as_json {
        table.print()?;
    }
    Ok(())
}

/// The duration given by `--seconds`.
fn span(seconds: f64) -> Result<Duration, CliError> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| CliError::Input(format!("--seconds {seconds}: must be a positive number")))
}

/// Evaluations a second, without vector instructions and with the best vector instructions of this machine. The two measurements
/// take turns on the same uniform sample of the paper's controllers, so that other load disturbs both measurements alike.
fn alternately(model: Preset, full: bool, span: Duration) -> Result<[f64; 2], CliError> {
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), &model.into())?;
    let mut stream = RandomStream::derive(1, Purpose::Propose, 0);
    let arches = [Arch::Scalar, Arch::new()];
    let mut evaluators = [evaluator(arches[0])?, evaluator(arches[1])?];
    let mut took = [Duration::ZERO; 2];
    let mut count = 0u32;
    while took[0] + took[1] < span {
        let (controller, start) = (space.sample(&mut stream), Start::seeded(stream.random()));
        for i in 0..2 {
            let begun = Instant::now();
            if full {
                black_box(evaluators[i].evaluate(&controller, &start)?);
            } else {
                black_box(simulate(arches[i], &controller, &start)?);
            }
            took[i] += begun.elapsed();
        }
        count += 1;
    }
    Ok(took.map(|took| f64::from(count) / took.as_secs_f64()))
}

fn evaluator(arch: Arch) -> Result<Evaluator, CliError> {
    Ok(Evaluator::on(arch, &World::default(), &ImageFormat::default())?)
}

fn simulate(arch: Arch, controller: &Controller, start: &Start) -> Result<Swarm, CliError> {
    let world = World::default();
    let mut swarm = Swarm::on(arch, controller, &world, start)?;
    swarm.advance(world.horizon());
    Ok(swarm)
}

/// CPU time of all threads of this process so far, which other programs on the machine hardly change.
fn process_cpu() -> Duration {
    cpu_time(ClockId::ProcessCPUTime)
}

fn thread_cpu() -> Duration {
    cpu_time(ClockId::ThreadCPUTime)
}

/// User and system time together.
fn cpu_time(clock: ClockId) -> Duration {
    let time = clock_gettime(clock);
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}
