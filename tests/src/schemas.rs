//! Checks the JSON that commands print against the schemas that `murmuration schema` prints.

use crate::binary;
use boon::Compiler;
use serde_json::{Value, json};
use std::process::Command;

/// The schema of a kind of documents, as the program prints it.
#[must_use]
pub fn schema(kind: &str) -> Value {
    let output = Command::new(binary("murmuration"))
        .args(["schema", kind])
        .output()
        .unwrap();
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("the schema of {kind}: {error}"))
}

/// Checks that each line is a document of this kind, and that the schema rejects spoilt documents.
#[track_caller]
pub fn check_documents(kind: &str, lines: &str) {
    let location = format!("http://murmuration/{kind}");
    let mut compiler = Compiler::new();
    compiler.enable_format_assertions();
    compiler.add_resource(&location, schema(kind)).unwrap();
    let mut schemas = boon::Schemas::new();
    let schema = compiler.compile(&location, &mut schemas).unwrap();
    for line in lines.lines() {
        let document: Value = serde_json::from_str(line).unwrap();
        let valid = schemas.validate(&document, schema);
        assert!(valid.is_ok(), "{kind}: {document}\n{:#}", valid.unwrap_err());
        for spoilt in spoilt(&document) {
            let valid = schemas.validate(&spoilt, schema);
            assert!(valid.is_err(), "the schema of {kind} allows {spoilt}");
        }
    }
    assert!(!lines.is_empty(), "{kind}: nothing was printed");
}

/// Documents that the schema must reject: a field is missing, has another type, or has another version.
fn spoilt(document: &Value) -> Vec<Value> {
    let fields = document.as_object().unwrap();
    let mut spoilt = Vec::new();
    for field in fields.keys() {
        let mut without = fields.clone();
        without.remove(field);
        spoilt.push(without.into());
        let mut wrong = fields.clone();
        wrong.insert(field.clone(), json!([[true]]));
        spoilt.push(wrong.into());
    }
    let mut other = fields.clone();
    other.insert("schema".to_owned(), 0.into());
    spoilt.push(other.into());
    spoilt
}
