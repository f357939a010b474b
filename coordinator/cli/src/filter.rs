//! `filter`: the heuristic filter's scores of controllers.

use super::{
    CliError, controller, json,
    robots::RobotArgs,
    table::{Table, left, right},
};
use murmuration_files::{InputKind, read_text, text_of};
use murmuration_link::{OutputError, errln};
use murmuration_search::filter::{CUTOFF, METRICS, Score};
use murmuration_swarm::Controller;
use std::{
    io,
    path::{Path, PathBuf},
};

#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("controller").args(["controllers", "file"]).multiple(true).required(true),
    after_help = "\
Without an option for robots, the robots are the paper's robots with that number of genes. For several species, the metrics are \
of the species with the highest score. docs/campaigns.md describes the metrics.

Examples:
  murmuration filter -0.7,0.3,1,1 0.6,1,0.4,0.5
  murmuration filter --model turbopi 5,1,10,-1
  murmuration filter --file controllers.txt --json"
)]
pub struct Filter {
    /// Controllers as numbers separated by commas; for the paper's robots, 4 wheel speeds, or 8 and an angle
    controllers: Vec<String>,
    /// File of further controllers, one a line; - reads stdin
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    robots: RobotArgs,
}

impl Filter {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let mut texts = self.controllers;
        if let Some(path) = &self.file {
            texts.extend(lines(path)?);
        }
        let (model, ..) = self.robots.read()?;
        let controllers = texts
            .iter()
            .map(|text| controller::parse(text, model.as_ref()))
            .collect::<Result<Vec<_>, _>>()?;
        if as_json {
            json::print_all(controllers.iter().map(document))?;
        } else {
            print_table(&controllers)?;
        }
        Ok(())
    }
}

fn lines(path: &Path) -> Result<Vec<String>, CliError> {
    let read = if path == Path::new("-") {
        text_of(io::stdin(), InputKind::Controllers)
    } else {
        read_text(path, InputKind::Controllers)
    };
    let text = read.map_err(|error| CliError::unreadable(path, &error))?;
    // Some editors put a byte order mark before a text.
    Ok(text
        .trim_start_matches('\u{feff}')
        .lines()
        .filter(|line| !line.trim().is_empty())
        .map(str::to_owned)
        .collect())
}

fn document(controller: &Controller) -> json::FilterScore {
    let score = Score::of(controller);
    let metrics = METRICS.iter().zip(score.metrics());
    json::FilterScore {
        controller: controller.genes().to_vec(),
        metrics: metrics
            .map(|(metric, &value)| (metric.name.replace(' ', "_"), value))
            .collect(),
        score: score.total(),
        cutoff: CUTOFF,
        passes: score.passes(),
    }
}

/// Prints each metric, with a star if it is below its threshold.
fn print_table(controllers: &[Controller]) -> Result<(), OutputError> {
    let metrics = METRICS.map(|metric| right(metric.name.to_uppercase()));
    let others = [right("SCORE"), left("VERDICT"), left("CONTROLLER")];
    let mut table = Table::new(metrics.into_iter().chain(others));
    for controller in controllers {
        let score = Score::of(controller);
        let metrics = METRICS.iter().zip(score.metrics()).map(|(metric, value)| {
            let star = if *value < metric.threshold { "*" } else { " " };
            format!("{value:.3}{star}")
        });
        let verdict = if score.passes() { "passes" } else { "discarded" };
        let others = [
            format!("{:.3}", score.total()),
            verdict.to_owned(),
            controller.to_string(),
        ];
        table.row(metrics.chain(others));
    }
    table.print()?;
    errln!("* below its threshold, counts as -5; controllers with a score below {CUTOFF} are discarded");
    Ok(())
}
