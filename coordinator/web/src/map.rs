//! The map of a campaign's behaviours: the page, and the points that its script draws.

use super::{
    Web, by_example, keys,
    layout::{Part, campaign_page},
    learning,
    of_campaign::OfCampaign,
    page_error::{PageError, Refused},
    parts,
    taxonomy::shown_version::on_card,
};
use axum::{
    Json,
    extract::{Path, State},
    http::StatusCode,
    response::{IntoResponse, Response},
};
use maud::{Markup, html};
use murmuration_engine::{
    blocking::in_background,
    taxonomy::{ClusterName, Names, Origin},
};
use murmuration_model::colours;
use murmuration_report::{
    picture::columns::{column, span, spread},
    scripts,
};
use murmuration_search::medoids::Clustering;
use murmuration_service::OrStatus as _;
use serde::Serialize;

/// The keys that people cannot change: the keys of the map while the map has the focus, and the keys of the selection.
const KEYS: [(&str, &str); 8] = [
    keys::CLASSES,
    ("arrows", "on the map: go from one behaviour to the next"),
    ("Enter", "on the map: play the behaviour"),
    (
        "Space",
        "on the map: select the behaviour, or take it out of the selection",
    ),
    ("+ - Home", "on the map: zoom in, zoom out, show the whole map"),
    ("Backspace", "on the map: back to the part shown before"),
    ("Escape", "select nothing"),
    ("Delete", "on a picture of the selection: take it out"),
];

pub(super) async fn page(OfCampaign { web, record, visitor }: OfCampaign) -> Result<Markup, PageError> {
    let content = html! {
        div.wide-bar {
            h1 { "Map" }
            (keys::list(&KEYS, keys::Page::Map))
            div.choices.scripted {
                label { "Layout " select #projection {
                    option value="axes" { "principal axes" }
                    option value="neighbours" disabled { "t-SNE (being computed)" }
                } }
                label { "Colours " select #colouring {
                    option value="class" { "class" }
                    option value="cluster" { "cluster" }
                    option value="generation" { "generation" }
                    option value="robustness" disabled { "robustness" }
                } }
            }
        }
        dialog.introduction aria-label="Your name" { (parts::who()) }
        div.columns {
            div.sight.scripted {
                section.plane aria-label="Behaviours" {
                    canvas #points aria-hidden="true" {}
                    div #pins.pins aria-hidden="true" {}
                    canvas #over tabindex="0" role="application" aria-describedby="how"
                        aria-label="Map of the behaviours: arrow keys go from one to the next, Enter plays it, Space selects it" {}
                    div.zoom role="group" aria-label="Zoom" {
                        button #back type="button" disabled title="Back to the part shown before" { "Back" }
                        button #move type="button" aria-pressed="false" { "Move" }
                        (scripts::zoom_buttons())
                    }
                    div #tip.tip hidden { img alt="" width="100" height="100"; p {} }
                    p.empty hidden {
                        "The map is empty until the first generation is complete. See the "
                        a href={ "/campaigns/" (record.id) } { "progress" } "."
                    }
                }
                ul #legend.legend aria-label="Colours: each button hides and shows its individuals" {}
                div.choices {
                    label { "Generations from " input #from type="number" min="0" step="1" size="6"; }
                    label { "to " input #to type="number" min="0" step="1" size="6"; }
                    label { "Class " select #of-class { option value="" { "all" } } }
                    label { "Cluster " select #of-cluster { option value="" { "all" } } }
                    label { "Answered by " select #answered-by { option value="" { "all, answered or not" } } }
                }
                div.choices.sifted {
                    button #show-all.plain type="button" disabled { "Show all" }
                    span #shown.reason role="status" { "…" }
                }
                @if let Some(sample) = murmuration_report::sample_in_words(&record.spec) { p.reason { (sample) } }
                @if record.spec.sweep_centre().is_some() {
                    p.reason { "The cross is the centre of the sweep: the controllers of the first generation are within a step of it." }
                }
                p #distances.reason role="status" {}
                p #how.reason {
                    "Point at a behaviour to see its picture, and click it to play its motion. Draw a line around behaviours "
                    "to select them (Shift adds to the selection, Escape clears it), then press the number of a class. "
                    "The wheel, two fingers or + and − zoom; Ctrl and a drag, or the button Move, move the map. Rings and pins are the medoids. A "
                    "click on a colour hides its individuals, and with Shift all others."
                }
            }
            section.side aria-label="Selection" {
                (parts::stage("Motion of the behaviour that you clicked", record.spec.world()))
                p #chosen.reason.scripted { "Click a behaviour to play its motion." }
                details #examples.scripted {
                    summary { "Search by example" }
                    div.choices { (by_example::buttons(&record.id, None)) }
                }
                p #selected.reason.scripted { "Draw a line around behaviours to label them." }
                div #gallery.gallery.scripted role="group" aria-label="Pictures of the selection" hidden {}
                p #gallery-line.reason.scripted hidden {}
                (parts::palette(record.spec.world(), false))
                (parts::status_line())
                (learning::button(&web, &record, Part::Map).await?)
                (parts::downloads(&record))
            }
        }
        dialog #overwrite aria-labelledby="overwrite-title" {
            h2 #overwrite-title { "Replace an earlier class?" }
            p {}
            form method="dialog" {
                button.plain value="" { "Cancel" }
                button.plain value="rest" { "Name only the others" }
                button value="all" { "Name all" }
            }
        }
    };
    Ok(campaign_page(&record, Part::Map, &visitor, content))
}

