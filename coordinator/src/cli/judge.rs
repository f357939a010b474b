//! `judge`: how well the synthetic annotator agrees with people.

use super::{
    CliError, Global,
    files::{is_there, synthetic, tell_counted},
    json,
};
use murmuration_accuracy::{Labels, Swarm};
use murmuration_judge as judge;
use murmuration_judge::{Pattern, Verdict};
use murmuration_link::{OutputError, outln};
use murmuration_model::labels::ConfusionMatrix;
use murmuration_worker::replay::replay_frames;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::path::PathBuf;

/// Arguments of `judge`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Simulates the labelled swarms again and lets the rule-based judge name the class of each. A file has columns id, class, \
v1 to v4 (or v1 to v8 and theta), and seed unless starts are given; the world is the paper's where it does not say \
(docs/labels.md). What the synthetic annotator answered is left out: it is this judge.

Examples:
  murmuration labels latest --csv labels.csv && murmuration judge --labels labels.csv
  murmuration judge --labels single_sensor/validation.csv
  murmuration judge --labels two_sensor/validation.csv --labels rare/validation.csv --json")]
pub(super) struct JudgeCommand {
    /// Labelled behaviours, such as `murmuration labels --csv` writes; repeat it to join sets
    #[arg(long, required = true, value_name = "CSV")]
    labels: Vec<PathBuf>,
    /// Where their swarms start, one for each --labels [default: column seed, or else `starts.csv` beside the CSV]
    #[arg(long, value_name = "CSV")]
    starts: Vec<PathBuf>,
}

impl JudgeCommand {
    pub(super) fn execute(&self, global: &Global) -> Result<(), CliError> {
        self.check_starts()?;
        let sets = self.labels.iter().map(Labels::read);
        let sets = sets.collect::<Result<Vec<_>, _>>()?;
        let mut answers = Vec::new();
        let mut patterns = Pattern::ALL.map(PatternCounts::of);
        for (place, labels) in sets.iter().enumerate() {
            let verdicts = labels
                .swarms(self.starts_of(place, labels)?.as_deref())?
                .par_iter()
                .map(verdict)
                .collect::<Result<Vec<_>, _>>()?;
            for (seen, verdict) in labels.patterns().zip(&verdicts) {
                patterns.iter_mut().for_each(|counts| counts.count(seen, verdict));
            }
            let classes = labels.classes().map(str::to_owned);
            answers.extend(classes.zip(verdicts.iter().map(|verdict| verdict.class.name())));
        }
        let pairs = answers.iter().map(|(people, judge)| (people.as_str(), *judge));
        let matrix: ConfusionMatrix<&str> = pairs.collect();
        if global.json {
            json::print(&self.to_json(&matrix, &patterns, synthetic(&sets)))?;
        } else {
            print_table(&matrix)?;
            print_patterns(&patterns)?;
            tell_counted(&sets);
        }
        Ok(())
    }

    /// Where the swarms of a file start, if it does not say so itself.
    fn starts_of(&self, place: usize, labels: &Labels) -> Result<Option<PathBuf>, CliError> {
        if let Some(named) = self.starts.get(place) {
            return Ok(Some(named.clone()));
        }
        let beside = labels.path().with_file_name("starts.csv");
        Ok((!labels.can_be_simulated() && is_there(&beside)?).then_some(beside))
    }

    fn check_starts(&self) -> Result<(), CliError> {
        if self.starts.is_empty() || self.starts.len() == self.labels.len() {
            return Ok(());
        }
        Err(CliError::Input(format!(
            "{} --starts for {} --labels: give one for each, in the same order",
            self.starts.len(),
            self.labels.len()
        )))
    }

