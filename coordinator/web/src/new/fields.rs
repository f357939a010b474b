//! The fields of the form for a campaign, with explanations from the comments of the Protobuf messages.

use murmuration_swarm::{Method, Preset, spec_sections};
use toml::{Table, Value};

pub(super) struct Field {
    /// The field's section of a campaign file.
    pub(super) section: &'static str,
    /// The field's name in its section.
    pub(super) name: &'static str,
    /// The field's name on the page.
    pub(super) label: &'static str,
    /// The field's effect, in one sentence for newcomers.
    pub(super) meaning: &'static str,
    pub(super) kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Text,
    Number,
    Flag,
    /// The robots: a preset, or robots that only a campaign file can describe.
    Model,
    Method,
}

const fn field(
    path: (&'static str, &'static str),
    label: &'static str,
    kind: Kind,
    meaning: &'static str,
) -> Field {
    let (section, name) = path;
    Field {
        section,
        name,
        label,
        meaning,
        kind,
    }
}

/// The groups of the form, in order.
pub(super) const GROUPS: [(&str, &[Field]); 4] = [
    (
        "What to search",
        &[
            field(
                ("", "name"),
                "Name",
                Kind::Text,
                "The name of the campaign; its address begins with this name.",
            ),
            field(
                ("", "model"),
                "Robots",
                Kind::Model,
                "The robots of the swarm: what they sense and how they drive.",
            ),
            field(
                ("", "method"),
                "Method",
                Kind::Method,
                "How the campaign chooses controllers. latent: it searches for new behaviours by five measured numbers and a network that learns from pictures. hand-crafted: it searches by the five numbers alone. random: it draws controllers at random. exhaustive: it tries all controllers.",
            ),
            field(
                ("", "seed"),
                "Seed",
                Kind::Number,
                "The number that all chance follows from. The same campaign with the same seed finds the same.",
            ),
            field(
                ("world", "agents"),
                "Number of robots",
                Kind::Number,
                "How many robots move at once.",
            ),
            field(
                ("world", "horizon"),
                "Steps",
                Kind::Number,
                "How long a simulation runs.",
            ),
        ],
    ),
    (
        "How far",
        &[
            field(
                ("search", "population"),
                "Population",
                Kind::Number,
                "How many controllers are tried before the next ones are bred from the best of them.",
            ),
            field(
                ("search", "generations"),
                "Generations",
                Kind::Number,
                "How many generations the search has. Twice as many take twice as long.",
            ),
            field(
                ("evaluation", "starts"),
                "Starts of each controller",
                Kind::Number,
                "From how many places each controller is tried: more make the result less a matter of luck.",
            ),
            field(
                ("taxonomy", "medoids"),
                "Behaviours in the taxonomy",
                Kind::Number,
                "How many behaviours the result shows. They are far from each other, and each (a medoid) stands for the behaviours that are nearest to it.",
            ),
            field(
                ("", "filter"),
                "Leave out dull controllers",
                Kind::Flag,
                "A rule of thumb (the paper's heuristic filter) leaves out controllers that will hardly do anything, before they are simulated.",
            ),
        ],
    ),
    (
        "The network that compares behaviours, for the method latent",
        &[
            field(
                ("dataset", "controllers"),
                "Controllers it learns from",
                Kind::Number,
                "How many random controllers are simulated first, for pictures that the network (the embedder) learns from.",
            ),
            field(
                ("dataset", "starts"),
                "Starts of each",
                Kind::Number,
                "From how many places each of these is simulated: the network learns that they are the same behaviour.",
            ),
        ],
    ),
    (
        "Learning from labels, for the method latent",
        &[
            field(
                ("feedback", "rounds"),
                "Unattended rounds",
                Kind::Number,
                "How often the campaign labels with its rule-based judge, learns from that and searches on. You can begin further rounds on the pages.",
            ),
            field(
                ("feedback", "labels"),
                "Labels of a round",
                Kind::Number,
                "How many behaviours the judge labels each time.",
            ),
            field(
                ("feedback", "generations"),
                "Generations after each round",
                Kind::Number,
                "How many generations the search adds after each round.",
            ),
        ],
    ),
];

pub(super) fn fields() -> impl Iterator<Item = &'static Field> {
    GROUPS.iter().flat_map(|(_, fields)| *fields)
}

/// The robots of the initial form.
pub(super) const USUAL_ROBOTS: &str = "single-sensor";

/// The parts of a campaign file that describe the robots.
pub(super) const OWN_ROBOTS: [&str; 3] = ["ratios", "robot", "species"];

/// The path of a field in a campaign file.
pub(super) fn path(section: &str, name: &str) -> String {
    match section {
        "" => name.to_owned(),
        section => format!("{section}.{name}"),
    }
}

