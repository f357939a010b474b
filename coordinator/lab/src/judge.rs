//! `judge`: how well the synthetic annotator and the second judge agree with annotators.

use crate::{
    accuracy::{document, starts_beside, starts_file, tell_counted},
    json,
};
use csv::Writer;
use murmuration_accuracy::{LabelledSet, Swarm};
use murmuration_cli::{
    CliError, Global,
    files::{FileType, Overwrite, check_outputs},
    table::{Table, left, right},
};
use murmuration_judge as judge;
use murmuration_link::{OutputError, outln};
use murmuration_model::labels::{ConfusionMatrix, to_cell};
use murmuration_sim::replay::replay_frames;
use murmuration_study::{second_judge_by, second_judge_measures};
use murmuration_swarm::{Class, Pattern, Verdict, counted, grouped};
use rayon::prelude::*;
use std::{collections::BTreeMap, iter, path::PathBuf};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The command simulates the labelled swarms and lets the rule-based judge and the second judge, which learned from labels, name the \
class of each. The file needs the columns \
index (or id), class, a column for each gene, robots unless they are the paper's, and seed unless starts are given; the paper's world is the default \
(docs/labels.md). The answers of the synthetic annotator are skipped, because the synthetic annotator is this judge.

Examples:
  murmuration labels latest --csv labels.csv && murmuration lab judge --labels labels.csv
  murmuration lab judge --labels single_sensor/validation.csv
  murmuration lab judge --labels two_sensor/validation.csv --labels rare/validation.csv --json")]
pub struct JudgeCommand {
    /// Labelled behaviours, as `murmuration labels --csv` writes them; repeat the option to join sets
    #[arg(long, required = true, value_name = "CSV")]
    labels: Vec<PathBuf>,
    /// Starts of the swarms, one file for each --labels [default: the column seed, else `starts.csv` beside the CSV]
    #[arg(long, value_name = "CSV")]
    starts: Vec<PathBuf>,
    /// Also write the second judge's measures of each swarm to this CSV, to train the second judge
    #[arg(long, value_name = "CSV")]
    measures: Option<PathBuf>,
    /// Also write the rule-based judge's verdict on each swarm, its pattern or else its class, to this CSV
    #[arg(long, value_name = "CSV")]
    verdicts: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl JudgeCommand {
    pub(super) fn execute(&self, global: &Global) -> Result<(), CliError> {
        self.check_starts()?;
        let outputs = [("--measures", &self.measures), ("--verdicts", &self.verdicts)];
        let outputs = outputs.map(|(option, table)| table.as_ref().map(|table| (option, table)));
        let outputs: Vec<_> = outputs.into_iter().flatten().collect();
        for &(option, table) in &outputs {
            FileType::Csv.check(option, table)?;
        }
        if !outputs.is_empty() {
            // Without --starts, the command reads the files of starts beside the labels.
            let beside: Vec<PathBuf> = match self.starts.is_empty() {
                true => self.labels.iter().map(|labels| starts_file(labels)).collect(),
                false => Vec::new(),
            };
            let inputs = self.labels.iter().chain(&self.starts).chain(&beside);
            check_outputs(outputs, inputs, self.overwrite)?;
        }
        let sets = self.labels.iter().map(LabelledSet::read);
        let sets = sets.collect::<Result<Vec<_>, _>>()?;
        let mut message = Vec::new();
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
            let judged = swarms.par_iter().map(Judged::of).collect::<Result<Vec<_>, _>>()?;
            for (seen, judged) in labels.patterns().zip(&judged) {
                patterns
                    .iter_mut()
                    .for_each(|counts| counts.count(seen, &judged.verdict));
            }
            let given = labels.ids().zip(labels.classes());
            let given = given.map(|(id, class)| (id.to_owned(), class.to_owned()));
            message.extend(given.zip(judged));
        }
        if let Some(table) = &self.measures {
            self.overwrite.write(table, measures_csv(&message))?;
        }
        if let Some(table) = &self.verdicts {
            self.overwrite.write(table, verdicts_csv(&message))?;
        }
        // Sets of one species have no patterns of two.
        let patterns: Vec<_> = patterns.into_iter().filter(PatternCounts::is_shown).collect();
        let opinions = Opinions::of(&message);
        if global.json {
            json::print(self.document(&opinions, &patterns, &sets, &without_meaning))?;
        } else {
            opinions.print()?;
            print_patterns(&patterns)?;
            tell_without_meaning(&without_meaning)?;
            tell_counted(&sets);
        }
        Ok(())
    }