    fn to_json(&self, matrix: &ConfusionMatrix<&str>, patterns: &[PatternCounts], synthetic: u64) -> Value {
        let said = matrix.answers();
        let row = |class: &str| -> Map<String, Value> {
            let counts = said.iter().map(|&judge| (judge, matrix.count(class, judge)));
            let counted = counts.filter(|&(_, count)| count > 0);
            counted
                .map(|(judge, count)| (judge.to_owned(), count.into()))
                .collect()
        };
        let by_class: Map<String, Value> = said
            .iter()
            .map(|&class| (class.to_owned(), row(class).into()))
            .collect();
        let patterns: Map<String, Value> = patterns
            .iter()
            .map(|counts| (counts.pattern.name().to_owned(), counts.to_json()))
            .collect();
        json!({
            "schema": json::SCHEMA,
            "labels": self.labels.iter().map(|labels| labels.display().to_string()).collect::<Vec<_>>(),
            "behaviours": matrix.total(),
            "synthetic_left_out": synthetic,
            "agreed": matrix.same(),
            "kappa": matrix.kappa(),
            "judged_by_class": by_class,
            "patterns": patterns,
        })
    }
}

/// How often a pattern was seen.
#[derive(Debug)]
struct PatternCounts {
    pattern: Pattern,
    /// By people.
    given: u64,
    /// By people and the judge.
    agreed: u64,
    /// By the judge.
    judged: u64,
}

impl PatternCounts {
    const fn of(pattern: Pattern) -> Self {
        Self {
            pattern,
            given: 0,
            agreed: 0,
            judged: 0,
        }
    }

    /// Counts a behaviour in which people saw the patterns `seen`, joined by `|`.
    fn count(&mut self, seen: &str, verdict: &Verdict) {
        let seen = seen.split('|').any(|name| name == self.pattern.name());
        let judged = verdict.pattern == Some(self.pattern);
        self.given += u64::from(seen);
        self.agreed += u64::from(seen && judged);
        self.judged += u64::from(judged);
    }

    fn to_json(&self) -> Value {
        json!({"given": self.given, "agreed": self.agreed, "judged": self.judged})
    }
}

fn verdict(swarm: &Swarm) -> Result<Verdict, CliError> {
    let world = &swarm.world;
    let motion = replay_frames(&swarm.controller, world, &swarm.start, &judge::frames(world))?;
    Ok(judge::judge(&motion, world))
}

/// For each class that people gave, what the judge said.
fn print_table(matrix: &ConfusionMatrix<&str>) -> Result<(), OutputError> {
    let answers = matrix.answers();
    let row = |cell: &dyn Fn(&str) -> String| answers.iter().map(|judge| cell(judge)).collect::<String>();
    let judged = row(&|judge| format!("{judge:>16}"));
    outln!(
        "{:<16}{:>8}{:>8}{:>10}{judged}",
        "CLASS",
        "GIVEN",
        "AGREED",
        "SHARE"
    )?;
    for class in &answers {
        let (given, agreed) = (matrix.said(class), matrix.count(class, class));
        let judged = row(&|judge| format!("{:>16}", matrix.count(class, judge)));
        outln!(
            "{class:<16}{given:>8}{agreed:>8}{:>10}{judged}",
            percent(agreed, given)
        )?;
    }
    let (all, same) = (matrix.total(), matrix.same());
    outln!("{:<16}{all:>8}{same:>8}{:>10}", "all", percent(same, all))?;
    let kappa = matrix
        .kappa()
        .map_or("-".to_owned(), |kappa| format!("{kappa:.3}"));
    outln!("Cohen's kappa {kappa}")
}

/// The patterns among what belongs to no class, where people named them.
fn print_patterns(patterns: &[PatternCounts]) -> Result<(), OutputError> {
    outln!(
        "\n{:<16}{:>8}{:>8}{:>10}{:>16}",
        "PATTERN",
        "GIVEN",
        "AGREED",
        "SHARE",
        "JUDGED"
    )?;
    for PatternCounts {
        pattern,
        given,
        agreed,
        judged,
    } in patterns
    {
        let share = percent(*agreed, *given);
        outln!("{pattern:<16}{given:>8}{agreed:>8}{share:>10}{judged:>16}")?;
    }
    Ok(())
}

fn percent(part: u64, whole: u64) -> String {
    if whole == 0 {
        return "-".to_owned();
    }
    format!("{:.1} %", 100.0 * part as f64 / whole as f64)
}
