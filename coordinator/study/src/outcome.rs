//! A study with the measurements of its cells.

#[cfg(test)]
mod tests;

use crate::{
    corrections::{Corrections, JUDGE},
    figure::{Figure, Measure},
    judge_errors::JudgeErrors,
    measured::{JudgedBehaviours, Measured},
    recall::RecallStage,
    reference::Reference,
    study::{Cell, Study},
    tables::{Entry, Resampled, Row, Table},
};
use murmuration_accuracy::Summary;
use murmuration_swarm::Class;
use rayon::prelude::*;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, OnceLock},
};

/// A study with the measurements of its cells so far. Cloning is cheap, except for the corrections and the tables.
#[derive(Debug, Clone)]
pub struct Outcome {
    study: Arc<Study>,
    /// The measurements, in the order of the study's cells.
    measured: Arc<[Option<Measured>]>,
    corrections: Corrections,
    /// The content of the atlas, if recall or richness is measured and the atlas exists.
    reference: Option<Arc<Reference>>,
    /// The tables, computed once, because resampling takes seconds.
    tables: OnceLock<Vec<Table>>,
}

#[derive(Debug, Clone, Copy)]
pub struct MeasuredCell<'a> {
    pub cell: &'a Cell,
    pub measured: &'a Measured,
}

impl Outcome {
    /// Combines a study with the measurements of its cells, in the order of the cells. Classes in `corrections` replace the
    /// judge's.
    pub fn new(study: Study, mut measured: Vec<Option<Measured>>, corrections: Corrections) -> Self {
        measured.resize(study.cells.len(), None);
        Self {
            study: Arc::new(study),
            measured: measured.into(),
            corrections,
            reference: None,
            tables: OnceLock::new(),
        }
    }

    /// The same outcome with other classes from people. Tables that do not depend on such classes are not computed again.
    #[must_use]
    pub fn with_corrections(&self, corrections: Corrections) -> Self {
        let corrected = Self {
            study: Arc::clone(&self.study),
            measured: Arc::clone(&self.measured),
            corrections,
            reference: self.reference.clone(),
            tables: OnceLock::new(),
        };
        if let Some(tables) = self.tables.get() {
            let table = |table: &Table| match table.measure {
                Measure::Behaviours => corrected.table(Measure::Behaviours),
                Measure::Shares
                | Measure::Accuracy
                | Measure::Search
                | Measure::Recall
                | Measure::Richness
                | Measure::Maps => table.clone(),
            };
            let tables: Vec<Table> = tables.iter().map(table).collect();
            // No other code has set these tables.
            let _ = corrected.tables.set(tables);
        }
        corrected
    }

    /// The same outcome with the content of the atlas, the reference of recall.
    #[must_use]
    pub(crate) fn with_reference(self, reference: Option<Reference>) -> Self {
        Self {
            reference: reference.map(Arc::new),
            tables: OnceLock::new(),
            ..self
        }
    }

    /// The content of the atlas; `None` if neither recall nor richness is measured, or the atlas does not exist yet.
    pub fn reference(&self) -> Option<&Reference> {
        self.reference.as_deref()
    }

    pub fn study(&self) -> &Study {
        &self.study
    }

