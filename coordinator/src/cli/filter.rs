//! `filter`: how the heuristic filter scores controllers.

use super::{CliError, controller, json};
use murmuration_link::{InputKind, OutputError, errln, outln, read_text, text_of};
use murmuration_proto::Controller;
use murmuration_search::filter::{CUTOFF, METRICS, Score};
use serde_json::{Map, Value, json};
use std::{
    io,
    path::{Path, PathBuf},
};

/// Arguments of `filter`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  murmuration filter -0.7,0.3,1,1 0.6,1,0.4,0.5
  murmuration filter --file controllers.txt --json")]
pub(super) struct Filter {
    /// Controllers: 4 wheel speeds, or 8 and an angle
    #[arg(required_unless_present = "file")]
    controllers: Vec<String>,
    /// Also read controllers from a file, one a line (- for stdin)
    #[arg(long, value_name = "FILE")]
    file: Option<PathBuf>,
}

impl Filter {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let mut texts = self.controllers;
        if let Some(path) = &self.file {
            texts.extend(lines(path)?);
        }
        let controllers = texts
            .iter()
            .map(|text| controller::parse(text))
            .collect::<Result<Vec<_>, _>>()?;
        if as_json {
            controllers
                .iter()
                .map(to_json)
                .try_for_each(|scored| json::print(&scored))?;
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
    // Some editors put a mark of the byte order before a text.
    Ok(text
        .trim_start_matches('\u{feff}')
        .lines()
        .filter(|line| !line.trim().is_empty())
        .map(str::to_owned)
        .collect())
}

fn to_json(controller: &Controller) -> Value {
    let score = Score::of(controller);
    let metrics: Map<String, Value> = METRICS
        .iter()
        .zip(score.metrics())
        .map(|(metric, &value)| (metric.name.replace(' ', "_"), value.into()))
        .collect();
    json!({
        "schema": 1,
        "controller": controller.genes(),
        "metrics": metrics,
        "score": score.total(),
        "cutoff": CUTOFF,
        "passes": score.passes(),
    })
}

/// Each metric, a star where it is under its threshold.
fn print_table(controllers: &[Controller]) -> Result<(), OutputError> {
    let names = METRICS.map(|metric| format!("{:>17}", metric.name)).concat();
    outln!("{names}{:>9}  {:<9}CONTROLLER", "score", "")?;
    for controller in controllers {
        let score = Score::of(controller);
        let metrics = METRICS.iter().zip(score.metrics()).map(|(metric, value)| {
            let star = if *value < metric.threshold { "*" } else { " " };
            format!("{value:>16.3}{star}")
        });
        let metrics: String = metrics.collect();
        let verdict = if score.passes() { "passes" } else { "discarded" };
        outln!("{metrics}{:>9.3}  {verdict:<9} {controller}", score.total())?;
    }
    errln!("* under its threshold: counts as -5; a score under {CUTOFF} is discarded");
    Ok(())
}
