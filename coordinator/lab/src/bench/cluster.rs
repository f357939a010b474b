//! `bench cluster`: the cost of coordinator, network and disk compared to the evaluations alone.

mod campaign;
mod null_worker;
mod plain_loop;

use super::{process_cpu, thread_cpu};
use crate::json;
pub(super) use campaign::BenchCampaign;
use murmuration_cli::{
    CliError, Global,
    files::read,
    table::{Table, left, right},
};
use murmuration_coordinator::local::InProcess;
use murmuration_files::InputKind;
use murmuration_link::{OutputError, errln};
use murmuration_swarm::{CampaignSpec, CheckpointDigest, grouped};
use null_worker::NullWorker;
pub(super) use plain_loop::PlainLoop;
use std::{
    path::{Path, PathBuf},
    time::Duration,
};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
A campaign at the paper's size, with workers of this process over loopback gRPC and a database in the folder for \
temporary files (TMPDIR), from its start to the commit of its last generation. Beside it, in turns, the same controllers in \
a plain loop on as many threads, without a coordinator. The CPU time of the campaign is that of workers and coordinator.

Null evaluations: one worker answers at once with pictures of real swarms and made-up features, so that the coordinator \
alone is measured. Its CPU time includes breeding, novelty, network and database, and leaves out the thread of that worker.

Each figure is the best of all rounds.

Examples:
  murmuration lab bench cluster --generations 20 --rounds 1
  murmuration lab bench cluster --generations 1 --rounds 1 --null-generations 1000 --keep million")]
pub struct ClusterBench {
    /// Workers of the campaign, and threads of the plain loop
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=256))]
    workers: u16,
    /// Generations of the campaign, of 100 controllers each
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    generations: u32,
    /// Generations of null evaluations, of 1,000 null evaluations each
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    null_generations: u32,
    /// Measurements of each kind
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=1000))]
    rounds: u16,
    /// ONNX file of an embedder: also measure a campaign whose workers embed
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Measure null evaluations once, in this data directory, and keep the directory
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Took {
    pub(super) wall: Duration,
    pub(super) cpu: Duration,
}

/// The best of several rounds, and the number of evaluations per round.
#[derive(Debug, Clone, Copy)]
struct Best {
    results: u64,
    wall: Duration,
    cpu: Duration,
}

impl Best {
    fn of(results: u64, rounds: &[Took]) -> Self {
        let walls = rounds.iter().map(|took| took.wall);
        let cpus = rounds.iter().map(|took| took.cpu);
        Self {
            results,
            wall: walls.min().unwrap_or_default(),
            cpu: cpus.min().unwrap_or_default(),
        }
    }

    fn per_second(self) -> f64 {
        self.results as f64 / self.wall.as_secs_f64()
    }

    fn cpu_seconds_each(self) -> f64 {
        self.cpu.as_secs_f64() / self.results as f64
    }
}

