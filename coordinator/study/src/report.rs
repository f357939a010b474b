//! Writes the report of a study: one self-contained page, and the tables that it follows from.

use crate::{
    figure::Measure,
    map_files,
    outcome::{MeasuredCell, Outcome},
    page::{self, Pictures},
    phase_picture,
    pictures::{self, MedoidPictures, ReportError},
    recall_curve, written,
};
use murmuration_report::Folder;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Files that not every report has.
const OPTIONAL: [&str; 6] = [
    "phase.svg",
    "recall.svg",
    "recall.csv",
    "richness.csv",
    "niches.csv",
    "maps.csv",
];

/// Writes `report.html`, `cells.csv` and `medoids.csv` into `folder`, which is made if it does not exist; for a study with phase
/// diagrams, also `phase.svg`; where recall was measured, also `recall.svg` and `recall.csv`; where richness was, `richness.csv`;
/// with either, `niches.csv`; where maps were made, also `maps.csv` and the folder `maps`. Every file is complete or absent; the page,
/// whose path is returned, is written last, and then such files of an earlier report are removed that this one does not have.
pub fn write_report(outcome: &Outcome, folder: &Path) -> Result<PathBuf, ReportError> {
    let pictures = draw(outcome)?;
    let page = page::render(outcome, &pictures, true);
    let mut files = Folder::create(folder)?;
    if outcome.reference().is_some() {
        write_recall(outcome, &mut files)?;
    }
    if !pictures.maps.is_empty() {
        map_files::write(outcome, &pictures.maps, &mut files)?;
    }
    files.write("cells.csv", |file| written::cells(outcome, file))?;
    files.write("medoids.csv", |file| written::medoids(outcome, file))?;
    if let Some(picture) = &pictures.phase {
        files.text("phase.svg", picture)?;
    }
    let page = files.text("report.html", &page)?;
    // What an earlier report of other measures or rows left here is not this one's.
    files.remove_unless_written(
        OPTIONAL
            .map(str::to_owned)
            .into_iter()
            .chain(map_files::earlier(folder)),
    )?;
    Ok(page)
}

/// The page of [`write_report`] alone, which names no file beside it.
pub fn report_page(outcome: &Outcome) -> Result<String, ReportError> {
    let pictures = draw(outcome)?;
    Ok(page::render(outcome, &pictures, false))
}

fn draw(outcome: &Outcome) -> Result<Pictures, ReportError> {
    let cells: Vec<MeasuredCell<'_>> = outcome.cells().collect();
    Ok(Pictures {
        behaviours: cells.par_iter().map(drawn).collect::<Result<_, _>>()?,
        phase: phase_picture::svg(outcome.study().name.as_str(), &outcome.phase_diagrams()),
        maps: map_files::draw(outcome)?,
    })
}

fn write_recall(outcome: &Outcome, files: &mut Folder) -> Result<(), ReportError> {
    let has = |measure| outcome.study().measures.which.contains(&measure);
    files.write("niches.csv", |file| recall_curve::niches_csv(outcome, file))?;
    if has(Measure::Recall) {
        let stages = recall_curve::stages(outcome);
        files.text("recall.svg", &recall_curve::plot(outcome, &stages).into_string())?;
        files.write("recall.csv", |file| recall_curve::recall_csv(outcome, file))?;
    }
    if has(Measure::Richness) {
        files.write("richness.csv", |file| recall_curve::richness_csv(outcome, file))?;
    }
    Ok(())
}

fn drawn(cell: &MeasuredCell<'_>) -> Result<MedoidPictures, ReportError> {
    let failed = |(index, reason)| ReportError::Picture {
        index,
        campaign: cell.measured.campaign.clone(),
        reason,
    };
    pictures::of_cell(cell).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Corrections, sample, tables_and_plots};

    #[test]
    fn only_the_page_of_a_folder_names_the_files_beside_it() {
        let study = sample::study();
        let measured = sample::measured(&study, 0, &[&["milling", "random"]]);
        let outcome = Outcome::new(study, vec![Some(measured)], Corrections::default());
        let alone = report_page(&outcome).unwrap();
        assert!(!alone.contains("cells.csv has"));
        assert!(!tables_and_plots(&outcome).into_string().contains(".csv"));
        let folder = tempfile::tempdir().unwrap();
        let beside = write_report(&outcome, folder.path()).unwrap();
        assert!(std::fs::read_to_string(beside).unwrap().contains("cells.csv has"));
    }
}
