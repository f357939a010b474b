//! `judge`: how well the synthetic annotator agrees with people.

use super::{
    CliError, Global,
    files::{behaviours, is_there, synthetic, tell_counted},
    json,
    table::{Table, left, right},
};
use murmuration_accuracy::{LabelledSet, Swarm};
use murmuration_judge as judge;
use murmuration_link::{OutputError, outln};
use murmuration_model::labels::ConfusionMatrix;
use murmuration_proto::{Class, Pattern, Verdict, counted, grouped};
use murmuration_worker::replay::replay_frames;
use rayon::prelude::*;
use std::{collections::BTreeMap, path::PathBuf};

/// Arguments of `judge`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The command simulates the labelled swarms and lets the rule-based judge name the class of each. The file needs the columns \
index (or id), class, a column for each gene, robots unless they are the paper's, and seed unless starts are given; the paper's world is the default \
(docs/labels.md). The answers of the synthetic annotator are skipped, because the synthetic annotator is this judge.

Examples:
  murmuration labels latest --csv labels.csv && murmuration judge --labels labels.csv
  murmuration judge --labels single_sensor/validation.csv
  murmuration judge --labels two_sensor/validation.csv --labels rare/validation.csv --json")]
pub(super) struct JudgeCommand {
    /// Labelled behaviours, as `murmuration labels --csv` writes them; repeat the option to join sets
    #[arg(long, required = true, value_name = "CSV")]
    labels: Vec<PathBuf>,
    /// Starts of the swarms, one file for each --labels [default: the column seed, else `starts.csv` beside the CSV]
    #[arg(long, value_name = "CSV")]
    starts: Vec<PathBuf>,
}

impl JudgeCommand {
    pub(super) fn execute(&self, global: &Global) -> Result<(), CliError> {
        self.check_starts()?;
        let sets = self.labels.iter().map(LabelledSet::read);
        let sets = sets.collect::<Result<Vec<_>, _>>()?;
        let mut answers = Vec::new();
        let mut patterns = Pattern::ALL.map(PatternCounts::of);
        let mut without_meaning = BTreeMap::new();
        for (place, labels) in sets.iter().enumerate() {
            let swarms = labels.swarms(self.starts_of(place, labels)?.as_deref())?;
            for swarm in &swarms {
                let reasons =
                    Class::ALL.map(|class| class.without_meaning(&swarm.world).map(|why| (class, why)));
                for reason in reasons.into_iter().flatten() {
                    *without_meaning.entry(reason).or_insert(0) += 1;
                }
            }
            let verdicts = swarms.par_iter().map(verdict).collect::<Result<Vec<_>, _>>()?;
            for (seen, verdict) in labels.patterns().zip(&verdicts) {
                patterns.iter_mut().for_each(|counts| counts.count(seen, verdict));
            }
            let classes = labels.classes().map(str::to_owned);
            answers.extend(classes.zip(verdicts.iter().map(|verdict| verdict.class().name())));
        }
        let pairs = answers.iter().map(|(people, judge)| (people.as_str(), *judge));
        let matrix: ConfusionMatrix<&str> = pairs.collect();
        if global.json {
            json::print(self.document(&matrix, &patterns, &sets, &without_meaning))?;
        } else {
            print_table(&matrix)?;
            print_patterns(&patterns)?;
            tell_without_meaning(&without_meaning)?;
            tell_counted(&sets);
        }
        Ok(())
    }

