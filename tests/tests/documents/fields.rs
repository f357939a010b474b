//! Every field of a campaign file is documented.

use crate::pages::{page, prose};
use murmuration_proto::spec_sections::sections;

/// Sections that robots.md describes in words and drawings instead of a table of their own.
const IN_WORDS: [&str; 5] = [
    "robot.sensors",
    "species",
    "world.obstacles",
    "world.start",
    "world.noise",
];

/// Sections without fields that people choose between: a recipe's fields are in the table of the recipe's section.
fn table_of(section: &str) -> String {
    match section.split_once(".recipe.") {
        Some((parent, _)) => format!("`[{parent}.recipe]`"),
        None if section == "training.network" => "`[training]`".to_owned(),
        None if section.is_empty() => "the file".to_owned(),
        None => format!("`[{section}]`"),
    }
}

/// The first cells of the rows of all tables of fields of a section.
fn documented(pages: &str, section: &str) -> String {
    let header = format!("| field of {} |", table_of(section));
    let mut cells = String::new();
    let mut inside = false;
    for line in pages.lines() {
        inside = line.starts_with('|') && (inside || line.starts_with(&header));
        if inside {
            cells += line.split('|').nth(1).unwrap_or_default();
        }
    }
    cells
}

pub fn every_field_of_a_campaign_file_is_in_a_table() {
    let pages = [page("docs/campaigns.md"), page("docs/robots.md")].map(|text| prose(&text));
    let tables = pages.concat();
    for (section, fields) in sections() {
        let (text, place) = match IN_WORDS.contains(&section) {
            true => (pages[1].clone(), "docs/robots.md"),
            false => (documented(&tables, section), "a table"),
        };
        for field in fields {
            let names = [
                format!("`{field}`"),
                format!("`network.{field}`"),
                format!("`{field} = "),
            ];
            assert!(
                names.iter().any(|name| text.contains(name)),
                "{place} says nothing of the field {field} of section [{section}]"
            );
        }
    }
}