    /// The cells that were measured, in the study's order.
    pub fn cells(&self) -> impl Iterator<Item = MeasuredCell<'_>> {
        let cells = self.study.cells.iter().zip(self.measured.iter());
        cells.filter_map(|(cell, measured)| {
            Some(MeasuredCell {
                cell,
                measured: measured.as_ref()?,
            })
        })
    }

    /// The cell with this digest, if it was measured.
    pub fn cell(&self, digest: &str) -> Option<MeasuredCell<'_>> {
        self.cells().find(|cell| cell.measured.cell == digest)
    }

    /// The campaign of each cell, in the study's order; `None` for cells that were not measured.
    pub fn campaigns(&self) -> Vec<Option<String>> {
        let campaign = |measured: &Option<Measured>| Some(measured.as_ref()?.campaign.clone());
        self.measured.iter().map(campaign).collect()
    }

    /// The class of an individual of a cell, and the name of the person or judge who gave the class.
    pub fn class_of(&self, cell: &Measured, index: u64) -> (Class, &str) {
        self.corrections.of(cell, index).unwrap_or_else(|| {
            let judged = cell
                .behaviours
                .as_ref()
                .map(|behaviours| behaviours.judged(index));
            (judged.unwrap_or(Class::Random), JUDGE)
        })
    }

    pub fn named_by(&self) -> BTreeMap<String, usize> {
        let mut counts = BTreeMap::new();
        for MeasuredCell { measured, .. } in self.cells() {
            for &index in measured
                .behaviours
                .iter()
                .flat_map(|behaviours| behaviours.individuals.keys())
            {
                let (_, by) = self.class_of(measured, index);
                *counts.entry(by.to_owned()).or_default() += 1;
            }
        }
        counts
    }

    pub fn figures(&self, cell: &Measured) -> BTreeMap<Figure, f64> {
        let mut figures = BTreeMap::new();
        if let Some(behaviours) = &cell.behaviours {
            figures = behaviours.figures(|index| self.class_of(cell, index).0);
        }
        if let Some(trials) = &cell.shares {
            figures.extend(trials.figures());
        }
        if let Some(accuracy) = &cell.accuracy {
            figures.insert(Figure::Accuracy, accuracy.anchor_not_random);
            figures.insert(Figure::AccuracyOfEveryAnchor, accuracy.every_anchor);
        }
        if let Some(search) = &cell.search {
            figures.insert(Figure::Loss, search.loss);
            figures.insert(Figure::Novelty, search.novelty);
        }
        let last = cell.recall.as_ref().and_then(|counts| counts.stages.last());
        figures.extend(
            last.map(|stage| self.stage_figures(cell, stage))
                .unwrap_or_default(),
        );
        figures
    }

    /// Recall and richness of a cell at a number of evaluations, where they are measured.
    pub(crate) fn stage_figures(&self, cell: &Measured, stage: &RecallStage) -> BTreeMap<Figure, f64> {
        let has = |measure| self.study.measures.which.contains(&measure);
        let mut figures = BTreeMap::new();
        if let (Some(reference), true) = (self.reference(), has(Measure::Recall)) {
            figures.extend(stage.recall(reference));
        }
        let is_independent = cell.recall.as_ref().is_some_and(|counts| counts.is_independent);
        if is_independent && has(Measure::Richness) {
            figures.extend(stage.richness());
        }
        figures
    }

    pub fn tables(&self) -> &[Table] {
        self.tables.get_or_init(|| {
            let measures = self.study.measures.which.iter();
            measures.map(|&measure| self.table(measure)).collect()
        })
    }

    fn table(&self, measure: Measure) -> Table {
        let rows: Vec<_> = self.study.rows().into_iter().enumerate().collect();
        // If people named every class, the judge's errors do not matter.
        let has_errors = measure != Measure::Behaviours || self.is_any_by_judge();
        let row =
            |(number, values): (usize, Vec<usize>)| self.row(measure, values, number as u64, has_errors);
        Table {
            measure,
            rows: rows.into_par_iter().map(row).collect(),
        }
    }

    /// Whether some individual has its class from the judge.
    fn is_any_by_judge(&self) -> bool {
        self.cells().any(|MeasuredCell { measured, .. }| {
            let mut individuals = measured.behaviours.iter().flat_map(|of| of.individuals.keys());
            individuals.any(|&index| self.class_of(measured, index).1 == JUDGE)
        })
    }

    fn row(&self, measure: Measure, values: Vec<usize>, number: u64, has_errors: bool) -> Row {
        let cells: Vec<MeasuredCell<'_>> = self.cells().filter(|cell| cell.cell.values == values).collect();
        let mut seen = BTreeSet::new();
        let counted = cells
            .iter()
            .filter(|cell| match (measure, &cell.measured.accuracy) {
                // Cells that share an embedding count as one replicate.
                (Measure::Accuracy, Some(accuracy)) => seen.insert(accuracy.embedding.as_str()),
                _ => true,
            });
        let figures: Vec<BTreeMap<Figure, f64>> = counted.map(|cell| self.figures(cell.measured)).collect();
        let mut resampled = match measure {
            Measure::Behaviours if has_errors => self.resampled(&cells, number),
            Measure::Shares => resampled_shares(&cells, number),
            Measure::Behaviours
            | Measure::Accuracy
            | Measure::Search
            | Measure::Recall
            | Measure::Richness
            | Measure::Maps => BTreeMap::new(),
        };
        let mut entry = |figure: Figure| {
            let values_of: Vec<f64> = figures.iter().filter_map(|of| of.get(&figure).copied()).collect();
            let summary = Summary::of(&values_of)?;
            Some(Entry {
                count: values_of.len(),
                mean: summary.mean,
                deviation: summary.deviation,
                resampled: resampled.remove(&figure),
                published: self.study.published(&values, figure).map(|(value, _)| value),
            })
        };
        let entries = measure.figures().into_iter();
        let entries = entries.filter_map(|figure| Some((figure, entry(figure)?)));
        Row {
            entries: entries.collect(),
            values,
        }
    }

    /// The figures of a row, with the judge's errors.
    fn resampled(&self, cells: &[MeasuredCell<'_>], row: u64) -> BTreeMap<Figure, Resampled> {
        let judged = |cell: &MeasuredCell<'_>| cell.measured.behaviours.is_some();
        let cells: Vec<&MeasuredCell<'_>> = cells.iter().filter(|cell| judged(cell)).collect();
        let Some(first) = cells.first() else {
            return BTreeMap::new();
        };
        let errors = JudgeErrors::of_model(first.cell.spec.model());
        let behaviours: Vec<&JudgedBehaviours> = cells
            .iter()
            .filter_map(|cell| cell.measured.behaviours.as_ref())
            .collect();
        let known = |replicate: usize, index: u64| {
            let (class, by) = self.class_of(cells[replicate].measured, index);
            (by != JUDGE).then_some(class)
        };
        summarised(Measure::Behaviours, &errors.resampled(&behaviours, known, row))
    }

    /// The sources of the study's published figures, each once.
    pub fn sources(&self) -> BTreeSet<&str> {
        let sources = self
            .study
            .published
            .iter()
            .map(|published| published.source.as_str());
        sources.filter(|source| !source.is_empty()).collect()
    }
}

/// The shares of a row, with the judge's errors.
fn resampled_shares(cells: &[MeasuredCell<'_>], row: u64) -> BTreeMap<Figure, Resampled> {
    let Some(first) = cells.first() else {
        return BTreeMap::new();
    };
    let errors = JudgeErrors::of_model(first.cell.spec.model());
    let trials = cells.iter().filter_map(|cell| cell.measured.shares.as_ref());
    let resampled = errors.resampled_shares(&trials.collect::<Vec<_>>(), row);
    summarised(Measure::Shares, &resampled)
}

/// The figures of a measure over all resamplings.
fn summarised(measure: Measure, resampled: &[BTreeMap<Figure, f64>]) -> BTreeMap<Figure, Resampled> {
    let of = |figure: Figure| {
        let values = resampled.iter().filter_map(|of| of.get(&figure).copied());
        Some((figure, Resampled::of(values.collect())?))
    };
    measure.figures().into_iter().filter_map(of).collect()
}