impl ClusterBench {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(folder) = &self.keep {
            new_folder(folder)?;
        }
        let mut table = Table::new([
            left("WHAT"),
            right("RESULTS"),
            right("RESULTS/S"),
            right("LOOP/S"),
            right("RATIO"),
            right("CPU µS/RESULT"),
            right("LOOP CPU µS"),
        ]);
        let mut told = |what: &'static str, workers: u16, best: Best, plain: Option<Best>| {
            errln!("measured: {what}");
            tell(
                &mut table,
                global.json,
                Figures {
                    what,
                    workers,
                    best,
                    plain,
                },
            )
        };
        let (campaign, plain) = self.beside_loop(&self.hand_crafted()?, None).await?;
        told("campaign", self.workers, campaign, Some(plain))?;
        if let Some(file) = &self.checkpoint {
            let model = read(file, InputKind::Checkpoint)?;
            let spec = self.latent(CheckpointDigest::of(&model))?;
            let (campaign, plain) = self.beside_loop(&spec, Some(model)).await?;
            told("campaign that embeds", self.workers, campaign, Some(plain))?;
        }
        if self.keep.is_none() {
            let best = self.null_evaluations(100).await?;
            told("null evaluations, generations of 100", 1, best, None)?;
        }
        let best = self.null_evaluations(1000).await?;
        told("null evaluations, generations of 1,000", 1, best, None)?;
        if !global.json {
            table.print()?;
        }
        Ok(())
    }

    /// Short version for `bench all`: two workers, the best of three rounds.
    pub(super) const fn short(generations: u32, null_generations: u32) -> Self {
        Self {
            workers: 2,
            generations,
            null_generations,
            rounds: 3,
            checkpoint: None,
            keep: None,
        }
    }

    /// Results a second of a campaign, and of a plain loop over the same controllers.
    pub(super) async fn campaign_and_loop(&self) -> Result<[f64; 2], CliError> {
        let (campaign, plain) = self.beside_loop(&self.hand_crafted()?, None).await?;
        Ok([campaign.per_second(), plain.per_second()])
    }

    /// Null results per second of the coordinator's CPU time.
    pub(super) async fn null_results(&self) -> Result<f64, CliError> {
        Ok(self.null_evaluations(1000).await?.cpu_seconds_each().recip())
    }

    /// Runs the same controllers in a campaign and in a plain loop, in turns.
    async fn beside_loop(
        &self,
        spec: &CampaignSpec,
        model: Option<Vec<u8>>,
    ) -> Result<(Best, Best), CliError> {
        let in_process = InProcess {
            workers: self.workers.into(),
            ..InProcess::NONE
        };
        let (mut campaigns, mut loops, mut results) = (Vec::new(), Vec::new(), 0);
        for round in 1..=self.rounds {
            let bench = BenchCampaign::start(in_process, model.clone()).await?;
            let finished = bench.run(spec).await?;
            let (took, tasks) = (finished.took, finished.tasks()?);
            let plain = PlainLoop::new(spec, model.as_deref(), self.workers.into())?;
            let alone = plain.run(&tasks)?;
            errln!(
                "round {round}: campaign {:.3} s, plain loop {:.3} s",
                took.wall.as_secs_f64(),
                alone.wall.as_secs_f64()
            );
            results = tasks.len() as u64;
            campaigns.push(took);
            loops.push(alone);
        }
        Ok((Best::of(results, &campaigns), Best::of(results, &loops)))
    }

    /// Runs a campaign whose evaluations cost nothing, to measure the coordinator: as many of them for each population.
    async fn null_evaluations(&self, population: u32) -> Result<Best, CliError> {
        let generations = self.null_generations * 1000 / population;
        let spec = spec(&format!(
            "method = \"hand-crafted\"\n[search]\npopulation = {population}\ngenerations = {generations}\n",
        ))?;
        let mut rounds = Vec::new();
        // A kept folder holds the campaign of one round.
        let count = if self.keep.is_some() { 1 } else { self.rounds };
        for _ in 0..count {
            let bench = match &self.keep {
                Some(folder) => BenchCampaign::start_kept(folder).await?,
                None => BenchCampaign::start(InProcess::NONE, None).await?,
            };
            let worker = NullWorker::start(bench.way(), &spec)?;
            let took = bench.run(&spec).await?.took;
            let cpu = took.cpu.saturating_sub(worker.end()?);
            rounds.push(Took { cpu, ..took });
        }
        Ok(Best::of(spec.evaluations(), &rounds))
    }

    fn hand_crafted(&self) -> Result<CampaignSpec, CliError> {
        spec(&format!(
            "method = \"hand-crafted\"\n[search]\npopulation = 100\ngenerations = {}\n",
            self.generations
        ))
    }

    fn latent(&self, checkpoint: CheckpointDigest) -> Result<CampaignSpec, CliError> {
        spec(&format!(
            "method = \"latent\"\ncheckpoint = \"{checkpoint}\"\n[search]\npopulation = 100\ngenerations = {}\n",
            self.generations
        ))
    }
}

/// Creates a new folder, so that no made-up campaigns get into a real data directory.
fn new_folder(folder: &Path) -> Result<(), CliError> {
    let refused = |why: &dyn std::fmt::Display| {
        let message = format!(
            "--keep {}: {why}; name a folder that is new or empty",
            folder.display()
        );
        Err(CliError::Input(message))
    };
    match std::fs::create_dir_all(folder).and_then(|()| std::fs::read_dir(folder)) {
        Ok(mut entries) => match entries.next() {
            Some(_) => refused(&"the folder is not empty"),
            None => Ok(()),
        },
        Err(error) => refused(&error),
    }
}

fn spec(text: &str) -> Result<CampaignSpec, CliError> {
    let text = format!("name = \"bench\"\nmodel = \"single-sensor\"\n{text}");
    CampaignSpec::from_toml(&text).map_err(CliError::failed)
}

/// The figures of a row.
struct Figures {
    what: &'static str,
    workers: u16,
    best: Best,
    plain: Option<Best>,
}

fn tell(table: &mut Table, as_json: bool, figures: Figures) -> Result<(), OutputError> {
    let Figures {
        what,
        workers,
        best,
        plain,
    } = figures;
    let ratio = plain.map(|plain| best.per_second() / plain.per_second());
    if as_json {
        return json::print(json::BenchCluster {
            what,
            workers,
            results: best.results,
            results_per_second: best.per_second(),
            cpu_seconds_per_result: best.cpu_seconds_each(),
            loop_results_per_second: plain.map(Best::per_second),
            loop_cpu_seconds_per_result: plain.map(Best::cpu_seconds_each),
            ratio_to_loop: ratio,
        });
    }
    let or_none = |figure: Option<String>| figure.unwrap_or_else(|| "-".to_owned());
    let micros = |best: Best| format!("{:.1}", 1e6 * best.cpu_seconds_each());
    let rate = |best: Best| grouped(best.per_second().round() as u64);
    table.row([
        what.to_owned(),
        grouped(best.results),
        rate(best),
        or_none(plain.map(rate)),
        or_none(ratio.map(|ratio| format!("{ratio:.3}"))),
        micros(best),
        or_none(plain.map(micros)),
    ]);
    Ok(())
}