    /// The file of starts for the swarms of a label file; `None` if the label file's seeds determine the starts.
    fn starts_of(&self, place: usize, labels: &LabelledSet) -> Result<Option<PathBuf>, CliError> {
        match self.starts.get(place) {
            Some(named) => Ok(Some(named.clone())),
            None => starts_beside(labels),
        }
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
        opinions: &Opinions<'_>,
        patterns: &[PatternCounts],
        sets: &[LabelledSet],
        without_meaning: &WithoutMeaning,
    ) -> json::Judge {
        json::Judge {
            set: document(&self.labels, sets),
            agreement: agreement(&opinions.first),
            second_judge: agreement(&opinions.second),
            judges_agreed: opinions.judges.same(),
            judges_kappa: opinions.judges.kappa(),
            all_agreed: opinions.all_agreed,
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

/// Numbers of swarms in whose world a class has no meaning, by class and reason.
type WithoutMeaning = BTreeMap<(Class, &'static str), u64>;

/// How often annotators and the judge see a pattern.
#[derive(Debug)]
struct PatternCounts {
    pattern: Pattern,
    /// Behaviours in which annotators see the pattern.
    given: u64,
    /// Behaviours in which annotators and the judge see the pattern.
    agreed: u64,
    /// Behaviours in which the judge sees the pattern.
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

    /// Counts a behaviour in which annotators saw the patterns `seen`, joined by `|`.
    fn count(&mut self, seen: &str, verdict: &Verdict) {
        let seen = seen.split('|').any(|name| name == self.pattern.name());
        let judged = verdict.pattern() == Some(self.pattern);
        self.given += u64::from(seen);
        self.agreed += u64::from(seen && judged);
        self.judged += u64::from(judged);
    }

    fn is_shown(&self) -> bool {
        !self.pattern.is_of_two_species() || self.given + self.judged > 0
    }

    const fn document(&self) -> json::PatternCounts {
        json::PatternCounts {
            given: self.given,
            agreed: self.agreed,
            judged: self.judged,
        }
    }
}

/// The verdicts of both judges on a swarm.
#[derive(Debug)]
struct Judged {
    /// The class of the whole swarm, whatever the species, as the second judge knows it.
    class: Class,
    /// The verdict with the species, if there are several.
    verdict: Verdict,
    second: Class,
    /// The measures that the second judge decides by.
    measures: Vec<f64>,
}

impl Judged {
    fn of(swarm: &Swarm) -> Result<Self, CliError> {
        let world = &swarm.world;
        let motion = replay_frames(&swarm.controller, world, &swarm.start, &judge::frames(world))?;
        let measures = second_judge_measures(&motion, world);
        let species = swarm.controller.species_of_robots(world.agents());
        Ok(Self {
            class: judge::judge(&motion, world).class(),
            verdict: judge::judge_species(&motion, &species, world),
            second: second_judge_by(&measures, world),
            measures,
        })
    }
}

/// A behaviour's id, the class of its label, and the verdicts of the judges.
type Said = ((String, String), Judged);

/// Agreement between each two of the labels, the rule-based judge and the second judge.
#[derive(Debug)]
struct Opinions<'a> {
    /// Labels against the rule-based judge.
    first: ConfusionMatrix<&'a str>,
    /// Labels against the second judge.
    second: ConfusionMatrix<&'a str>,
    /// The rule-based judge against the second judge.
    judges: ConfusionMatrix<&'a str>,
    /// Number of behaviours to which the labels and both judges give the same class.
    all_agreed: u64,
}

impl<'a> Opinions<'a> {
    fn of(message: &'a [Said]) -> Self {
        let opinions = message.iter().map(|((_, given), judged)| {
            let first = judged.class.name();
            (given.as_str(), first, judged.second.name())
        });
        Self {
            first: opinions.clone().map(|(given, first, _)| (given, first)).collect(),
            second: opinions
                .clone()
                .map(|(given, _, second)| (given, second))
                .collect(),
            judges: opinions
                .clone()
                .map(|(_, first, second)| (first, second))
                .collect(),
            all_agreed: opinions
                .filter(|(given, first, second)| given == first && first == second)
                .count() as u64,
        }
    }

    fn print(&self) -> Result<(), OutputError> {
        print_table(&self.first)?;
        outln!("\nThe second judge:")?;
        print_table(&self.second)?;
        let (agreed, all) = (self.judges.same(), self.judges.total());
        outln!(
            "\nBoth judges say the same of {} of {} ({}), Cohen's kappa {}; annotators say so too of {} of these",
            grouped(agreed),
            grouped(all),
            percent(agreed, all),
            kappa(&self.judges),
            grouped(self.all_agreed)
        )
    }
}

/// The measures of the second judge as CSV, one row per behaviour.
fn measures_csv(message: &[Said]) -> Vec<u8> {
    let count = message.first().map_or(0, |(_, judged)| judged.measures.len());
    let mut table = Writer::from_writer(Vec::new());
    let names = (1..=count).map(|place| format!("measure_{place}"));
    // Writing to memory cannot fail, and all rows have as many cells as the header.
    let _ = table.write_record(iter::once("id".to_owned()).chain(names));
    for ((id, _), judged) in message {
        let values = judged.measures.iter().map(f64::to_string);
        let _ = table.write_record(iter::once(to_cell(id).into_owned()).chain(values));
    }
    table.into_inner().unwrap_or_default()
}

/// The verdicts of the rule-based judge as CSV, one row per behaviour.
fn verdicts_csv(message: &[Said]) -> Vec<u8> {
    let mut table = Writer::from_writer(Vec::new());
    // Writing to memory cannot fail, and all rows have as many cells as the header.
    let _ = table.write_record(["id", "class"]);
    for ((id, _), judged) in message {
        let _ = table.write_record([to_cell(id).as_ref(), judged.verdict.name()]);
    }
    table.into_inner().unwrap_or_default()
}

fn agreement(matrix: &ConfusionMatrix<&str>) -> json::Agreement {
    let message = matrix.answers();
    let row = |class: &str| -> BTreeMap<String, u64> {
        let counts = message
            .iter()
            .map(|&judge| (judge.to_owned(), matrix.count(class, judge)));
        counts.filter(|&(_, count)| count > 0).collect()
    };
    json::Agreement {
        agreed: matrix.same(),
        kappa: matrix.kappa(),
        judged_by_class: message
            .iter()
            .map(|&class| (class.to_owned(), row(class)))
            .collect(),
    }
}

/// Reports the classes that have no meaning in the world of a swarm.
fn tell_without_meaning(without_meaning: &WithoutMeaning) -> Result<(), OutputError> {
    for ((class, why), &swarms) in without_meaning {
        outln!("\n{class} has no meaning for {}: {why}", counted(swarms, "swarm"))?;
    }
    Ok(())
}

/// Prints the judge's classes for each class that annotators gave.
fn print_table(matrix: &ConfusionMatrix<&str>) -> Result<(), OutputError> {
    let answers = matrix.answers();
    let fixed = [left("CLASS"), right("GIVEN"), right("AGREED"), right("SHARE")];
    let judged = answers.iter().map(|&judge| right(judge));
    let mut table = Table::new(fixed.into_iter().chain(judged));
    for &class in &answers {
        let (given, agreed) = (matrix.answered(class), matrix.count(class, class));
        let judged = answers.iter().map(|judge| grouped(matrix.count(class, judge)));
        table.row(counts(class, given, agreed).into_iter().chain(judged));
    }
    table.row(counts("all", matrix.total(), matrix.same()));
    table.print()?;
    outln!("Cohen's kappa {}", kappa(matrix))
}

fn kappa(matrix: &ConfusionMatrix<&str>) -> String {
    let kappa = matrix.kappa();
    kappa.map_or("-".to_owned(), |kappa| format!("{kappa:.3}"))
}

/// Prints the patterns among behaviours of the class `random`, if annotators named them.
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

/// The cells of a row: a name, the number of behaviours to which annotators gave the name, and how many of these have the name
/// from the judge too.
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