/// Properties of the points, without their places. While the archive grows, only its first individuals have a cluster.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct PointsView {
    /// Number of individuals on the map.
    count: u64,
    population: u32,
    /// Whether the clusters are those of the taxonomy.
    r#final: bool,
    #[serde(rename = "archive_version")]
    archive_version: String,
    /// Indices of the medoids.
    medoids: Vec<usize>,
    /// The individual around which the first generation is a sweep.
    centre: Option<u64>,
    /// Number of trials of each individual.
    starts: usize,
    /// Columns with a value for each individual: the number of trials that show its own behaviour, and its cluster.
    robust: String,
    cluster: String,
    /// Names with their origin, and names as cards show them.
    cluster_names: Vec<Option<String>>,
    cluster_labels: Vec<Option<String>>,
    cluster_colours: Vec<String>,
}

pub(super) async fn points(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<Json<PointsView>, Refused> {
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let (individuals, population) = (record.sampled(), record.spec.search().population());
    let starts = record.spec.starts().get();
    let centre = record.spec.sweep_centre().map(|_| 0);
    let (queries, store, id) = (web.labels.queries, web.store, record.id.clone());
    let clustered = in_background(move |_| queries.clusters(&record))
        .await
        .or_status()?;
    let clustered = clustered.or_status()?;
    let names = match clustered.is_taxonomy {
        true => store
            .run(move |store| Names::standing(store, &id))
            .await
            .or_status()?,
        false => Names::default(),
    };
    let Clustering {
        medoids, clusters, ..
    } = &clustered.clustering;
    Ok(Json(PointsView {
        count: individuals,
        population,
        r#final: clustered.is_taxonomy,
        archive_version: clustered.space.archive_version.to_string(),
        medoids: medoids.clone(),
        centre,
        starts,
        robust: column(clustered.robust_trials.iter().map(|&robust| [robust])),
        cluster: column(clusters.iter().map(|cluster| (*cluster as u16).to_le_bytes())),
        cluster_names: names
            .names
            .iter()
            .map(|name| name.as_ref().map(in_words))
            .collect(),
        cluster_labels: names
            .names
            .iter()
            .map(|name| Some(on_card(name.as_ref()?).shown()))
            .collect(),
        cluster_colours: (0..medoids.len())
            .map(|place| colours::hex(colours::cluster(place)))
            .collect(),
    }))
}

/// The name of a cluster, followed by the origin of the name if no person gave the name to the medoid.
fn in_words(name: &ClusterName) -> String {
    let shown = name.class.shown();
    match name.origin {
        Origin::Person => shown,
        Origin::Judge => format!("{shown} (by the rule-based judge)"),
        Origin::Carried { version, .. } => format!("{shown} (carried over from version {version})"),
    }
}

/// The places of the points on the principal axes.
pub(super) async fn axes(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<Json<PlacesView>, Refused> {
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let maps = web.maps.clone();
    let axes = in_background(move |_| maps.axes(&record))
        .await
        .or_status()?
        .or_status()?;
    Ok(Json(places(&axes.points)))
}

/// The places of the points by t-SNE. While these are computed, the response is `ACCEPTED` with an empty body.
pub(super) async fn neighbours(State(web): State<Web>, Path(id): Path<String>) -> Result<Response, Refused> {
    if let Ok(id) = id.parse() {
        web.maps.somebody_asks(&id);
    }
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let found = web.maps.neighbours(&record).await.or_status()?;
    Ok(match found {
        Some(points) => Json(places(&points)).into_response(),
        None => StatusCode::ACCEPTED.into_response(),
    })
}

/// The places of points, as columns that are scaled to the spans of the axes.
#[derive(Debug, Serialize)]
pub(super) struct PlacesView {
    x: String,
    y: String,
    spans: [f64; 2],
}

fn places(points: &[[f64; 2]]) -> PlacesView {
    let axis = |axis: usize| points.iter().map(move |point| point[axis]);
    let spans = [span(axis(0)), span(axis(1))];
    PlacesView {
        x: spread(axis(0)),
        y: spread(axis(1)),
        spans,
    }
}
