//! The editor of robots: a drawing with handles, and fields. Its script writes the text of a description, on the page Play and on
//! the page for a new campaign.

use maud::{Markup, html};
use toml::{Table, Value};

/// The id of the text that the editor reads and writes.
pub(in super::super) const TEXT: &str = "robot";

/// The parts of a description that the editor shows.
const SHOWN: [&str; 2] = ["robot", "species"];

/// The editor. Without scripts, it is hidden.
pub(in super::super) fn editor() -> Markup {
    html! {
        section.robot-editor.scripted #robot-editor aria-label="Robot editor" hidden {}
    }
}

/// The robots of a campaign file as text, with one line for each sensor.
pub(in super::super) fn robots_text(own: &Table) -> String {
    let mut text = String::new();
    let (tables, values): (Vec<_>, Vec<_>) = own.iter().partition(|(name, _)| SHOWN.contains(&name.as_str()));
    for (name, value) in values {
        text += &format!("{name} = {value}\n");
    }
    for (name, value) in tables {
        match value {
            Value::Table(robot) => text += &format!("[{name}]\n{}", fields_of(robot, "")),
            Value::Array(species) => {
                for one in species.iter().filter_map(Value::as_table) {
                    text += &format!("[[{name}]]\n{}", species_text(one));
                }
            }
            other => text += &format!("{name} = {other}\n"),
        }
    }
    text
}

fn species_text(species: &Table) -> String {
    let (robot, values): (Table, Table) = species
        .clone()
        .into_iter()
        .partition(|(name, value)| name == "robot" && value.is_table());
    let robot = robot.get("robot").and_then(Value::as_table);
    fields_of(&values, "") + &robot.map_or_else(String::new, |robot| fields_of(robot, "robot."))
}

/// The fields of a table, each on a line; a list of tables has a line for each table.
fn fields_of(table: &Table, before: &str) -> String {
    let mut text = String::new();
    for (name, value) in table {
        let items = value.as_array().filter(|items| items.iter().any(Value::is_table));
        match items {
            Some(items) => {
                let lines: String = items.iter().map(|item| format!("  {item},\n")).collect();
                text += &format!("{before}{name} = [\n{lines}]\n");
            }
            None => text += &format!("{before}{name} = {value}\n"),
        }
    }
    text
}
