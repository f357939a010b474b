//! The JSON that commands print, beside the schemas that `murmuration schema` prints.

use crate::command_line::Desk;
use boon::Compiler;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Kinds that no transcript prints, since they take a machine that computed wrongly, or minutes, or name the machine.
const NOT_PRINTED: [&str; 4] = ["lifted-quarantine", "bench-all", "bench-train", "bench-labels"];

/// The schemas that the program prints.
pub struct Schemas<'a> {
    desk: &'a Desk,
    used: BTreeSet<String>,
}

impl<'a> Schemas<'a> {
    pub fn new(desk: &'a Desk) -> Self {
        Self {
            desk,
            used: BTreeSet::new(),
        }
    }

    /// Checks that each line is a document of this kind.
    #[track_caller]
    pub fn check(&mut self, kind: &str, lines: &str) {
        let schema = self.desk.murmuration.run(&["schema", kind]).stdout;
        let location = format!("http://murmuration/{kind}");
        let mut compiler = Compiler::new();
        compiler.enable_format_assertions();
        compiler
            .add_resource(&location, serde_json::from_str(&schema).unwrap())
            .unwrap();
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
        self.used.insert(kind.to_owned());
    }

    pub fn check_that_all_were_used(&self, kinds: &[String]) {
        let unused = kinds.iter().filter(|kind| !self.used.contains(*kind));
        assert_eq!(unused.collect::<Vec<_>>(), NOT_PRINTED);
    }
}

/// Documents that the schema must not allow: without a field, with a field of another type, of another version.
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
    other.insert("schema".to_owned(), 2.into());
    spoilt.push(other.into());
    spoilt
}
