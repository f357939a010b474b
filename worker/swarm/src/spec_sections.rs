//! The sections of a campaign file and their fields, from the message `CampaignSpec`, the messages in it, and trainings.

use crate::{
    field_names::field_names,
    training::{InBatch, Labelled, NetworkSettings, PaperLabelled, RandomTriplets, Settings},
};
use murmuration_proto::sections::MESSAGES;
use serde::de::DeserializeOwned;

pub use murmuration_proto::sections::{Field, Section};

/// Every section of a campaign file.
#[must_use]
pub fn sections() -> Vec<Section> {
    let mut sections = MESSAGES.to_vec();
    sections.extend([
        of_training::<Settings>("training"),
        of_training::<NetworkSettings>("training.network"),
        of_training::<InBatch>("training.recipe.in-batch"),
        of_training::<RandomTriplets>("training.recipe.paper"),
        of_training::<Labelled>("feedback.recipe.labelled"),
        of_training::<PaperLabelled>("feedback.recipe.paper-labelled"),
    ]);
    sections
}

/// The contract's explanation of a field, such as `population` of the section `search`; `None` if the contract has none.
#[must_use]
pub fn explanation(section: &str, field: &str) -> Option<&'static str> {
    let section = MESSAGES.iter().find(|known| known.path == section)?;
    let field = section.fields.iter().find(|known| known.name == field)?;
    field.explanation
}

fn of_training<T: DeserializeOwned>(path: &'static str) -> Section {
    let unexplained = |&name: &&'static str| Field {
        name,
        explanation: None,
    };
    Section {
        path,
        fields: field_names::<T>().iter().map(unexplained).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_of_a_message_is_explained() {
        for section in MESSAGES {
            for field in section.fields.iter() {
                let message = field.explanation.unwrap_or_default();
                assert!(
                    message.ends_with('.'),
                    "{} {}: {message:?}",
                    section.path,
                    field.name
                );
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
        for section in &sections {
            assert!(!section.fields.is_empty(), "{}", section.path);
        }
        let has = |path: &str| sections.iter().any(|section| section.path == path);
        for known in [
            "",
            "robot",
            "robot.sensors",
            "species",
            "world.start",
            "world.noise",
        ] {
            assert!(has(known), "{known}");
        }
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
