//! The editor of robots: a drawing with handles, and fields. Its script writes the text of a description, on the page Play and on
//! the page for a new campaign.

use super::asked::Form;
use axum::Json;
use maud::{Markup, html};
use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, CapabilityModel, Robot};
use serde::Serialize;
use toml::{Table, Value};

/// The id of the text that the editor reads and writes.
pub(super) const TEXT: &str = "robot";

/// Maximum size of a description in bytes: the encoded description still fits into an address.
pub(super) const MOST_DESCRIPTION_BYTES: usize = 6000;

/// A robot with the paper's sensor, whose other fields have their defaults.
const USUAL: &str = "[robot]\nsensors = [{}]\n";

/// The parts of a description that the editor shows.
const SHOWN: [&str; 2] = ["robot", "species"];

/// A description as the editor shows it.
#[derive(Debug, Default, Serialize)]
pub(super) struct Described {
    /// Why the text cannot be shown; absent if it can.
    error: Option<String>,
    /// Comments at the beginning of the text.
    head: String,
    /// The text before the robots, and the text after them, which the editor keeps.
    before: String,
    after: String,
    /// Whether other comments are lost when the editor writes the text.
    loses_comments: bool,
    /// The number of robots that the text gives for the world; `None` if it gives none.
    agents: Option<Value>,
    /// Radius of the bodies and of the wheels of robots that give none.
    radius: f64,
    wheel_radius: f64,
    robots: Vec<Shown>,
}

/// The robots of one kind.
#[derive(Debug, Serialize)]
struct Shown {
    /// The fields of the species other than its robot; `None` if there are no species.
    species: Option<Table>,
    /// The fields of the robot that differ from their defaults.
    robot: Table,
}

/// Reads a text for the editor.
pub(super) async fn described(Form(parameters): Form<Vec<(String, String)>>) -> Json<Described> {
    let text = parameters.iter().find(|(name, _)| name == TEXT);
    let text = text.map_or("", |(_, text)| text).replace("\r\n", "\n");
    Json(read(&text).unwrap_or_else(|error| Described {
        error: Some(error),
        ..Described::default()
    }))
}

/// Reads a description; an empty text is a robot with the paper's sensor.
fn read(text: &str) -> Result<Described, String> {
    if text.len() > MOST_DESCRIPTION_BYTES {
        return Err(format!(
            "The text has {} bytes; an address has room for {MOST_DESCRIPTION_BYTES}.",
            text.len()
        ));
    }
    let text = if text.trim().is_empty() { USUAL } else { text };
    let (model, world) = CampaignSpec::robots_from_toml(text).map_err(|error| error.to_string())?;
    let mut table: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    let agents = table.get("world").and_then(|world| world.get("agents")).cloned();
    let robots = shown(&mut table, &model);
    let (tables, values): (Table, Table) = table.into_iter().partition(|(_, value)| has_tables(value));
    let (head, rest) = text.split_at(head_of(text));
    Ok(Described {
        error: None,
        head: head.to_owned(),
        before: values.to_string(),
        after: tables.to_string(),
        loses_comments: rest.contains('#'),
        agents,
        radius: world.radius(),
        wheel_radius: world.wheel_radius(),
        robots,
    })
}

/// Takes the robots out of a table. Presets are described in full.
fn shown(table: &mut Table, model: &CapabilityModel) -> Vec<Shown> {
    table.remove("model");
    let own = table.remove("robot");
    let Some(Value::Array(species)) = table.remove("species") else {
        let robots = model.species().iter().map(|of| Shown {
            species: None,
            robot: match &own {
                Some(Value::Table(robot)) => robot.clone(),
                _ => robot_table(of.robot()),
            },
        });
        return robots.collect();
    };
    let pairs = species.into_iter().zip(model.species());
    let shown = pairs.map(|(fields, of)| {
        let mut fields = fields.as_table().cloned().unwrap_or_default();
        fields.remove("model");
        let robot = match fields.remove("robot") {
            Some(Value::Table(robot)) => robot,
            _ => robot_table(of.robot()),
        };
        Shown {
            species: Some(fields),
            robot,
        }
    });
    shown.collect()
}

/// The length of the comments and empty lines with which a text begins.
fn head_of(text: &str) -> usize {
    let is_comment = |line: &&str| line.trim().is_empty() || line.trim_start().starts_with('#');
    text.split_inclusive('\n')
        .take_while(is_comment)
        .map(str::len)
        .sum()
}

/// The text that describes a robot, such as that of a preset.
pub(super) fn robot_text(robot: &Robot) -> String {
    robots_text(&Table::from_iter([(
        "robot".to_owned(),
        robot_table(robot).into(),
    )]))
}

