//! The map in ARCHITECTURE.md.

use crate::pages::{page, root};
use std::{collections::BTreeSet, fs};

pub fn every_module_of_the_coordinator_is_on_the_map_and_no_other() {
    let code = fs::read_to_string(root().join("coordinator/src/lib.rs")).unwrap();
    let modules = code.lines().filter_map(|line| {
        line.trim_start_matches("pub ")
            .strip_prefix("mod ")?
            .strip_suffix(';')
    });
    let modules: BTreeSet<&str> = modules.collect();
    assert!(modules.len() > 30, "{modules:?}");

    let text = page("ARCHITECTURE.md");
    let (_, table) = text.split_once("| module | what it is |").unwrap();
    let (table, _) = table.split_once("\n\n").unwrap();
    let cells = table.lines().filter_map(|row| row.split('|').nth(1));
    let named: BTreeSet<&str> = cells
        .flat_map(|cell| cell.split('`').skip(1).step_by(2))
        .collect();
    assert_eq!(named, modules);
}
