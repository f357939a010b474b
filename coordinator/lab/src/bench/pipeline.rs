//! `bench pipeline`: how the time of a latent campaign splits into stages.

use super::{
    SIMULATION, TRAINED_PICTURE,
    cluster::{BenchCampaign, PlainLoop, Took},
    process_cpu,
};
use crate::json;
use murmuration_cli::{
    CliError, Global,
    follow::stage_name,
    table::{Table, left, right},
};
use murmuration_coordinator::local::InProcess;
use murmuration_embed::Runtime;
use murmuration_link::errln;
use murmuration_proto::v1::CampaignStage;
use murmuration_swarm::{CampaignSpec, EmbedderSource, grouped};
use std::time::{Duration, Instant};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The single-sensor latent campaign from nothing to its taxonomy, with workers and a trainer of this process over loopback \
gRPC and a database in the folder for temporary files (TMPDIR): the time of each stage, read from the campaign's status \
twenty times a second, and the CPU time of the process meanwhile. Beside the whole stands the time that as many simulations \
as dataset and archive have take a plain loop on as many threads, reckoned from those of the archive.

Example:
  murmuration lab bench pipeline --controllers 1000 --generations 10")]
pub struct PipelineBench {
    /// Controllers of the dataset, with two pictures each
    #[arg(long, default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    controllers: u32,
    /// Generations of the search, of 100 controllers each
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    generations: u32,
    /// Workers of the campaign, and threads of the plain loop
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=256))]
    workers: u16,
}

/// Pictures of each controller of the dataset.
const STARTS: u32 = 2;

/// The measured stages, in order. The time of any other stage is added to the measured stage before it.
const STAGES: [CampaignStage; 4] = [
    CampaignStage::Dataset,
    CampaignStage::Pretrain,
    CampaignStage::Evolve,
    CampaignStage::Taxonomy,
];

/// Pause between two queries of the campaign's status.
const PAUSE: Duration = Duration::from_millis(50);

pub(super) struct Pipeline {
    /// The time of each stage in [`STAGES`].
    stages: [Took; 4],
    /// Simulations of the dataset and of the archive.
    simulations: u64,
    /// Minimum multiply-adds of the training.
    multiply_adds: u64,
    /// Time that a plain loop takes for `simulations` simulations.
    plain: Duration,
}

impl Pipeline {
    fn whole(&self) -> Duration {
        self.stages.iter().map(|took| took.wall).sum()
    }

    /// Minimum operations per simulation: the simulation's own operations, and its part of the training. A multiply-add counts as
    /// two operations.
    pub(super) const fn floor(&self) -> u64 {
        SIMULATION + 2 * self.multiply_adds / self.simulations
    }

    /// Simulations a second of the pipeline and of the plain loop.
    pub(super) fn rates(&self) -> [f64; 2] {
        [self.whole(), self.plain].map(|took| self.simulations as f64 / took.as_secs_f64())
    }
}

impl PipelineBench {
    /// Short version for `bench all`, with two workers.
    pub(super) const fn short(controllers: u32, generations: u32) -> Self {
        Self {
            controllers,
            generations,
            workers: 2,
        }
    }

    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let measured = self.measure().await?;
        let whole = measured.whole().as_secs_f64();
        let mut table = Table::new([
            left("STAGE"),
            right("SECONDS"),
            right("CPU SECONDS"),
            right("% OF THE TIME"),
        ]);
        for (stage, took) in STAGES.into_iter().zip(measured.stages) {
            let (seconds, cpu_seconds) = (took.wall.as_secs_f64(), took.cpu.as_secs_f64());
            let share = seconds / whole;
            if global.json {
                json::print(json::BenchPipeline {
                    stage: stage_name(stage),
                    seconds,
                    cpu_seconds,
                    share,
                    loop_seconds: measured.plain.as_secs_f64(),
                    simulations: measured.simulations,
                })?;
            }
            table.row([
                stage_name(stage).to_owned(),
                format!("{seconds:.2}"),
                format!("{cpu_seconds:.2}"),
                format!("{:.1}", 100.0 * share),
            ]);
        }
        if !global.json {
            table.print()?;
            errln!(
                "all: {whole:.2} s; its {} simulations in a plain loop: {:.2} s",
                grouped(measured.simulations),
                measured.plain.as_secs_f64()
            );
        }
        Ok(())
    }

    /// Runs the campaign, then the plain loop.
    pub(super) async fn measure(&self) -> Result<Pipeline, CliError> {
        // Without ONNX Runtime, the campaign would wait for a worker that can embed.
        Runtime::load()?;
        let spec = self.spec()?;
        let in_process = InProcess {
            workers: self.workers.into(),
            trainers: 1,
            ..InProcess::NONE
        };
        let mut stages = [Took::default(); 4];
        let mut before: Option<(usize, Instant, Duration)> = None;
        let finished = BenchCampaign::start(in_process, None)
            .await?
            .complete(&spec, PAUSE, |stage| {
                let (now, cpu_now) = (Instant::now(), process_cpu());
                if let Some((place, begun, cpu)) = before {
                    let took: &mut Took = &mut stages[place];
                    took.wall += now.saturating_duration_since(begun);
                    took.cpu += cpu_now.saturating_sub(cpu);
                }
                let place = STAGES.iter().position(|&known| known == stage);
                let place = place.unwrap_or(before.map_or(0, |(place, ..)| place));
                before = Some((place, now, cpu_now));
            })
            .await?;
        let tasks = finished.tasks()?;
        let plain = PlainLoop::new(&spec, None, self.workers.into())?.run(&tasks)?;
        let simulations = u64::from(self.controllers) * u64::from(STARTS) + spec.search().evaluations();
        Ok(Pipeline {
            stages,
            simulations,
            multiply_adds: self.multiply_adds(&spec),
            plain: plain.wall.mul_f64(simulations as f64 / tasks.len() as f64),
        })
    }

    /// Multiply-adds of the training: an epoch shows two pictures of every behaviour that is not held out.
    fn multiply_adds(&self, spec: &CampaignSpec) -> u64 {
        let Some(EmbedderSource::Trained { training, .. }) = spec.embedder() else {
            return 0;
        };
        let shown = u64::from(self.controllers) - training.held_out(self.controllers as usize) as u64;
        2 * shown * training.recipe().epochs() * TRAINED_PICTURE
    }

    fn spec(&self) -> Result<CampaignSpec, CliError> {
        let text = format!(
            "name = \"bench\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n\
             [dataset]\ncontrollers = {}\nstarts = {STARTS}\n[search]\npopulation = 100\ngenerations = {}\n",
            self.controllers, self.generations
        );
        CampaignSpec::from_toml(&text).map_err(CliError::failed)
    }
}
