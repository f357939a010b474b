//! The JSON that commands print for programs, and its schemas.
//!
//! Most documents are messages of a coordinator (`Document`). The other documents have a type in this module.

mod campaign;
mod data;
mod document;
mod kinds;
mod labels;
mod machines;
mod robots;

pub(crate) use campaign::{Deletion, Digest, Figure, FigureBehaviour, Report, Run, Taxonomy};
pub(crate) use data::{Backup, Doctor, Export};
pub(crate) use document::Document;
pub use kinds::{KINDS, Kind};
pub(crate) use labels::{AddedLabels, Agreement};
pub(crate) use machines::{
    Certificate, Certificates, LiftedQuarantine, Link, Quarantine, QuarantinedMachine, Token,
};
pub(crate) use robots::{
    Behaviour, Evaluated, ExportedController, FilterScore, Recognised, Robots, Simulated,
};

use murmuration_link::{OutputError, outln};
use murmuration_model::Timestamp;
use schemars::{JsonSchema, Schema, SchemaGenerator, generate::SchemaSettings, json_schema};
use serde::{Serialize, Serializer};
use std::borrow::Cow;

/// Version of the schemas of all documents. The version rises when a field changes its meaning or is removed, not when a field is
/// added.
const VERSION: u32 = 2;

/// The printed document: the version, then its fields.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "{T}")]
struct Versioned<T> {
    /// Version of the document's schema. The version rises when a field changes its meaning or is removed.
    #[schemars(extend("const" = VERSION))]
    schema: u32,
    #[serde(flatten)]
    document: T,
}

/// Largest whole number that documents write as a number. Larger whole numbers become strings, because jq and JavaScript read
/// numbers as doubles.
const MAX_EXACT: u64 = (1 << 53) - 1;

/// A whole number such as a seed.
#[derive(Debug)]
pub struct Whole(pub u64);

impl Serialize for Whole {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            ..=MAX_EXACT => serializer.serialize_u64(self.0),
            beyond => serializer.collect_str(&beyond),
        }
    }
}

impl JsonSchema for Whole {
    fn schema_name() -> Cow<'static, str> {
        "Whole".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["integer", "string"] })
    }
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
    // Only keys that are not strings could make the conversion fail, and the keys of documents are strings.
    outln!("{}", serde_json::to_string(&versioned).unwrap_or_default())
}

/// Prints one document per line.
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
