//! The folder that a campaign is exported to. An import reads the campaign's database in this folder. The folder also has the
//! same data as Parquet, NPZ, ONNX, TOML and JSON, a page about the columns, and a datasheet.
//!
//! This crate receives data and writes files; it reads neither a data directory nor the network. A folder gets its name once all
//! its files are written.

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

/// The whole campaign, as an SQLite database.
const DATABASE: &str = "campaign.sqlite";
/// The specification, as TOML.
const SPEC: &str = "spec.toml";
/// The facts about the campaign that no table has, as JSON.
const CAMPAIGN: &str = "campaign.json";
/// The table of individuals.
const INDIVIDUALS: &str = "individuals.parquet";
/// The table of generations.
const GENERATIONS: &str = "generations.parquet";
/// The table of entries of the label log.
const LABELS: &str = "labels.parquet";
/// The table of medoids, if the campaign has completed.
const TAXONOMY: &str = "taxonomy.parquet";
/// The pictures, as the array `pictures`.
const PICTURES: &str = "pictures.npz";
/// The folder of the checkpoints, each with its description.
const CHECKPOINTS: &str = "checkpoints";
/// The page about the files and columns.
const README: &str = "README.md";
/// The datasheet: where the data come from, and what they are for.
const DATASHEET: &str = "DATASHEET.md";
