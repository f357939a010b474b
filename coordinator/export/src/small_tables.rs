//! The tables of generations and medoids.

use crate::{
    ExportError,
    columns::{Described as _, TableWriter, column, number_column, numbers, open},
    digests,
};
use arrow_array::types::{Float64Type, UInt32Type, UInt64Type};
use arrow_schema::{DataType, Schema};
use murmuration_proto::v1;
use murmuration_store::{GenerationRecord, transfer::Medoids};
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

/// Reads the table of so many generations.
pub(crate) fn read_generations(path: &Path, count: u64) -> Result<Vec<v1::GenerationSummary>, ExportError> {
    let mut generations = Vec::new();
    for rows in open(path, digests::open(path)?, &generation_columns(), count)? {
        let rows = rows.map_err(|error| ExportError::damaged(path, error))?;
        let (numbered, filtered) = (numbers::<UInt32Type>(&rows, 0), numbers::<UInt64Type>(&rows, 3));
        let (best, mean) = (numbers::<Float64Type>(&rows, 1), numbers::<Float64Type>(&rows, 2));
        generations.extend((0..rows.num_rows()).map(|row| v1::GenerationSummary {
            generation: numbered[row],
            best_novelty: best[row],
            mean_novelty: mean[row],
            filtered: filtered[row],
        }));
    }
    Ok(generations)
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

/// Writes the table of medoids; `sizes` are those of their clusters.
pub(crate) fn write_taxonomy(path: &Path, taxonomy: &Medoids, sizes: &[u64]) -> Result<(), ExportError> {
    let mut table = TableWriter::create(path, taxonomy_columns())?;
    let medoids = || taxonomy.medoids.iter();
    let size = |place: usize| sizes.get(place).copied().unwrap_or(0);
    table.add(vec![
        number_column::<UInt32Type>((1..).take(taxonomy.medoids.len())),
        number_column::<UInt64Type>(medoids().map(|(index, _)| *index)),
        number_column::<UInt64Type>((0..taxonomy.medoids.len()).map(size)),
        number_column::<Float64Type>(medoids().map(|(_, cluster)| cluster.mean_distance)),
        number_column::<Float64Type>(medoids().map(|(_, cluster)| cluster.novelty)),
    ])?;
    table.finish()
}

/// Reads the table of medoids: one for each of `sizes`, which its cluster must have.
pub(crate) fn read_taxonomy(
    path: &Path,
    loss: f64,
    sizes: &[u64],
) -> Result<v1::ExportedTaxonomy, ExportError> {
    let mut medoids = Vec::new();
    for rows in open(
        path,
        digests::open(path)?,
        &taxonomy_columns(),
        sizes.len() as u64,
    )? {
        let rows = rows.map_err(|error| ExportError::damaged(path, error))?;
        let (clusters, indices) = (numbers::<UInt32Type>(&rows, 0), numbers::<UInt64Type>(&rows, 1));
        let counted = numbers::<UInt64Type>(&rows, 2);
        let (distances, novelty) = (numbers::<Float64Type>(&rows, 3), numbers::<Float64Type>(&rows, 4));
        for row in 0..rows.num_rows() {
            let place = medoids.len();
            let size = sizes.get(place).copied().unwrap_or(0);
            if clusters[row] as usize != place + 1 || counted[row] != size {
                let reason = format!(
                    "row {place}: its cluster or size is not that of {}",
                    crate::INDIVIDUALS
                );
                return Err(ExportError::damaged(path, reason));
            }
            medoids.push(v1::ExportedMedoid {
                index: indices[row],
                mean_distance: distances[row],
                novelty: novelty[row],
            });
        }
    }
    Ok(v1::ExportedTaxonomy { medoids, loss })
}
