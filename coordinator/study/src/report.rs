//! Writes the report of a study: one self-contained page, and the tables behind it.

use crate::{
    figure::Measure,
    map_files,
    outcome::{MeasuredCell, Outcome},
    page::{self, Pictures},
    phase_picture,
    pictures::{self, MedoidPictures, ReportError},
    recall_curve, written,
};
use murmuration_files::Folder;
use rayon::prelude::*;
use std::path::PathBuf;

/// Writes `report.html`, `cells.csv` and `medoids.csv` into a folder, and replaces the folder's former report. A study with phase
/// diagrams also gets `phase.svg`; a study with recall, `recall.svg` and `recall.csv`; a study with richness, `richness.csv`; a
/// study with recall or richness, `niches.csv`; a study with maps, `maps.csv` and the folder `maps`. Returns the path of the
/// page.
///
/// # Errors
/// Fails if a picture cannot be drawn, or as [`Folder::finish`] does.
pub fn write_report(outcome: &Outcome, mut files: Folder) -> Result<PathBuf, ReportError> {
    let pictures = draw(outcome)?;
    let page = page::render(outcome, &pictures, true);
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
    files.text("report.html", &page)?;
    Ok(files.finish()?.pop().unwrap_or_default())
}

/// The page of [`write_report`] alone, without links to files beside it.
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
        let beside = write_report(
            &outcome,
            Folder::create(folder.path(), murmuration_files::Replaces::Unchanged).unwrap(),
        )
        .unwrap();
        assert!(std::fs::read_to_string(beside).unwrap().contains("cells.csv has"));
    }
}
