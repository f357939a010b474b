//! The folder that a campaign is exported to: its database, which is what an import reads, and the same as Parquet, NPZ, ONNX, TOML
//! and JSON, with a page about the columns and a datasheet.
//!
//! Data in, files out: reads neither a store nor the network. A folder appears under its name once it is whole.

mod about;
mod checked;
mod columns;
mod csv_tables;
mod datasheet;
mod description;
mod digests;
mod error;
mod individual_table;
mod individuals;
mod labels;
mod pictures;
mod placing;
mod small_tables;
mod writer;

#[cfg(test)]
mod tests;

pub use checked::CheckedExport;
pub use error::ExportError;
pub use individual_table::IndividualTable;
pub use writer::{Exported, NewFolder};

/// Everything, as a database of SQLite.
const DATABASE: &str = "campaign.sqlite";
/// The specification, TOML.
const SPEC: &str = "spec.toml";
/// Everything else of the campaign itself, JSON.
const CAMPAIGN: &str = "campaign.json";
/// One row an individual.
const INDIVIDUALS: &str = "individuals.parquet";
/// One row a generation.
const GENERATIONS: &str = "generations.parquet";
/// One row an entry of the label log.
const LABELS: &str = "labels.parquet";
/// One row a medoid; of a completed campaign.
const TAXONOMY: &str = "taxonomy.parquet";
/// One array, `pictures`.
const PICTURES: &str = "pictures.npz";
/// The folder of the checkpoints, each with its description.
const CHECKPOINTS: &str = "checkpoints";
/// Meaning of the files and columns.
const README: &str = "README.md";
/// Where the data come from, and what they are for.
const DATASHEET: &str = "DATASHEET.md";
