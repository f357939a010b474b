//! The map of a campaign's behaviours: the page, and the points that its script asks for.

use super::{
    Web,
    layout::{Part, campaign_page},
    page_error::PageError,
    parts,
    refused::Refused,
    visitor::Visitor,
};
use axum::{
    Json,
    extract::{Path, State},
    http::StatusCode,
    response::{IntoResponse, Response},
};
use maud::{Markup, html};
use murmuration_engine::blocking::blocking;
use murmuration_model::colours;
use murmuration_report::picture::columns::{column, span, spread};
use murmuration_search::medoids::Clustering;
use murmuration_service::OrStatus as _;
use serde_json::{Value, json};

/// The page.
pub(super) async fn page(
    State(web): State<Web>,
    Path(id): Path<String>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let record = web.campaigns.status(&id).await?.record;
    let content = html! {
        div.wide-bar {
            h1 { "Map" }
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
        (parts::who())
        div.columns {
            div.sight.scripted {
                section.plane aria-label="Behaviours" {
                    canvas #points aria-hidden="true" {}
                    canvas #over tabindex="0" role="application" aria-describedby="how"
                        aria-label="Map of the behaviours: arrow keys go from one to the next, Enter plays it, Space selects it" {}
                    div #tip.tip hidden { img alt="" width="100" height="100"; p {} }
                    p.empty hidden { "The map is empty until the first generation is complete." }
                }
                ul #legend.legend aria-label="Colours" {}
                p #distances.reason role="status" {}
                p #how.reason {
                    "Point at a behaviour to see its picture, and click it to play its motion. Draw a line around behaviours "
                    "to select them (Shift adds to the selection, Escape clears it), then press the number of a class."
                }
            }
            section.side aria-label="Selection" {
                (parts::stage("Motion of the behaviour that you clicked"))
                p #chosen.reason.scripted { "Click a behaviour to play its motion." }
                p #selected.reason.scripted { "Draw a line around behaviours to label them." }
                (parts::palette(false))
                (parts::status_line())
                (parts::learn(&record))
            }
        }
    };
    Ok(campaign_page(&record, Part::Map, &visitor, "map.js", content))
}

/// The properties of each point besides its place. While the archive grows, only its first individuals have a cluster.
pub(super) async fn points(State(web): State<Web>, Path(id): Path<String>) -> Result<Json<Value>, Refused> {
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let (individuals, population) = (record.individuals(), record.spec.search().population());
    let starts = record.spec.starts().get();
    let queries = web.labels.queries;
    let clustered = blocking(move || queries.clusters(&record)).await.or_status()?;
    let clustered = clustered.or_status()?;
    let Clustering {
        medoids, clusters, ..
    } = &clustered.clustering;
    Ok(Json(json!({
        "count": individuals,
        "population": population,
        "final": clustered.is_taxonomy,
        "archive_version": clustered.space.archive_version.to_string(),
        "medoids": medoids,
        "starts": starts,
        "robust": column(clustered.robust_trials.iter().map(|&robust| [robust])),
        "cluster": column(clusters.iter().map(|cluster| (*cluster as u16).to_le_bytes())),
        "clusterColours": (0..medoids.len()).map(|place| colours::hex(colours::cluster(place))).collect::<Vec<_>>(),
    })))
}

/// Places on the principal axes.
pub(super) async fn axes(State(web): State<Web>, Path(id): Path<String>) -> Result<Json<Value>, Refused> {
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let maps = web.maps.clone();
    let axes = blocking(move || maps.axes(&record))
        .await
        .or_status()?
        .or_status()?;
    Ok(Json(places(&axes.points)))
}

/// Places by t-SNE; ACCEPTED with an empty body while they are computed.
pub(super) async fn neighbours(State(web): State<Web>, Path(id): Path<String>) -> Result<Response, Refused> {
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let maps = web.maps.clone();
    let found = blocking(move || maps.neighbours(&record))
        .await
        .or_status()?
        .or_status()?;
    Ok(match found {
        Some(points) => Json(places(&points)).into_response(),
        None => StatusCode::ACCEPTED.into_response(),
    })
}

fn places(points: &[[f64; 2]]) -> Value {
    let axis = |axis: usize| points.iter().map(move |point| point[axis]);
    let spans = [span(axis(0)), span(axis(1))];
    json!({ "x": spread(axis(0)), "y": spread(axis(1)), "spans": spans })
}
