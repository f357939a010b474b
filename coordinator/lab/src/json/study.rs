//! Documents about studies.

use super::Whole;
use murmuration_study as study;
use schemars::JsonSchema;
use serde::Serialize;
use std::{collections::BTreeMap, path::Path};

/// A study and its tables.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Study {
    /// Name of the study.
    study: String,
    /// Path of the page of its report; null if no report was written.
    report: Option<String>,
    /// Number of the study's cells.
    cells: usize,
    /// The cells that were measured, in the order of the grid.
    measured: Vec<StudyCell>,
    /// A table for each measure.
    tables: Vec<StudyTable>,
    /// Number of judged individuals, by the source of their class: `judge`, or an annotator.
    named_by: BTreeMap<String, usize>,
}

/// A cell that was measured.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct StudyCell {
    /// Digest of the cell's specification without the name.
    cell: String,
    /// The cell's value on each axis.
    values: BTreeMap<String, String>,
    /// Seed of the cell.
    seed: Whole,
    /// Id of the cell's campaign.
    campaign: String,
    /// Digest of the archive.
    archive_digest: String,
    /// Digest of the checkpoint; empty without a checkpoint.
    checkpoint: String,
    /// Individuals of the archive.
    evaluations: u64,
    /// Figures of the cell, by name.
    figures: BTreeMap<String, f64>,
}

/// The table of a measure.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct StudyTable {
    /// What was measured.
    measure: String,
    /// Rows of the table, in the order of the grid.
    rows: Vec<StudyRow>,
}

/// The cells that differ only in their seed.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct StudyRow {
    /// The row's value on each axis.
    values: BTreeMap<String, String>,
    /// The figures that the row has so far, by name.
    figures: BTreeMap<String, StudyFigure>,
}

/// A figure of a row.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct StudyFigure {
    /// Replicates that have the figure; for accuracies, the number of different embeddings.
    replicates: usize,
    /// Mean over the replicates.
    mean: f64,
    /// Sample standard deviation over the replicates; null for a single replicate.
    deviation: Option<f64>,
    /// Mean with the judge's errors; null for figures that do not depend on the judge.
    mean_with_judge_errors: Option<f64>,
    /// 5th and 95th percentile with the judge's errors; null for figures that do not depend on the judge.
    range_with_judge_errors: Option<[f64; 2]>,
    /// Published value; null if the study file has none.
    published: Option<f64>,
}

/// A study and its progress.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct ListedStudy {
    /// Name of the study.
    pub(crate) study: String,
    /// Number of the study's cells.
    pub(crate) cells: usize,
    /// Number of the cells that were measured.
    pub(crate) measured: usize,
    /// Reason why the study cannot be read; absent if the study can be read. With a problem, `cells` and `measured` are 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) problem: Option<String>,
}

impl Study {
    /// A study, and the page of its report if one was written.
    pub(crate) fn of(outcome: &study::Outcome, report: Option<&Path>) -> Self {
        let of = outcome.study();
        let values = |values: &[usize]| -> BTreeMap<String, String> {
            let axes = of.axes.iter().map(|axis| axis.name.clone());
            axes.zip(of.names(values).map(str::to_owned)).collect()
        };
        let cell = |cell: study::MeasuredCell<'_>| StudyCell {
            cell: cell.measured.cell.clone(),
            values: values(&cell.cell.values),
            seed: Whole(cell.cell.spec.seed()),
            campaign: cell.measured.campaign.clone(),
            archive_digest: cell.measured.archive_digest.clone(),
            checkpoint: cell.measured.checkpoint.clone(),
            evaluations: cell.measured.evaluations,
            figures: by_name(outcome.figures(cell.measured), |figure| figure),
        };
        let row = |row: &study::Row| StudyRow {
            values: values(&row.values),
            figures: by_name(row.entries.clone(), StudyFigure::from),
        };
        let table = |table: &study::Table| StudyTable {
            measure: table.measure.name().to_owned(),
            rows: table.rows.iter().map(row).collect(),
        };
        Self {
            study: of.name.as_str().to_owned(),
            report: report.map(|path| path.display().to_string()),
            cells: of.cells.len(),
            measured: outcome.cells().map(cell).collect(),
            tables: outcome.tables().iter().map(table).collect(),
            named_by: outcome.named_by(),
        }
    }
}

fn by_name<T, U>(figures: BTreeMap<study::Figure, T>, made: impl Fn(T) -> U) -> BTreeMap<String, U> {
    let figures = figures.into_iter();
    figures
        .map(|(figure, value)| (figure.name().into_owned(), made(value)))
        .collect()
}

impl From<study::Entry> for StudyFigure {
    fn from(entry: study::Entry) -> Self {
        Self {
            replicates: entry.count,
            mean: entry.mean,
            deviation: entry.deviation,
            mean_with_judge_errors: entry.resampled.map(|resampled| resampled.mean),
            range_with_judge_errors: entry.resampled.map(|resampled| [resampled.low, resampled.high]),
            published: entry.published,
        }
    }
}
