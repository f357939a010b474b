//! `study`: grids of campaigns, and what is measured of them.

mod campaign;
mod labelled;
mod measuring;
mod progress;
mod run;
mod shown;

use super::{
    CliError, Global,
    files::read_words,
    json,
    table::{Table, left, right},
};
use murmuration_link::{InputKind, outln};
use murmuration_study::{
    BehavioursError, Corrections, FolderError, KeptStudy, Outcome, ReportError, StudyFolder, studies,
    write_report,
};
use std::path::{Path, PathBuf};

/// What to do with studies.
#[derive(Debug, clap::Subcommand)]
pub(super) enum StudyCommand {
    /// Run the campaigns of a study that have not run yet, measure them, and write the report
    Run(run::RunStudy),
    /// List the studies of the data directory
    List,
    /// Show the tables of a study
    Show {
        /// Name of the study
        study: String,
    },
    /// Write the report of a study
    Report(ReportStudy),
}

/// Arguments of `study report`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The report's medoids.csv has a row for each judged individual. To name behaviours yourself, change `class`, and `by` to your \
name, in a copy of it.

Example:
  murmuration study report small --classes my-classes.csv")]
pub(super) struct ReportStudy {
    /// Name of the study
    study: String,
    /// Classes that people gave instead of the judge: the columns cell, index, class and by of medoids.csv
    #[arg(long, value_name = "CSV")]
    classes: Option<PathBuf>,
    /// Folder for the report [default: the folder of the study in the data directory]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl StudyCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        match self {
            Self::Run(run) => run.execute(global).await,
            Self::List => list(global),
            Self::Show { study } => {
                let (_, outcome) = kept(&global.data, &study, Corrections::default())?;
                shown::show(&outcome, None, global.json)
            }
            Self::Report(report) => report.execute(global),
        }
    }
}

impl ReportStudy {
    fn execute(self, global: &Global) -> Result<(), CliError> {
        let corrections = match &self.classes {
            Some(path) => {
                let corrections = Corrections::parse(&read_words(path, InputKind::Labels)?);
                corrections.map_err(|error| CliError::Input(format!("{}: {error}", path.display())))?
            }
            None => Corrections::default(),
        };
        let (folder, outcome) = kept(&global.data, &self.study, corrections)?;
        let files = write_report(&outcome, self.out.as_deref().unwrap_or(folder.path()))?;
        match global.json {
            true => shown::show(&outcome, Some(&files.page), true),
            false => Ok(outln!("{}", files.page.display())?),
        }
    }
}

/// A study of a data directory, with what was measured of it.
fn kept(data: &Path, name: &str, corrections: Corrections) -> Result<(StudyFolder, Outcome), CliError> {
    let KeptStudy {
        folder,
        study,
        measures,
    } = StudyFolder::open(data, name)?;
    let measured = folder.all_measured(&study, &measures)?;
    Ok((folder, Outcome::new(study, measured, corrections)))
}

fn list(global: &Global) -> Result<(), CliError> {
    let mut listed = Vec::new();
    for name in studies(&global.data)? {
        let (_, outcome) = kept(&global.data, &name, Corrections::default())?;
        listed.push(json::ListedStudy {
            study: name,
            cells: outcome.study().cells().len(),
            measured: outcome.cells().count(),
        });
    }
    if global.json {
        return Ok(json::print_all(listed)?);
    }
    let mut table = Table::new([left("STUDY"), right("CELLS"), right("MEASURED")]);
    for study in listed {
        table.row([study.study, study.cells.to_string(), study.measured.to_string()]);
    }
    Ok(table.print()?)
}

impl From<FolderError> for CliError {
    fn from(error: FolderError) -> Self {
        let said = error.to_string();
        match error {
            FolderError::NoStudy { .. } => Self::Input(said),
            _ => Self::Failed(said),
        }
    }
}

impl From<ReportError> for CliError {
    fn from(error: ReportError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<BehavioursError> for CliError {
    fn from(error: BehavioursError) -> Self {
        Self::Failed(error.to_string())
    }
}
