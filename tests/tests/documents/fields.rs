//! Checks that every field of a campaign file is documented.

use murmuration_swarm::spec_sections::SECTIONS;
use murmuration_tests::pages::{page, prose};

/// Sections that robots.md describes in words and drawings instead of a table.
const IN_WORDS: [&str; 5] = [
    "robot.sensors",
    "species",
    "world.obstacles",
    "world.start",
    "world.noise",
];

/// The tables that document the fields of a section, each by its name in the first cell of its first row. A recipe's fields are
/// in the table of its section; fields of a feedback recipe can also be in the table of training recipes.
fn tables_of(section: &str) -> Vec<String> {
    match section {
        "" => vec!["the file".to_owned()],
        "training.network" => vec!["`[training]`".to_owned()],
        "training.recipe" | "feedback.recipe" => vec!["`recipe`".to_owned()],
        section if section.starts_with("training.network.layers") => {
            vec!["`[training.network.layers]`".to_owned()]
        }
        section if section.starts_with("feedback.recipe.") => {
            vec!["`[feedback.recipe]`".to_owned(), "`[training.recipe]`".to_owned()]
        }
        section if section.starts_with("training.recipe.") => vec!["`[training.recipe]`".to_owned()],
        section => vec![format!("`[{section}]`")],
    }
}

/// The first cells of the rows of all tables that document a section.
fn documented(pages: &str, section: &str) -> String {
    let headers = tables_of(section)
        .into_iter()
        .map(|name| format!("| field of {name} |"));
    let headers: Vec<String> = headers.collect();
    let mut cells = String::new();
    let mut inside = false;
    for line in pages.lines() {
        inside = line.starts_with('|') && (inside || headers.iter().any(|header| line.starts_with(header)));
        if inside {
            cells += line.split('|').nth(1).unwrap_or_default();
        }
    }
    cells
}

pub fn every_field_of_a_campaign_file_is_in_a_table() {
    let pages = [page("docs/campaigns.md"), page("docs/robots.md")].map(|text| prose(&text));
    let tables = pages.concat();
    for section in SECTIONS {
        let (section, fields) = (section.path, section.fields);
        let (text, place) = match IN_WORDS.contains(&section) {
            true => (pages[1].clone(), "docs/robots.md"),
            false => (documented(&tables, section), "a table"),
        };
        let last = section.rsplit('.').next().unwrap_or_default();
        for field in fields.iter().map(|field| field.name) {
            let names = [
                format!("`{field}`"),
                format!("`{last}.{field}`"),
                format!("`{field}."),
                format!("`{field} = "),
            ];
            assert!(
                names.iter().any(|name| text.contains(name)),
                "{place} says nothing of the field {field} of section [{section}]"
            );
        }
    }
}
