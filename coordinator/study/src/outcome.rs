//! A study with what was measured of its cells.

#[cfg(test)]
mod tests;

use crate::{
    corrections::{Corrections, JUDGE},
    figure::{Figure, Measure},
    judge_errors::JudgeErrors,
    measured::{JudgedBehaviours, Measured},
    study::{Cell, Study},
    tables::{Entry, Resampled, Row, Table},
};
use murmuration_accuracy::Summary;
use murmuration_proto::Class;
use rayon::prelude::*;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::OnceLock,
};

/// A study with what was measured of its cells so far.
#[derive(Debug, Clone)]
pub struct Outcome {
    study: Study,
    /// By the place of the cell.
    measured: Vec<Option<Measured>>,
    corrections: Corrections,
    /// Resampling takes seconds.
    tables: OnceLock<Vec<Table>>,
}

/// A cell that was measured.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredCell<'a> {
    /// The cell.
    pub cell: &'a Cell,
    /// What was measured of it.
    pub measured: &'a Measured,
}

impl Outcome {
    /// Brings a study and the measures of its cells together, which are in the order of the cells. Classes in `corrections`
    /// replace the judge's.
    #[must_use]
    pub fn new(study: Study, mut measured: Vec<Option<Measured>>, corrections: Corrections) -> Self {
        measured.resize(study.cells().len(), None);
        Self {
            study,
            measured,
            corrections,
            tables: OnceLock::new(),
        }
    }

    /// The study.
    #[must_use]
    pub const fn study(&self) -> &Study {
        &self.study
    }

    /// The cells that were measured, in the study's order.
    pub fn cells(&self) -> impl Iterator<Item = MeasuredCell<'_>> {
        let cells = self.study.cells().iter().zip(&self.measured);
        cells.filter_map(|(cell, measured)| {
            Some(MeasuredCell {
                cell,
                measured: measured.as_ref()?,
            })
        })
    }

    /// The class of an individual of a cell, and whose word it is.
    #[must_use]
    pub fn class_of(&self, cell: &Measured, index: u64) -> (Class, &str) {
        self.corrections.of(cell, index).unwrap_or_else(|| {
            let judged = cell
                .behaviours
                .as_ref()
                .map(|behaviours| behaviours.judged(index));
            (judged.unwrap_or(Class::Random), JUDGE)
        })
    }

    /// How many individuals were named by whom.
    #[must_use]
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

    /// The figures of a cell.
    #[must_use]
    pub fn figures(&self, cell: &Measured) -> BTreeMap<Figure, f64> {
        let mut figures = BTreeMap::new();
        if let Some(behaviours) = &cell.behaviours {
            figures = behaviours.figures(|index| self.class_of(cell, index).0);
        }
        if let Some(accuracy) = &cell.accuracy {
            figures.insert(Figure::Accuracy, accuracy.anchor_not_random);
            figures.insert(Figure::AccuracyOfEveryAnchor, accuracy.every_anchor);
        }
        if let Some(search) = &cell.search {
            figures.insert(Figure::Loss, search.loss);
            figures.insert(Figure::Novelty, search.novelty);
        }
        figures
    }

    /// The table of each measure.
    #[must_use]
    pub fn tables(&self) -> &[Table] {
        self.tables.get_or_init(|| {
            let measures = self.study.measures().which.iter();
            measures.map(|&measure| self.table(measure)).collect()
        })
    }

    fn table(&self, measure: Measure) -> Table {
        let rows: Vec<_> = self.study.rows().into_iter().enumerate().collect();
        let row = |(number, values): (usize, Vec<usize>)| self.row(measure, values, number as u64);
        Table {
            measure,
            rows: rows.into_par_iter().map(row).collect(),
        }
    }

    fn row(&self, measure: Measure, values: Vec<usize>, number: u64) -> Row {
        let cells: Vec<MeasuredCell<'_>> = self.cells().filter(|cell| cell.cell.values == values).collect();
        let mut seen = BTreeSet::new();
        let counted = cells
            .iter()
            .filter(|cell| match (measure, &cell.measured.accuracy) {
                // An embedding that several cells share is one replicate.
                (Measure::Accuracy, Some(accuracy)) => seen.insert(accuracy.embedding.as_str()),
                _ => true,
            });
        let figures: Vec<BTreeMap<Figure, f64>> = counted.map(|cell| self.figures(cell.measured)).collect();
        let mut resampled = match measure {
            Measure::Behaviours => self.resampled(&cells, number),
            Measure::Accuracy | Measure::Search => BTreeMap::new(),
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

    /// The figures of a row with the judge's errors.
    fn resampled(&self, cells: &[MeasuredCell<'_>], row: u64) -> BTreeMap<Figure, Resampled> {
        if !self.named_by().contains_key(JUDGE) {
            // What people named has no errors of the judge.
            return BTreeMap::new();
        }
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
        let resampled = errors.resampled(&behaviours, known, row);
        let of = |figure: Figure| {
            let values = resampled
                .iter()
                .filter_map(|of| of.get(&figure).copied())
                .collect();
            Some((figure, Resampled::of(values)?))
        };
        Measure::Behaviours.figures().into_iter().filter_map(of).collect()
    }

    /// Where the published figures of the study come from, each once.
    #[must_use]
    pub fn sources(&self) -> BTreeSet<&str> {
        let sources = self
            .study
            .published
            .iter()
            .map(|published| published.source.as_str());
        sources.filter(|source| !source.is_empty()).collect()
    }
}
