//! Rows that several CSV tables share. Numbers read back exactly, and names are safe in spreadsheets.

use crate::labels::{ClassName, to_cell};
use murmuration_swarm::FEATURE_NAMES;

/// The columns of [`generation_row`].
pub const GENERATION_COLUMNS: [&str; 4] = ["generation", "best_novelty", "mean_novelty", "filtered"];

/// A generation, with its highest and mean novelty and the number of filtered proposals.
pub fn generation_row(generation: u32, best_novelty: f64, mean_novelty: f64, filtered: u64) -> [String; 4] {
    [
        generation.to_string(),
        best_novelty.to_string(),
        mean_novelty.to_string(),
        filtered.to_string(),
    ]
}

/// The columns of [`behaviour_cells`].
pub fn behaviour_columns(genes: &[String], dimensions: usize) -> impl Iterator<Item = String> {
    let features = FEATURE_NAMES.into_iter().map(str::to_owned);
    let known = features.chain(genes.iter().cloned());
    known
        .chain(embedding_columns(dimensions))
        .chain(["class".to_owned()])
}

pub fn embedding_columns(dimensions: usize) -> impl Iterator<Item = String> {
    (0..dimensions).map(|dimension| format!("embedding_{dimension}"))
}

/// The behaviour of an individual: its features, genes, embedding and class.
pub fn behaviour_cells<'a>(
    features: &'a [f64],
    genes: &'a [f64],
    embedding: &'a [f32],
    class: Option<&ClassName>,
) -> impl Iterator<Item = String> {
    let class = class.map(|class| to_cell(class.as_str()).into_owned());
    let numbers = features.iter().chain(genes).map(f64::to_string);
    numbers
        .chain(embedding.iter().map(f32::to_string))
        .chain([class.unwrap_or_default()])
}
