//! Checks the map of crates in ARCHITECTURE.md.

use crate::arrows::FLOORS;
use murmuration_tests::pages::{page, root};
use std::fs;

/// Checks that the map has exactly the existing crates, each on its floor, with its public modules.
pub fn every_crate_is_on_the_map_with_its_floor_and_its_public_modules() {
    let text = page("ARCHITECTURE.md");
    let (_, table) = text.split_once("| floor | crate |").unwrap();
    let (table, _) = table.split_once("\n\n").unwrap();
    let rows: Vec<Vec<&str>> = table
        .lines()
        .skip(2)
        .map(|row| {
            row.split(" | ")
                .map(|cell| cell.trim_matches(['|', ' ']))
                .collect()
        })
        .collect();
    let named: Vec<(&str, u8)> = rows
        .iter()
        .map(|row| (row[1].trim_matches('`'), row[0].parse().unwrap()))
        .collect();
    assert_eq!(named, FLOORS);

    let mut modules = 0;
    for (row, (folder, _)) in rows.iter().zip(FLOORS) {
        let code = fs::read_to_string(root().join(folder).join("src/lib.rs")).unwrap();
        let public = code
            .lines()
            .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
        for module in public.filter(|_| *folder != "tests") {
            let is_named = row[2].split('`').skip(1).step_by(2).any(|name| name == module);
            assert!(is_named, "the map does not name {module} of {folder}");
            modules += 1;
        }
    }
    assert!(modules > 30, "{modules}");
}
