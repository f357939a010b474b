//! `study`: grids of campaigns with their measures.

mod kept;
mod labelled;
mod measuring;
mod progress;
mod run;
mod shown;

use crate::json;
use murmuration_cli::{
    CliError, Global,
    connection::{self, Connection, StudyClient},
    files::{expect_outside_data, read_words, replaces},
    table::{Table, left, right},
};
use murmuration_coordinator::local::InProcess;
use murmuration_files::{Folder, InputKind, Replaces};
use murmuration_link::{errln, outln};
use murmuration_model::study_records::STUDIES;
use murmuration_proto::v1;
use murmuration_store::expect_folder;
use murmuration_study::{Corrections, Outcome, ReportError, write_report};
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
    /// File of classes that replace the judge's: the columns cell, index, class and by of medoids.csv
    #[arg(long, value_name = "CSV")]
    classes: Option<PathBuf>,
    /// Folder for the report [default: the folder of the study in the data directory]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files of a former report in the folder even if they have been changed since
    #[arg(long)]
    force: bool,
}

impl StudyCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        expect_folder(&global.data)?;
        match self {
            Self::Run(run) => run.execute(global).await,
            Self::List => {
                let listed = connection::with(global, InProcess::NONE, list).await?;
                show_list(listed, global.json)
            }
            Self::Show { study } => {
                let outcome = async |connection: &mut Connection| {
                    outcome(&mut connection.studies, &study, Corrections::default()).await
                };
                let outcome = connection::with(global, InProcess::NONE, outcome).await?;
                shown::show(&outcome, None, global.json)
            }
            Self::Report(report) => report.execute(global).await,
        }
    }
}

impl ReportStudy {
    async fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(out) = &self.out {
            expect_outside_data(out)?;
        }
        let corrections = match &self.classes {
            Some(path) => {
                let corrections = Corrections::parse(&read_words(path, InputKind::Labels)?);
                corrections.map_err(|error| CliError::Input(format!("{}: {error}", path.display())))?
            }
            None => Corrections::default(),
        };
        let outcome = async |connection: &mut Connection| {
            outcome(&mut connection.studies, &self.study, corrections).await
        };
        let outcome = connection::with(global, InProcess::NONE, outcome).await?;
        if outcome.cells().next().is_none() {
            return Err(CliError::Failed(format!(
                "nothing of the study {} has been measured: `murmuration lab study run` measures its cells",
                self.study
            )));
        }
        let folder = match &self.out {
            Some(out) => Folder::create(out, replaces(self.force)),
            None => Folder::create(&report_folder(&global.data, &outcome), Replaces::All),
        };
        let page = write_report(&outcome, folder?).map_err(report_error)?;
        match global.json {
            true => shown::show(&outcome, Some(&page), true),
            false => Ok(outln!("{}", page.display())?),
        }
    }
}

/// The folder of a study's report in the data directory.
fn report_folder(data: &Path, outcome: &Outcome) -> PathBuf {
    data.join(STUDIES).join(outcome.study().name.as_str())
}

fn report_error(error: ReportError) -> CliError {
    match error {
        ReportError::Folder(error) => error.into(),
        error => CliError::failed(error),
    }
}

/// A study with its measurements, and the classes that people gave: `corrections` and, for other individuals, the classes given
/// on the page of the study.
async fn outcome(
    client: &mut StudyClient,
    study: &str,
    corrections: Corrections,
) -> Result<Outcome, CliError> {
    let kept = kept::get(client, study).await?;
    let classes = kept.classes().map_err(|error| kept::damaged(study, &error))?;
    Ok(kept.outcome(corrections.or(classes))?)
}

async fn list(connection: &mut Connection) -> Result<Vec<json::ListedStudy>, CliError> {
    let client = &mut connection.studies;
    let names = client.list_studies(v1::ListStudiesRequest {}).await?.into_inner();
    let mut listed = Vec::new();
    for name in names.studies {
        listed.push(match outcome(client, &name, Corrections::default()).await {
            Ok(outcome) => json::ListedStudy {
                study: name,
                cells: outcome.study().cells.len(),
                measured: outcome.cells().count(),
                problem: None,
            },
            // A damaged study does not hide other studies.
            Err(error) => json::ListedStudy {
                study: name,
                cells: 0,
                measured: 0,
                problem: Some(error.to_string()),
            },
        });
    }
    Ok(listed)
}

fn show_list(listed: Vec<json::ListedStudy>, as_json: bool) -> Result<(), CliError> {
    if as_json {
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
        damaged.extend(study.problem);
        table.row([study.study, cells, measured]);
    }
    table.print()?;
    for problem in damaged {
        errln!("{problem}");
    }
    Ok(())
}