    /// Where the swarms of a file start, if it does not say so itself.
    fn starts_of(&self, place: usize, labels: &LabelledSet) -> Result<Option<PathBuf>, CliError> {
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
            "{} --starts for {} --labels: give one --starts for each --labels, in the same order",
            self.starts.len(),
            self.labels.len()
        )))
    }

    fn document(
        &self,
        matrix: &ConfusionMatrix<&str>,
        patterns: &[PatternCounts],
        sets: &[LabelledSet],
        without_meaning: &WithoutMeaning,
    ) -> json::Judge {
        let said = matrix.answers();
        let row = |class: &str| -> BTreeMap<String, u64> {
            let counts = said
                .iter()
                .map(|&judge| (judge.to_owned(), matrix.count(class, judge)));
            counts.filter(|&(_, count)| count > 0).collect()
        };
        json::Judge {
            set: json::Set {
                labels: self
                    .labels
                    .iter()
                    .map(|labels| labels.display().to_string())
                    .collect(),
                behaviours: behaviours(sets),
                synthetic_left_out: synthetic(sets),
            },
            agreed: matrix.same(),
            kappa: matrix.kappa(),
            judged_by_class: said.iter().map(|&class| (class.to_owned(), row(class))).collect(),
            without_meaning: without_meaning
                .iter()
                .map(|(&(class, _), &swarms)| (class.name().to_owned(), swarms))
                .collect(),
            patterns: patterns
                .iter()
                .map(|counts| (counts.pattern.name().to_owned(), counts.document()))
                .collect(),
        }
    }
}

/// Numbers of swarms in whose world a class has no meaning, and why it has none.
type WithoutMeaning = BTreeMap<(Class, &'static str), u64>;

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
        let judged = verdict.pattern() == Some(self.pattern);
        self.given += u64::from(seen);
        self.agreed += u64::from(seen && judged);
        self.judged += u64::from(judged);
    }

    const fn document(&self) -> json::PatternCounts {
        json::PatternCounts {
            given: self.given,
            agreed: self.agreed,
            judged: self.judged,
        }
    }
}

fn verdict(swarm: &Swarm) -> Result<Verdict, CliError> {
    let world = &swarm.world;
    let motion = replay_frames(&swarm.controller, world, &swarm.start, &judge::frames(world))?;
    Ok(judge::judge(&motion, world))
}

/// Which classes the judge could not answer with.
fn tell_without_meaning(without_meaning: &WithoutMeaning) -> Result<(), OutputError> {
    for ((class, why), &swarms) in without_meaning {
        outln!("\n{class} has no meaning for {}: {why}", counted(swarms, "swarm"))?;
    }
    Ok(())
}

/// For each class that people gave, what the judge said.
fn print_table(matrix: &ConfusionMatrix<&str>) -> Result<(), OutputError> {
    let answers = matrix.answers();
    let fixed = [left("CLASS"), right("GIVEN"), right("AGREED"), right("SHARE")];
    let judged = answers.iter().map(|&judge| right(judge));
    let mut table = Table::new(fixed.into_iter().chain(judged));
    for &class in &answers {
        let (given, agreed) = (matrix.said(class), matrix.count(class, class));
        let judged = answers.iter().map(|judge| grouped(matrix.count(class, judge)));
        table.row(counts(class, given, agreed).into_iter().chain(judged));
    }
    table.row(counts("all", matrix.total(), matrix.same()));
    table.print()?;
    let kappa = matrix
        .kappa()
        .map_or("-".to_owned(), |kappa| format!("{kappa:.3}"));
    outln!("Cohen's kappa {kappa}")
}

/// The patterns among what belongs to no class, where people named them.
fn print_patterns(patterns: &[PatternCounts]) -> Result<(), OutputError> {
    let mut table = Table::new([
        left("PATTERN"),
        right("GIVEN"),
        right("AGREED"),
        right("SHARE"),
        right("JUDGED"),
    ]);
    for shown in patterns {
        let judged = grouped(shown.judged);
        table.row(
            counts(shown.pattern.name(), shown.given, shown.agreed)
                .into_iter()
                .chain([judged]),
        );
    }
    outln!("")?;
    table.print()
}

/// How many of those that people gave a name have it from the judge too.
fn counts(name: &str, given: u64, agreed: u64) -> [String; 4] {
    [
        name.to_owned(),
        grouped(given),
        grouped(agreed),
        percent(agreed, given),
    ]
}

fn percent(part: u64, whole: u64) -> String {
    if whole == 0 {
        return "-".to_owned();
    }
    format!("{:.1} %", 100.0 * part as f64 / whole as f64)
}
