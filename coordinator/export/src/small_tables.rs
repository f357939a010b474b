//! The tables of generations and medoids.

use crate::{
    ExportError,
    columns::{Described as _, TableWriter, column, number_column},
};
use arrow_array::types::{Float64Type, UInt32Type, UInt64Type};
use arrow_schema::{DataType, Schema};
use murmuration_store::{GenerationRecord, StoredTaxonomy};
use std::path::Path;

/// The columns of the table of generations.
pub(crate) fn generation_columns() -> Schema {
    Schema::new(vec![
        column("generation", DataType::UInt32).about("from 0"),
        column("best_novelty", DataType::Float64)
            .about("highest novelty of its individuals when they were evaluated")
            .unit("behaviour space"),
        column("mean_novelty", DataType::Float64)
            .about("mean novelty of its individuals when they were evaluated")
            .unit("behaviour space"),
        column("filtered", DataType::UInt64)
            .about("proposals that the heuristic filter rejected")
            .unit("controllers"),
    ])
}

/// Writes the table of generations.
pub(crate) fn write_generations(path: &Path, generations: &[GenerationRecord]) -> Result<(), ExportError> {
    let mut table = TableWriter::create(path, generation_columns())?;
    let rows = || generations.iter();
    table.add(vec![
        number_column::<UInt32Type>(rows().map(|row| row.generation)),
        number_column::<Float64Type>(rows().map(|row| row.best_novelty)),
        number_column::<Float64Type>(rows().map(|row| row.mean_novelty)),
        number_column::<UInt64Type>(rows().map(|row| row.filtered)),
    ])?;
    table.finish()
}

/// The columns of the table of medoids.
pub(crate) fn taxonomy_columns() -> Schema {
    Schema::new(vec![
        column("cluster", DataType::UInt32).about("from 1, largest cluster first"),
        column("index", DataType::UInt64).about("the medoid's place in the archive, from 0"),
        column("cluster_size", DataType::UInt64).unit("individuals"),
        column("mean_distance", DataType::Float64)
            .about("mean distance of the cluster's members to the medoid")
            .unit("behaviour space"),
        column("novelty_in_archive", DataType::Float64)
            .about("mean distance of the medoid to its nearest neighbours in the whole archive")
            .unit("behaviour space"),
    ])
}

/// Writes the table of medoids.
pub(crate) fn write_taxonomy(path: &Path, taxonomy: &StoredTaxonomy) -> Result<(), ExportError> {
    let mut table = TableWriter::create(path, taxonomy_columns())?;
    let measures = || taxonomy.measures.iter();
    table.add(vec![
        number_column::<UInt32Type>((1..).take(taxonomy.medoids.len())),
        number_column::<UInt64Type>(taxonomy.medoids.iter().copied()),
        number_column::<UInt64Type>(taxonomy.sizes().into_iter()),
        number_column::<Float64Type>(measures().map(|cluster| cluster.mean_distance)),
        number_column::<Float64Type>(measures().map(|cluster| cluster.novelty)),
    ])?;
    table.finish()
}
