//! The sections of a campaign file and their fields, from the contract.

pub use murmuration_proto::sections::{Field, SECTIONS, Section};

/// The contract's explanation of a field, such as `population` of the section `search`; `None` for an unknown field.
#[must_use]
pub fn explanation(section: &str, field: &str) -> Option<&'static str> {
    let section = SECTIONS.iter().find(|known| known.path == section)?;
    let field = section.fields.iter().find(|known| known.name == field)?;
    Some(field.explanation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_is_explained() {
        for section in SECTIONS {
            for field in section.fields.iter() {
                let message = field.explanation;
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
        for section in SECTIONS {
            assert!(!section.fields.is_empty(), "{}", section.path);
        }
        let has = |path: &str| SECTIONS.iter().any(|section| section.path == path);
        for known in [
            "",
            "robot",
            "robot.sensors",
            "species",
            "world.start",
            "world.noise",
            "training.network.layers.convolution",
            "training.recipe",
            "training.recipe.in-batch",
            "training.recipe.paper",
            "feedback.recipe",
            "feedback.recipe.labelled",
            "feedback.recipe.paper-labelled",
        ] {
            assert!(has(known), "{known}");
        }
        assert!(!has("training.recipe.labelled") && !has("feedback.recipe.in-batch"));
        let spec = crate::CampaignSpec::from_toml("model = \"two-sensor\"\nmethod = \"latent\"").unwrap();
        let table: toml::Table = spec.to_toml().parse().unwrap();
        let mut open = vec![(String::new(), table)];
        while let Some((path, table)) = open.pop() {
            assert!(has(&path), "{path}");
            for (name, value) in table {
                if let toml::Value::Table(inner) = value {
                    open.push((format!("{path}.{name}").trim_matches('.').to_owned(), inner));
                }
            }
        }
    }
}
