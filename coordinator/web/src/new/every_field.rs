//! Every field of a campaign file with its explanation. The explanations come from the comments of the Protobuf messages; for the
//! fields of trainings, they come from a page of the documentation.

use super::{
    super::glossary::inline,
    fields::{explanation, path},
};
use maud::{Markup, html};
use murmuration_study::wide;
use murmuration_swarm::spec_sections;

const CAMPAIGNS: &str = include_str!("../../../../docs/campaigns.md");
/// The heading of the fields of trainings on that page of the documentation.
const TRAINING: &str = "\n## Training\n";

/// The list of all fields, folded at first.
pub(super) fn list() -> Markup {
    html! {
        details.every-field {
            summary { "Every field of a campaign file" }
            p.reason { "A field that is left out has its default. " code { "murmuration show" } " prints all fields with the values that a campaign has." }
            @for section in spec_sections::sections() {
                @let expected: Vec<_> = section.fields.iter().filter_map(|field| Some((field.name, explanation(section.path, field.name)?))).collect();
                @if !expected.is_empty() {
                    h3 { @if section.path.is_empty() { "At the top of the file" } @else { code { "[" (section.path) "]" } } }
                    dl { @for (field, expected) in expected { div { dt { code { (path(section.path, field)) } } dd { (expected) } } } }
                }
            }
            h3 { code { "[training]" } " and " code { "[feedback.recipe]" } }
            @for block in training().split("\n\n") { (shown(block.trim())) }
        }
    }
}

/// The documentation of the fields of trainings.
fn training() -> &'static str {
    let after = CAMPAIGNS.split_once(TRAINING).map_or("", |(_, after)| after);
    after.split_once("\n## ").map_or(after, |(section, _)| section)
}

fn shown(block: &str) -> Markup {
    let mut rows = block.lines().filter_map(cells);
    let (Some(head), Some(_)) = (rows.next(), rows.next()) else {
        return html! { p { (inline(block)) } };
    };
    let name = format!(
        "Table: {}",
        head.first().copied().unwrap_or_default().replace('`', "")
    );
    wide(
        &name,
        &html! { table {
            thead { tr { @for title in head { th scope="col" { (inline(title)) } } } }
            tbody {
                @for row in rows {
                    tr { @for (place, cell) in row.iter().enumerate() {
                        @if place == 0 { th scope="row" { (inline(cell)) } } @else { td { (inline(cell)) } }
                    } }
                }
            }
        } },
    )
}

/// The cells of a row of a table; `None` if the line is not a row.
fn cells(line: &str) -> Option<Vec<&str>> {
    let inner = line.trim().strip_prefix('|')?.strip_suffix('|')?;
    Some(inner.split('|').map(str::trim).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_of_a_campaign_file_is_listed() {
        let page = list().into_string();
        for spec_sections::Section {
            path: section,
            fields,
        } in spec_sections::sections()
        {
            for field in fields.iter().map(|field| field.name) {
                let is_listed = match explanation(section, field) {
                    Some(_) => page.contains(&format!("<dt><code>{}</code></dt>", path(section, field))),
                    // A cell of the documentation names several fields; a field of a network has the prefix `network.` there.
                    None => ["", "network."]
                        .iter()
                        .any(|of| page.contains(&format!("<code>{of}{field}</code>"))),
                };
                // The field `network` has a table under its own heading.
                assert!(is_listed || field == "network", "{section} {field}");
            }
        }
        assert!(
            page.contains("Controllers per generation, 1 to 100,000"),
            "{page}"
        );
        assert!(
            !page.contains("RefineCampaign") && !page.contains("|--"),
            "{page}"
        );
    }
}
