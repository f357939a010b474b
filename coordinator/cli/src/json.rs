//! The JSON that commands print for programs: one type for each kind of document, and the schema of each.

mod campaign;
mod data;
mod kinds;
mod labels;
mod machines;
mod robots;
mod taxonomy;

pub(crate) use campaign::{Campaign, Deletion, Digest, Individual, Report, Run};
pub(crate) use data::{Backup, Checkpoint, Doctor, Export};
pub use kinds::{KINDS, Kind};
pub(crate) use labels::{AddedLabels, Agreement, Class, Label};
pub(crate) use machines::{
    Certificate, Certificates, LiftedQuarantine, Quarantine, QuarantinedMachine, Token,
};
pub(crate) use robots::{
    Behaviour, Evaluated, ExportedController, FilterScore, Neighbour, Recognised, Robots,
};
pub(crate) use taxonomy::Taxonomy;

use murmuration_link::{OutputError, outln};
use murmuration_model::Timestamp;
use schemars::{JsonSchema, Schema, generate::SchemaSettings};
use serde::Serialize;

/// Version of every document; it rises when a field changes its meaning or is removed. New fields leave it as it is.
const VERSION: u32 = 1;

/// What is printed: the version, then the fields of the document.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "{T}")]
struct Versioned<T> {
    /// Version of the document's schema. It rises when a field changes its meaning or is removed.
    #[schemars(extend("const" = VERSION))]
    schema: u32,
    #[serde(flatten)]
    document: T,
}

/// A time in UTC, as RFC 3339 writes it.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline, extend("format" = "date-time"))]
struct Time(String);

impl Time {
    /// `ms` is milliseconds since 1970-01-01 UTC.
    fn of_ms(ms: u64) -> Self {
        Self(Timestamp::from_ms(ms).to_string())
    }
}

/// Prints one document on one line.
pub fn print<T: Serialize>(document: T) -> Result<(), OutputError> {
    let versioned = Versioned {
        schema: VERSION,
        document,
    };
    // No document has a key that is no string, and nothing else can fail.
    outln!("{}", serde_json::to_string(&versioned).unwrap_or_default())
}

/// Prints one document a line.
pub fn print_all<T: Serialize>(documents: impl IntoIterator<Item = T>) -> Result<(), OutputError> {
    documents.into_iter().try_for_each(print)
}

/// The JSON Schema of a document.
fn schema_of<T: JsonSchema>() -> Schema {
    let generator = || SchemaSettings::draft2020_12().for_serialize().into_generator();
    let mut schema = generator().into_root_schema_for::<Versioned<T>>();
    if let Some(description) = generator().into_root_schema_for::<T>().remove("description") {
        schema.insert("description".to_owned(), description);
    }
    schema
}
