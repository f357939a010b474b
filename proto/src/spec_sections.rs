//! The sections of a campaign file and their fields.

use crate::{
    training::{InBatch, Labelled, NetworkSettings, PaperLabelled, RandomTriplets, Settings},
    v1,
};
use serde::de::DeserializeOwned;

/// The fields of every section, by the section's name (`world.start`); the top of the file has the name "".
#[must_use]
pub fn sections() -> [(&'static str, Vec<String>); 21] {
    [
        ("", fields::<v1::CampaignSpec>()),
        ("robot", fields::<v1::Robot>()),
        ("robot.sensors", fields::<v1::Sensor>()),
        ("species", fields::<v1::Species>()),
        ("world", fields::<v1::World>()),
        ("world.obstacles", fields::<v1::Obstacle>()),
        ("world.start", fields::<v1::StartShape>()),
        ("world.noise", fields::<v1::Noise>()),
        ("image", fields::<v1::ImageFormat>()),
        ("controllers", fields::<v1::ControllerSpace>()),
        ("search", fields::<v1::Search>()),
        ("evaluation", fields::<v1::EvaluationParams>()),
        ("taxonomy", fields::<v1::TaxonomyFormat>()),
        ("dataset", fields::<v1::Dataset>()),
        ("training", fields::<Settings>()),
        ("training.network", fields::<NetworkSettings>()),
        ("training.recipe.in-batch", fields::<InBatch>()),
        ("training.recipe.paper", fields::<RandomTriplets>()),
        ("feedback", fields::<v1::Feedback>()),
        ("feedback.recipe.labelled", fields::<Labelled>()),
        ("feedback.recipe.paper-labelled", fields::<PaperLabelled>()),
    ]
}

/// The comments on the fields of messages: message, field, comment.
const COMMENTS: &[(&str, &str, &str)] = include!(concat!(env!("OUT_DIR"), "/comments.rs"));

/// The messages of sections.
const MESSAGES: [(&str, &str); 15] = [
    ("", "CampaignSpec"),
    ("robot", "Robot"),
    ("robot.sensors", "Sensor"),
    ("species", "Species"),
    ("world", "World"),
    ("world.obstacles", "Obstacle"),
    ("world.start", "StartShape"),
    ("world.noise", "Noise"),
    ("image", "ImageFormat"),
    ("controllers", "ControllerSpace"),
    ("search", "Search"),
    ("evaluation", "EvaluationParams"),
    ("taxonomy", "TaxonomyFormat"),
    ("dataset", "Dataset"),
    ("feedback", "Feedback"),
];

/// Explanation of a field in the contract, such as `population` of the section `search`; `None` if it has none.
#[must_use]
pub fn explanation(section: &str, field: &str) -> Option<&'static str> {
    let (_, message) = MESSAGES.iter().find(|(known, _)| *known == section)?;
    let mut found = COMMENTS.iter();
    let found = found.find(|(of, known, _)| (*of, *known) == (*message, field));
    found.map(|(_, _, comment)| *comment)
}

/// The fields of a message. Serde lists them in its error about an unknown field.
fn fields<T: DeserializeOwned>() -> Vec<String> {
    match toml::from_str::<T>("'?' = 0") {
        Ok(_) => Vec::new(),
        Err(error) => quoted_names(error.message()).skip(1).map(str::to_owned).collect(),
    }
}

/// The texts between backticks.
pub(crate) fn quoted_names(message: &str) -> impl Iterator<Item = &str> {
    message.split('`').skip(1).step_by(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_of_a_message_is_explained() {
        for (section, fields) in sections() {
            if !MESSAGES.iter().any(|(known, _)| *known == section) {
                continue;
            }
            for field in fields {
                let said = explanation(section, &field).unwrap_or_default();
                assert!(said.ends_with('.'), "{section} {field}: {said:?}");
            }
        }
        let population = explanation("search", "population").unwrap();
        assert!(
            population.starts_with("Controllers per generation, 1 to 100,000;"),
            "{population}"
        );
    }

    #[test]
    fn every_section_has_fields_and_every_table_of_a_campaign_file_is_a_section() {
        let sections = sections();
        for (section, fields) in &sections {
            assert!(!fields.is_empty(), "{section}");
        }
        let has = |name: &str| sections.iter().any(|(section, _)| *section == name);
        let spec = crate::CampaignSpec::from_toml("model = \"two-sensor\"\nmethod = \"latent\"").unwrap();
        let table: toml::Table = spec.to_toml().parse().unwrap();
        let mut open = vec![(String::new(), table)];
        while let Some((path, table)) = open.pop() {
            // A recipe's table holds only its name.
            assert!(has(&path) || path.ends_with("recipe"), "{path}");
            for (name, value) in table {
                if let toml::Value::Table(inner) = value {
                    open.push((format!("{path}.{name}").trim_matches('.').to_owned(), inner));
                }
            }
        }
    }
}
