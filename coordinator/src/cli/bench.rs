//! `bench`: what this machine does, and what labels bring.

mod labels;

use super::{CliError, json};
use murmuration_link::{OutputError, outln};
use murmuration_proto::{
    CapabilityModel, Controller, ControllerSpace, ImageFormat, Purpose, Stream, World, v1,
};
use murmuration_trainer::bench as train;
use murmuration_worker::{
    evaluate::Evaluator,
    simulate::{Arch, Start, Swarm},
};
use std::{
    hint::black_box,
    time::{Duration, Instant},
};

/// A benchmark.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Bench {
    /// Evaluations a second on one core, both models, beside the same without SIMD
    Simulate {
        /// Seconds for each figure
        #[arg(long, default_value_t = 2.0)]
        seconds: f64,
    },
    /// Seconds a step and an epoch of training take on all cores, and peak memory: both networks, both recipes
    Train {
        /// Behaviours to train on, as many as in a campaign's data set
        #[arg(long, default_value_t = 10_000)]
        behaviours: usize,
    },
    /// Accuracy of the embedding against the number of labels, strategy by strategy
    Labels(labels::LabelsBench),
}

impl Bench {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        match self {
            Self::Simulate { seconds } => simulations(seconds, as_json),
            Self::Train { behaviours } => trainings(behaviours, as_json),
            Self::Labels(labels) => labels.execute(as_json),
        }
    }
}

fn trainings(behaviours: usize, as_json: bool) -> Result<(), CliError> {
    if !as_json {
        outln!(
            "{:<10} {:<10} {:>9} {:>14} {:>9} {:>9} {:>14}",
            "NETWORK",
            "RECIPE",
            "WEIGHTS",
            "TRIPLETS/STEP",
            "S/STEP",
            "S/EPOCH",
            "PEAK MEMORY"
        )?;
    }
    let print = |figures: &train::Figures| -> Result<(), OutputError> {
        if as_json {
            return json::print(&json::bench_train(figures));
        }
        let memory = figures
            .peak_memory
            .map_or("-".to_owned(), |bytes| format!("{} MiB", bytes >> 20));
        outln!(
            "{:<10} {:<10} {:>9} {:>14} {:>9.3} {:>9.2} {memory:>14}",
            figures.network,
            figures.recipe,
            figures.weights,
            figures.triplets_per_step,
            figures.step_seconds,
            figures.epoch_seconds,
        )
    };
    let mut printed = Ok(());
    let report = |figures: train::Figures| {
        if printed.is_ok() {
            printed = print(&figures);
        }
    };
    train::train(behaviours, report).map_err(|error| CliError::Input(error.to_string()))?;
    Ok(printed?)
}

fn simulations(seconds: f64, as_json: bool) -> Result<(), CliError> {
    let span = Duration::try_from_secs_f64(seconds)
        .map_err(|_| CliError::Input(format!("--seconds {seconds}: must be a number of seconds")))?;
    if !as_json {
        outln!(
            "{:<14} {:<34} {:>16} {:>10}",
            "MODEL",
            "WHAT",
            "EVALUATIONS/S",
            "x SCALAR"
        )?;
    }
    for model in CapabilityModel::ALL {
        for (what, full) in [("simulation", false), ("simulation + features + image", true)] {
            let [scalar, fast] = alternately(model, full, span)?;
            if as_json {
                json::print(&json::bench_simulate(model, what, fast, fast / scalar))?;
            } else {
                outln!(
                    "{:<14} {what:<34} {fast:>16.0} {:>10.2}",
                    model.name(),
                    fast / scalar
                )?;
            }
        }
    }
    Ok(())
}

/// Evaluations a second, scalar and with this machine's best instructions: the same uniform sample of the paper's
/// controllers in turns, so that whatever else the machine does disturbs both alike.
fn alternately(model: CapabilityModel, full: bool, span: Duration) -> Result<[f64; 2], CliError> {
    let space = ControllerSpace::for_model(v1::ControllerSpace::default(), model)?;
    let mut stream = Stream::derive(1, Purpose::Propose, 0);
    let arches = [Arch::Scalar, Arch::new()];
    let mut evaluators = [evaluator(arches[0])?, evaluator(arches[1])?];
    let mut took = [Duration::ZERO; 2];
    let mut count = 0u32;
    while took[0] + took[1] < span {
        let (controller, start) = (space.sample(&mut stream), Start::seeded(stream.bits()));
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
