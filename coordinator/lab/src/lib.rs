//! `murmuration lab`: the commands for measurements and studies. Only the program `murmuration` depends on this crate.

mod accuracy;
mod atlas;
mod bench;
pub mod json;
mod judge;
mod known_campaigns;
mod label_curve;
mod study;

use clap::Subcommand;
use murmuration_cli::{Execution, Global};
use std::future::ready;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run, list and show studies: grids of campaigns with their measurements
    #[command(subcommand)]
    Study(study::StudyCommand),
    /// Evaluate and judge every controller of a robot, and draw a map of the verdicts
    Atlas(atlas::AtlasCommand),
    /// Measure how well an embedding agrees with labels
    Accuracy(accuracy::AccuracyCommand),
    /// Measure how well the rule-based judge agrees with labels
    Judge(judge::JudgeCommand),
    /// Measure the speed of this machine, and the accuracy that an embedding gains from labels
    #[command(subcommand)]
    Bench(bench::Bench),
}

impl Command {
    pub fn execute(self, global: &Global) -> Execution<'_> {
        match self {
            Self::Study(study) => Box::pin(study.execute(global)),
            Self::Atlas(atlas) => Box::pin(atlas.execute(global)),
            Self::Accuracy(accuracy) => Box::pin(accuracy.execute(global)),
            Self::Judge(judge) => Box::pin(ready(judge.execute(global))),
            Self::Bench(bench) => Box::pin(bench.execute(global)),
        }
    }
}
