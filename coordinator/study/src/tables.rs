//! The tables of a study: for each measure, a row for each combination of the axes' values.

use crate::figure::{Figure, Measure};
use std::collections::BTreeMap;

#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub measure: Measure,
    /// Rows of the table, in the order of the grid.
    pub rows: Vec<Row>,
}

/// A row: the cells that differ only in their seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// For each axis, the place of the row's value.
    pub values: Vec<usize>,
    /// Figures of the row, without figures that no cell has yet.
    pub entries: BTreeMap<Figure, Entry>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Number of replicates with the figure; for accuracies, number of different embeddings. At least one.
    pub count: usize,
    pub mean: f64,
    /// Sample standard deviation (over n - 1); `None` for a single replicate.
    pub deviation: Option<f64>,
    /// The figure with the judge's errors; `None` for figures that do not depend on the judge.
    pub resampled: Option<Resampled>,
    /// The published figure.
    pub published: Option<f64>,
}

/// A figure with the judge's errors and the spread of the replicates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resampled {
    /// Mean of the figure over all resamplings.
    pub mean: f64,
    /// The 5th percentile.
    pub low: f64,
    /// The 95th percentile.
    pub high: f64,
}

impl Resampled {
    /// Summary of resampled figures; `None` without figures.
    pub(crate) fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let last = values.len().checked_sub(1)?;
        let at = |share: f64| values[(share * last as f64).round() as usize];
        Some(Self {
            mean: values.iter().sum::<f64>() / values.len() as f64,
            low: at(0.05),
            high: at(0.95),
        })
    }
}

impl Table {
    /// The columns of the table: the figures of its rows.
    pub fn figures(&self) -> Vec<Figure> {
        let mut figures = self.measure.figures();
        figures.retain(|figure| self.rows.iter().any(|row| row.entries.contains_key(figure)));
        figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_sorted_values() {
        let values = (0..=100).rev().map(f64::from).collect();
        let resampled = Resampled::of(values).unwrap();
        assert_eq!((resampled.mean, resampled.low, resampled.high), (50.0, 5.0, 95.0));
        assert_eq!(Resampled::of(Vec::new()), None);
    }
}
