//! A study, and the cells of its grid.

use crate::{
    figure::{Figure, Measure},
    recall::RecallPlan,
};
use murmuration_swarm::{CampaignName, CampaignSpec};
use std::{collections::BTreeMap, num::NonZeroU32, path::PathBuf};

/// A grid of campaigns: every combination of the axes' values, in several replicates.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// Name of the study; the name of a quick study ends with `-quick`.
    pub name: CampaignName,
    /// Axes of the study, in the order of the file; can be empty.
    pub axes: Vec<Axis>,
    /// The seed of each replicate, all different.
    pub seeds: Vec<u64>,
    /// Number of embedders that the replicates share; `None` if each campaign trains its own embedder.
    pub embedders: Option<NonZeroU32>,
    pub measures: Measures,
    /// The axes of the phase diagrams; `None` for a study without phase diagrams.
    pub phase: Option<Phase>,
    /// The cells, in the order of the rows: the values of the last axis vary fastest. The replicates of a row are together.
    pub cells: Vec<Cell>,
    pub(crate) published: Vec<Published>,
}

/// A difference between cells, besides the seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Name of the axis: 1 to 32 lower-case letters, digits, `-` and `_`.
    pub name: String,
    /// Names of the axis's values: 1 to 64 names, all different.
    pub values: Vec<String>,
    /// The path of the field that an axis of numbers sets, such as `world.agents`; `None` for other axes.
    pub field: Option<String>,
    /// The number of each value of an axis of numbers; empty for other axes.
    pub numbers: Vec<f64>,
}

/// A campaign of the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// For each axis, the place of the cell's value.
    pub values: Vec<usize>,
    /// The replicate, from 0.
    pub replicate: usize,
    /// Specification of the cell, as in the study file.
    pub spec: CampaignSpec,
}

/// The axes of a study's phase diagrams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Phase {
    /// The place of the axis of numbers from left to right.
    pub x: usize,
    /// The place of the axis of numbers from bottom to top; `None` if the diagrams have only one axis.
    pub y: Option<usize>,
}

/// The measures of each cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Measures {
    /// The measures, each once, in the order of [`Measure::ALL`].
    pub which: Vec<Measure>,
    /// Number of taxonomies at the end of the search that are judged, 1 to 1,000.
    pub generations: NonZeroU32,
    /// The batches that replace the taxonomies of a random search.
    pub random: RandomBatches,
    /// The labelled sets for the accuracy, by the name of a capability model; files as named in the study file.
    pub labelled: BTreeMap<String, LabelledSets>,
    /// The plan for measuring recall and richness; `None` if the study measures neither.
    pub recall: Option<RecallPlan>,
}

/// The label files of a capability model, which are joined.
pub type LabelledSets = Vec<PathBuf>;

/// The batches that replace the taxonomies of a random search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RandomBatches {
    /// Batches of as many samples as a taxonomy has medoids, as in the paper.
    Samples,
    /// The medoids of the search's archive, as in the other methods.
    Medoids,
}

/// Published figures of some rows of the grid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Published {
    /// The publication; can be empty.
    pub source: String,
    /// The rows that the figures belong to. Key: index of an axis; value: index of one of the axis's values. Other axes can have
    /// any value.
    pub rows: BTreeMap<usize, usize>,
    pub figures: BTreeMap<Figure, f64>,
}

impl Study {
    pub(crate) const MAX_CELLS: usize = 2000;

    /// The ending of the names of quick studies; no other study has a name with this ending.
    pub const QUICK: &str = "-quick";

    /// Whether `--quick` shortened the study.
    pub(crate) fn is_quick(&self) -> bool {
        self.name.as_str().ends_with(Self::QUICK)
    }

    /// The rows of the grid, in the order of the cells: for each axis, the place of a value.
    pub fn rows(&self) -> Vec<Vec<usize>> {
        let mut rows: Vec<Vec<usize>> = self.cells.iter().map(|cell| cell.values.clone()).collect();
        rows.dedup();
        rows
    }

    pub fn names<'a>(&'a self, values: &'a [usize]) -> impl Iterator<Item = &'a str> {
        let named = self.axes.iter().zip(values);
        named.filter_map(|(axis, &place)| axis.values.get(place).map(String::as_str))
    }

    /// A row in words: `single sensor · latent`; the name of the study if it has no axes.
    pub(crate) fn row_in_words(&self, values: &[usize]) -> String {
        let names: Vec<&str> = self.names(values).collect();
        match names.is_empty() {
            true => self.name.as_str().to_owned(),
            false => names.join(" · "),
        }
    }

    /// A cell in words: `single sensor · latent · seed 3`.
    pub fn cell_in_words(&self, cell: &Cell) -> String {
        let mut words: Vec<String> = self.names(&cell.values).map(str::to_owned).collect();
        words.push(format!("seed {}", cell.spec.seed()));
        words.join(" · ")
    }

    /// The published value of a figure in a row, and its source.
    pub fn published(&self, values: &[usize], figure: Figure) -> Option<(f64, &str)> {
        let of_row = |published: &&Published| {
            let mut rows = published.rows.iter();
            rows.all(|(&axis, value)| values.get(axis) == Some(value))
        };
        let mut found = self.published.iter().filter(of_row);
        found.find_map(|published| Some((*published.figures.get(&figure)?, published.source.as_str())))
    }

    /// The seed of the embedder of a replicate, if the replicates share embedders.
    pub(crate) fn embedder_seed(&self, replicate: usize) -> Option<u64> {
        let embedders = self.embedders?.get() as usize;
        self.seeds.get(replicate % embedders).copied()
    }
}