/// A comment in the Protobuf messages without names of RPC methods.
pub(super) fn shown(comment: &str) -> String {
    comment.replace(" (RefineCampaign)", "")
}

impl Field {
    /// The field's path in a campaign file, which is also its name in the form.
    pub(super) fn path(&self) -> String {
        path(self.section, self.name)
    }

    /// The comment on the field in the Protobuf messages, without names of RPC methods.
    pub(super) fn explanation(&self) -> String {
        shown(spec_sections::explanation(self.section, self.name).unwrap_or_default())
    }

    /// The values that people can choose from; empty for free text.
    pub(super) fn choices(&self) -> Vec<&'static str> {
        match self.kind {
            Kind::Model => Preset::ALL.iter().map(|preset| preset.name()).collect(),
            Kind::Method => Method::ALL.iter().map(|method| method.name()).collect(),
            Kind::Text | Kind::Number | Kind::Flag => Vec::new(),
        }
    }

    /// The field's value in a campaign file, as text; empty if the file omits the field.
    pub(super) fn value(&self, table: &Table) -> String {
        let table = match self.section {
            "" => Some(table),
            section => table.get(section).and_then(Value::as_table),
        };
        match table.and_then(|table| table.get(self.name)) {
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
            None => String::new(),
        }
    }

    /// Writes the entered text into a campaign file; empty text removes the field.
    pub(super) fn put(&self, table: &mut Table, text: &str) {
        let text = text.trim();
        let value = match (self.kind, text) {
            (_, "") => None,
            (Kind::Flag, _) => Some(Value::Boolean(true)),
            (Kind::Number, text) => Some(number(text)),
            (Kind::Text | Kind::Model | Kind::Method, text) => Some(Value::String(text.to_owned())),
        };
        let table = match self.section {
            "" => table,
            section => {
                let entry = table.entry(section).or_insert_with(|| Value::Table(Table::new()));
                // If the section is not a table, `checked` refuses the whole file later and reports the section.
                let Some(table) = entry.as_table_mut() else { return };
                table
            }
        };
        match value {
            Some(value) => drop(table.insert(self.name.to_owned(), value)),
            None => drop(table.remove(self.name)),
        }
    }
}

/// A number, with or without commas. Other text stays text, so that the later error names the field.
fn number(text: &str) -> Value {
    let plain = without_groups(text);
    match (plain.parse::<i64>(), plain.parse::<f64>()) {
        (Ok(whole), _) => Value::Integer(whole),
        (_, Ok(other)) => Value::Float(other),
        _ => Value::String(text.to_owned()),
    }
}

/// Removes thousands separators, as in `10,000` and `10_000`. Other commas stay: `1,5` is not 15.
fn without_groups(text: &str) -> String {
    for separator in [',', '_'] {
        let mut groups = text.trim_start_matches('-').split(separator);
        let first = groups.next().map_or(0, str::len);
        let is_group = |group: &str| group.len() == 3 && group.bytes().all(|byte| byte.is_ascii_digit());
        if text.contains(separator) && (1..=3).contains(&first) && groups.all(is_group) {
            return text.replace(separator, "");
        }
    }
    text.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_part_thousands_and_nothing_else() {
        let read = ["10,000", "1_000_000", "-1,000", "1,5", "1,0000", "2.5", "7"].map(number);
        let message = |text: &str| Value::String(text.to_owned());
        assert_eq!(
            read,
            [
                Value::Integer(10_000),
                Value::Integer(1_000_000),
                Value::Integer(-1_000),
                message("1,5"),
                message("1,0000"),
                Value::Float(2.5),
                Value::Integer(7),
            ]
        );
    }

    #[test]
    fn every_field_is_one_of_campaign_files_and_explained() {
        for field in fields() {
            let section = spec_sections::SECTIONS
                .iter()
                .find(|known| known.path == field.section)
                .unwrap();
            assert!(
                section.fields.iter().any(|known| known.name == field.name),
                "{}",
                field.path()
            );
            assert!(
                !field.explanation().is_empty() && field.meaning.ends_with('.'),
                "{}",
                field.path()
            );
        }
    }

    #[test]
    fn what_is_written_is_put_in_and_what_is_emptied_is_taken_out() {
        let population = fields()
            .find(|field| field.path() == "search.population")
            .unwrap();
        let mut table = Table::new();
        population.put(&mut table, " 1,000 ");
        assert_eq!(table.to_string(), "[search]\npopulation = 1000\n");
        assert_eq!(population.value(&table), "1000");
        population.put(&mut table, "many");
        assert_eq!(population.value(&table), "many");
        population.put(&mut table, "");
        assert_eq!(population.value(&table), "");
    }
}
