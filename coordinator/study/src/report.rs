//! Writes the report of a study: one self-contained page, and the tables that it follows from.

use crate::{
    outcome::{MeasuredCell, Outcome},
    page,
    pictures::CellPictures,
    written,
};
use murmuration_report::Folder;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file or folder cannot be written.
    #[error("{0}")]
    Write(#[from] murmuration_report::ReportError),
    /// A medoid cannot be simulated or drawn.
    #[error("cannot draw individual {index} of campaign {campaign}: {reason}")]
    Picture {
        /// Its index.
        index: u64,
        /// Its campaign.
        campaign: String,
        /// What is wrong.
        reason: String,
    },
}

/// The files that were written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFiles {
    /// The page to open.
    pub page: PathBuf,
    /// The figures of each cell.
    pub cells: PathBuf,
    /// The judged individuals.
    pub medoids: PathBuf,
}

/// Writes `report.html`, `cells.csv` and `medoids.csv` into `folder`, which is made if it does not exist. Every file is
/// complete or absent; the page is written last.
///
/// # Errors
/// See [`ReportError`].
pub fn write_report(outcome: &Outcome, folder: &Path) -> Result<ReportFiles, ReportError> {
    let cells: Vec<MeasuredCell<'_>> = outcome.cells().collect();
    let pictures: Vec<CellPictures> = cells.par_iter().map(drawn).collect::<Result<_, _>>()?;
    let page = page::render(outcome, outcome.tables(), &pictures);
    let mut files = Folder::create(folder)?;
    Ok(ReportFiles {
        cells: files.write("cells.csv", |file| written::cells(outcome, file))?,
        medoids: files.write("medoids.csv", |file| written::medoids(outcome, file))?,
        page: files.text("report.html", &page)?,
    })
}

fn drawn(cell: &MeasuredCell<'_>) -> Result<CellPictures, ReportError> {
    let failed = |(index, reason)| ReportError::Picture {
        index,
        campaign: cell.measured.campaign.clone(),
        reason,
    };
    CellPictures::of(cell).map_err(failed)
}
