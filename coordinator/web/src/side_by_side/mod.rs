//! The page of campaigns side by side: their curves and taxonomies together, and the differences between their specifications.

mod matching;
mod taxonomies;

use super::{
    Web, asked::Query, layout::layout_with, page_error::PageError, taxonomy::shown_version::ShownVersion,
    visitor::Visitor,
};
use axum::extract::State;
use maud::{Markup, html};
use murmuration_engine::blocking::in_background;
use murmuration_model::CampaignRecord;
use murmuration_study::wide;
use murmuration_swarm::{Invalid, counted};
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};

/// Maximum number of campaigns on the page, which is the number of line colours.
const MOST: usize = 6;

/// A campaign on the page.
struct Compared {
    record: CampaignRecord,
    /// The campaign's taxonomy; `None` if there is no taxonomy yet.
    shown: Option<ShownVersion>,
}

/// The page of the campaigns in the address.
pub(super) async fn page(
    State(web): State<Web>,
    Query(parameters): Query<Vec<(String, String)>>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let named = parameters.into_iter().filter(|(name, _)| name == "campaign");
    let mut seen = BTreeSet::new();
    let ids: Vec<String> = named
        .map(|(_, id)| id)
        .filter(|id| seen.insert(id.clone()))
        .collect();
    if !(2..=MOST).contains(&ids.len()) {
        let allowed = format!("2 to {MOST} campaigns: choose them in the list");
        return Err(Invalid::new("campaign", counted(ids.len() as u64, "campaign"), allowed).into());
    }
    let mut compared: Vec<Compared> = Vec::with_capacity(ids.len());
    for id in ids {
        let record = web.campaigns.status(&id).await?.record;
        // The address can name a campaign twice: as `latest`, and by its id.
        if compared.iter().any(|other| other.record.id == record.id) {
            continue;
        }
        let shown = ShownVersion::current(&web, &record).await?;
        compared.push(Compared { record, shown });
    }
    // The matching of large taxonomies takes long.
    let content = in_background(move |_| shown(&compared)).await?;
    Ok(layout_with("Compare", &visitor, &["sidebyside.js"], content))
}

fn shown(compared: &[Compared]) -> Markup {
    html! {
        h1 { "Campaigns side by side" }
        noscript { p.scriptless { "Without JavaScript this page draws no curves. Taxonomies and specifications are below." } }
        ul.legend.compared {
            @for (place, Compared { record, .. }) in compared.iter().enumerate() {
                li data-campaign=(record.id) {
                    svg.swatch viewBox="0 0 32 8" width="32" height="8" aria-hidden="true" { line class={ "line line-" (place) } x1="0" x2="32" y1="4" y2="4" {} }
                    a href={ "/campaigns/" (record.id) } { (record.id) }
                    span.about { (record.spec.model()) " · " (record.spec.method()) " · " (record.state.name()) }
                }
            }
        }
        (taxonomies::section(compared))
        @for (id, title, note) in NOVELTY { (curves(id, title, note)) }
        @if compared.iter().any(|Compared { record, .. }| record.spec.space().embeds()) {
            @for (id, title, note) in TRAININGS { (curves(id, title, note)) }
        }
        section aria-labelledby="differences" {
            h2 #differences { "Specifications" }
            (differences(&compared.iter().map(|Compared { record, .. }| record).collect::<Vec<_>>()))
        }
    }
}

/// The curves that every campaign has: id, title, and note of each curve.
const NOVELTY: [(&str, &str, &str); 2] = [
    (
        "best",
        "Best novelty",
        "Novelty of different methods is in different units.",
    ),
    ("mean", "Mean novelty", ""),
];
/// The curves that only campaigns with embeddings have.
const TRAININGS: [(&str, &str, &str); 2] = [
    (
        "accuracy",
        "Accuracy of trainings",
        "Share of held-out triplets that are told apart, in percent; the trainings of rounds follow the first.",
    ),
    (
        "loss",
        "Loss of trainings",
        "Losses of different recipes are in different units.",
    ),
];

/// The place of a plot in which a script draws the curves.
fn curves(id: &str, title: &str, note: &str) -> Markup {
    html! {
        section.scripted #(id) aria-label=(title) {
            h2 { (title) }
            @if !note.is_empty() { p.reason { (note) } }
            div.chart {}
            p.reason.none hidden { "None of these campaigns has such a curve." }
        }
    }
}

/// The fields in which the specifications differ.
fn differences(records: &[&CampaignRecord]) -> Markup {
    let fields: Vec<BTreeMap<String, String>> = records
        .iter()
        .map(|record| flat(&record.spec.to_toml()))
        .collect();
    let names: BTreeSet<&String> = fields.iter().flat_map(BTreeMap::keys).collect();
    let differs = |name: &&&String| {
        let mut values = fields.iter().map(|fields| fields.get(**name));
        let first = values.next();
        values.any(|value| Some(value) != first)
    };
    let differing: Vec<&&String> = names.iter().filter(differs).collect();
    html! {
        @if differing.is_empty() {
            p { "Their specifications are the same." }
        } @else {
            p.reason { (differing.len()) " of " (counted(names.len() as u64, "field")) " differ." }
            (wide("Differences", &html! { table {
                thead { tr { th scope="col" { "Field" } @for record in records { th scope="col" { (record.id) } } } }
                tbody {
                    @for name in differing {
                        tr {
                            th scope="row" { code { (name) } }
                            @for fields in &fields { td { (fields.get(*name).map_or("–", String::as_str)) } }
                        }
                    }
                }
            } }))
        }
    }
}

/// The fields of a campaign file, by path.
fn flat(text: &str) -> BTreeMap<String, String> {
    fn add(table: Table, path: &str, fields: &mut BTreeMap<String, String>) {
        for (name, value) in table {
            let path = match path {
                "" => name,
                path => format!("{path}.{name}"),
            };
            match value {
                Value::Table(inner) => add(inner, &path, fields),
                Value::String(text) => drop(fields.insert(path, text)),
                other => drop(fields.insert(path, other.to_string())),
            }
        }
    }
    let mut fields = BTreeMap::new();
    add(text.parse().unwrap_or_default(), "", &mut fields);
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_known_by_their_paths() {
        let fields = flat("seed = 1\n[world.start]\nshape = \"disc\"\n");
        let known: Vec<(&str, &str)> = fields
            .iter()
            .map(|(name, value)| (name.as_str(), value.as_str()))
            .collect();
        assert_eq!(known, [("seed", "1"), ("world.start.shape", "disc")]);
    }
}