/// The fields of a robot that differ from their defaults, and its radii.
fn robot_table(robot: &Robot) -> Table {
    let whole = |robot: &Robot| Table::try_from(v1::Robot::from(robot)).unwrap_or_default();
    let mut table = whole(robot);
    let usual = CampaignSpec::robots_from_toml(USUAL).ok();
    let usual = usual.and_then(|(model, _)| Some(whole(model.species().first()?.robot())));
    if let Some(usual) = usual {
        let usual_sensor = usual["sensors"].get(0).and_then(Value::as_table);
        if let Some((sensors, usual)) = table
            .get_mut("sensors")
            .and_then(Value::as_array_mut)
            .zip(usual_sensor)
        {
            for sensor in sensors.iter_mut().filter_map(Value::as_table_mut) {
                sensor.retain(|name, value| usual.get(name) != Some(value));
            }
        }
        table.retain(|name, value| name.contains("radius") || usual.get(name) != Some(value));
    }
    table
}

/// Whether a value stands below a head of its own in a file, so that no field of the top can follow.
pub(super) fn has_tables(value: &Value) -> bool {
    let items = value.as_array();
    value.is_table() || items.is_some_and(|items| items.iter().any(Value::is_table))
}

/// The editor. Without scripts, it is hidden.
pub(super) fn editor() -> Markup {
    html! {
        section.robot-editor.scripted #robot-editor aria-label="Robot editor" hidden {
            p.reason {
                "Drag the handles of a sensor, or use the arrow keys on them. The text follows the drawing. The robot heads to the "
                "right; positive angles turn clockwise, as in the pictures."
            }
            div.robot-fields {}
            p.status role="status" {}
        }
    }
}

/// The robots of a campaign file as text, with one line for each sensor.
pub(super) fn robots_text(own: &Table) -> String {
    let (tables, values): (Vec<_>, Vec<_>) = own.iter().partition(|(name, _)| SHOWN.contains(&name.as_str()));
    let values: String = values
        .iter()
        .map(|(name, value)| format!("{name} = {value}\n"))
        .collect();
    let mut parts = vec![values];
    for (name, value) in tables {
        match value {
            Value::Table(robot) => parts.push(format!("[{name}]\n{}", fields_of(robot, ""))),
            Value::Array(species) => {
                let species = species.iter().filter_map(Value::as_table);
                parts.extend(species.map(|one| format!("[[{name}]]\n{}", species_text(one))));
            }
            // The later check refuses it.
            other => parts.push(format!("{name} = {other}\n")),
        }
    }
    parts.retain(|part| !part.is_empty());
    parts.join("\n")
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

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::Preset;

    #[test]
    fn the_text_of_a_preset_is_that_preset() {
        for preset in Preset::ALL {
            let model = CapabilityModel::from(preset);
            let text = robot_text(model.species()[0].robot());
            let (read, _) = CampaignSpec::robots_from_toml(&text).unwrap();
            assert_eq!(read, model, "{text}");
        }
    }

    #[test]
    fn what_the_editor_does_not_show_is_kept() {
        let text = "# a note\n\nname = \"x\"\nratios = [[12, 12]]\n[world]\nwidth = 700.0\n[[species]]\nname = \"a\" # first\nmodel = \"two-sensor\"\n\
                    [[species]]\nname = \"b\"\nrobot.sensors = [{ angle = 1.0 }]\n";
        let described = read(text).unwrap();
        assert_eq!(described.head, "# a note\n\n");
        assert_eq!(described.before, "name = \"x\"\nratios = [[12, 12]]\n");
        assert_eq!(described.after, "[world]\nwidth = 700.0\n");
        assert!(described.loses_comments);
        let [a, b] = &described.robots[..] else {
            panic!("{described:?}")
        };
        assert_eq!(a.species.as_ref().unwrap().to_string(), "name = \"a\"\n");
        assert_eq!(a.robot["sensors"].as_array().map(Vec::len), Some(2));
        assert_eq!(b.robot["sensors"].to_string(), "[{ angle = 1.0 }]");
    }

    #[test]
    fn the_number_of_robots_is_that_of_the_text() {
        let agents = |world: &str| read(&format!("{USUAL}{world}")).unwrap().agents;
        assert_eq!(agents("[world]\nagents = 30\n"), Some(Value::Integer(30)));
        assert_eq!(agents("[world]\nwidth = 700\n"), None);
        assert_eq!(agents(""), None);
    }

    #[test]
    fn a_wrong_text_says_why_and_an_empty_one_is_a_robot() {
        assert!(
            read("[robot]\nsensors = [{ fov = 1 }]")
                .unwrap_err()
                .contains("half_angle")
        );
        assert!(read(&"x".repeat(MOST_DESCRIPTION_BYTES + 1)).is_err());
        assert_eq!(read(" \n").unwrap().robots.len(), 1);
    }

    #[test]
    fn robots_are_written_with_a_line_for_each_sensor() {
        let text = "ratios = [[1, 2]]\n\n[[species]]\nname = \"a\"\nrobot.radius = 5.0\nrobot.sensors = [\n  {},\n  { angle = 1.0 },\n]\n\n\
                    [[species]]\nmodel = \"two-sensor\"\nname = \"b\"\n";
        assert_eq!(robots_text(&text.parse().unwrap()), text);
    }
}
