//! `bench`: what this machine does.

use super::{CliError, json};
use murmuration_proto::{
    CapabilityModel, Controller, ControllerSpace, ImageFormat, Purpose, Stream, World, v1,
};
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
}

impl Bench {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let Self::Simulate { seconds } = self;
        let span = Duration::try_from_secs_f64(seconds)
            .map_err(|_| CliError::Input(format!("--seconds {seconds}: must be a number of seconds")))?;
        if !as_json {
            println!(
                "{:<14} {:<34} {:>16} {:>10}",
                "MODEL", "WHAT", "EVALUATIONS/S", "x SCALAR"
            );
        }
        for model in CapabilityModel::ALL {
            for (what, full) in [("simulation", false), ("simulation + features + image", true)] {
                let [scalar, fast] = alternately(model, full, span)?;
                if as_json {
                    json::print(&json::bench(model, what, fast, fast / scalar));
                } else {
                    println!(
                        "{:<14} {what:<34} {fast:>16.0} {:>10.2}",
                        model.name(),
                        fast / scalar
                    );
                }
            }
        }
        Ok(())
    }
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
