//! Every field of a campaign file with its explanation, from the comments of the Protobuf messages.

use super::fields::{path, shown};
use maud::{Markup, html};
use murmuration_swarm::spec_sections::SECTIONS;

/// The list of all fields, folded at first.
pub(super) fn list() -> Markup {
    html! {
        details.every-field {
            summary { "Every field of a campaign file" }
            p.reason { "A field that is left out has its default. " code { "murmuration show" } " prints all fields with the values that a campaign has." }
            @for section in SECTIONS {
                h3 { @if section.path.is_empty() { "At the top of the file" } @else { code { "[" (section.path) "]" } } }
                dl { @for field in section.fields { div { dt { code { (path(section.path, field.name)) } } dd { (shown(field.explanation)) } } } }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_of_a_campaign_file_is_listed() {
        let page = list().into_string();
        for section in SECTIONS {
            for field in section.fields {
                let path = path(section.path, field.name);
                assert!(page.contains(&format!("<dt><code>{path}</code></dt>")), "{path}");
            }
        }
        assert!(
            page.contains("Controllers per generation, 1 to 100,000"),
            "{page}"
        );
        assert!(
            page.contains("Exponent, 0 to 8, by which training shows rare behaviours more often"),
            "{page}"
        );
        assert!(!page.contains("RefineCampaign"), "{page}");
    }
}
