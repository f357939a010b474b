//! `study`: grids of campaigns with their measures.

mod labelled;
mod measuring;
mod progress;
mod run;
mod shown;

use crate::json;
use murmuration_cli::{
    CliError, Global,
    files::{expect_outside_data, read_words, replaces},
    table::{Table, left, right},
};
use murmuration_files::{Folder, InputKind, Replaces};
use murmuration_link::{errln, outln};
use murmuration_store::expect_folder;
use murmuration_study::{Corrections, FolderError, Outcome, ReportError, StudyFolder, studies, write_report};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Subcommand)]
pub enum StudyCommand {
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

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The report's medoids.csv has a row for each judged individual. To name behaviours yourself, change `class`, and `by` to your \
name, in a copy of it.

Example:
  murmuration lab study report small --classes my-classes.csv")]
pub struct ReportStudy {
    /// Name of the study
    study: String,
    /// Classes to take instead of the judge's: the columns cell, index, class and by of medoids.csv
    #[arg(long, value_name = "CSV")]
    classes: Option<PathBuf>,
    /// Folder for the report [default: the folder of the study in the data directory]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files of a former report in the folder although they were changed since
    #[arg(long)]
    force: bool,
}

impl StudyCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        expect_folder(&global.data)?;
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
        if outcome.cells().next().is_none() {
            return Err(CliError::Failed(format!(
                "nothing of the study {} has been measured: `murmuration lab study run` measures its cells",
                self.study
            )));
        }
        let folder = match &self.out {
            Some(out) => {
                expect_outside_data(out)?;
                Folder::create(out, replaces(self.force))
            }
            None => Folder::create(folder.path(), Replaces::All),
        };
        let page = write_report(&outcome, folder?).map_err(report_error)?;
        match global.json {
            true => shown::show(&outcome, Some(&page), true),
            false => Ok(outln!("{}", page.display())?),
        }
    }
}

fn report_error(error: ReportError) -> CliError {
    match error {
        ReportError::Folder(error) => error.into(),
        error => CliError::failed(error),
    }
}

/// Reads a study of a data directory with its measurements and the classes from people. `corrections` take precedence over classes
/// from the study's page.
fn kept(data: &Path, name: &str, corrections: Corrections) -> Result<(StudyFolder, Outcome), CliError> {
    let kept = StudyFolder::open(data, name).map_err(folder_error)?;
    let folder = kept.folder.clone();
    let corrections = corrections.or(folder.classes().map_err(folder_error)?);
    Ok((folder, kept.outcome(corrections).map_err(folder_error)?))
}

fn list(global: &Global) -> Result<(), CliError> {
    let mut listed = Vec::new();
    for name in studies(&global.data).map_err(folder_error)? {
        let listed_study = match kept(&global.data, &name, Corrections::default()) {
            Ok((_, outcome)) => json::ListedStudy {
                study: name,
                cells: outcome.study().cells.len(),
                measured: outcome.cells().count(),
                problem: None,
            },
            // A damaged study does not hide the others.
            Err(error) => json::ListedStudy {
                study: name,
                cells: 0,
                measured: 0,
                problem: Some(error.to_string()),
            },
        };
        listed.push(listed_study);
    }
    if global.json {
        return Ok(json::print_all(listed)?);
    }
    let mut table = Table::new([left("STUDY"), right("CELLS"), right("MEASURED")]);
    let mut damaged = Vec::new();
    for study in listed {
        let number = |number: usize| match study.problem {
            None => number.to_string(),
            Some(_) => "-".to_owned(),
        };
        let (cells, measured) = (number(study.cells), number(study.measured));
        damaged.extend(study.problem.map(|problem| (study.study.clone(), problem)));
        table.row([study.study, cells, measured]);
    }
    table.print()?;
    for (study, problem) in damaged {
        errln!("{study} is damaged: {problem}");
    }
    Ok(())
}

/// Error for a study folder that cannot be read or written.
fn folder_error(error: FolderError) -> CliError {
    let message = error.to_string();
    match error {
        FolderError::NoStudy { .. } => CliError::Input(message),
        _ => CliError::Failed(message),
    }
}
