//! The pages of studies: the states of the grid's campaigns, and the current tables and plots of the report.
//!
//! The pages only read the records that `murmuration lab study run` stores in the data directory.

mod known;
mod loaded;
pub(super) mod medoids;
mod sight;

use super::{
    Web,
    layout::{STUDIES, layout, layout_with},
    live::{Events, follow},
    page_error::PageError,
    visitor::Visitor,
};
use axum::{
    extract::{Path, State},
    http::header::{CONTENT_DISPOSITION, CONTENT_TYPE},
    response::IntoResponse,
};
pub use loaded::Studies;
use loaded::{Loaded, Unusable};
use maud::{Markup, PreEscaped, html};
use murmuration_service::IntoStatus as _;
use murmuration_swarm::{counted, grouped};
use sight::Sight;
use tonic::Status;

/// A small study, for people who have none yet.
const EXAMPLE: &str = include_str!("../../../../studies/small.toml");

pub(super) async fn list(State(web): State<Web>, visitor: Visitor) -> Result<Markup, PageError> {
    let names = web.studies.names().await?;
    let known = web.studies.known(&web.campaigns).await?;
    let mut listed = Vec::new();
    for name in names {
        let jobs = web.studies.jobs(&name).await;
        listed.push((name, jobs.map(|jobs| Sight::of(&jobs, &known))));
    }
    Ok(layout(
        STUDIES,
        &visitor,
        html! {
            h1 { "Studies" }
            p.lead { "A study is a grid of campaigns, each in several replicates, with one report." }
            @if listed.is_empty() {
                p { "There are no studies in this data directory yet. To begin one that takes seconds, save this file as " code { "small.toml" } ":" }
                pre tabindex="0" { code { (EXAMPLE) } }
                p { "Then run it on the coordinator's machine, where " code { "DIR" } " is the coordinator's data directory:" }
                pre tabindex="0" { code { "murmuration lab study run small.toml --data DIR" } }
            } @else {
                ul.campaigns {
                    @for (name, sight) in &listed {
                        li {
                            a href={ "/studies/" (name) } { (name) } " "
                            @match sight {
                                Ok(sight) => {
                                    span.about { (counted(sight.cells() as u64, "cell")) }
                                    (sight.progress())
                                },
                                Err(error) => span.error { (error) },
                            }
                        }
                    }
                }
            }
        },
    ))
}

/// The page of a study: its cells, its tables and its plots.
pub(super) async fn page(
    State(web): State<Web>,
    Path(name): Path<String>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let loaded = web.studies.loaded(&name).await?;
    let study = loaded.outcome.study();
    let name = study.name.as_str();
    Ok(layout_with(
        &format!("Study {name}"),
        &visitor,
        &["study.js"],
        html! {
            p.eyebrow { "Study" }
            div.wide-bar {
                h1 { (name) }
                @if loaded.jobs.measured() > 0 { a.button href={ "/studies/" (name) "/report" } { "Export the report" } }
            }
            p.lead {
                (counted(study.rows().len() as u64, "row")) ", " (counted(study.seeds.len() as u64, "replicate")) " each: "
                (counted(study.cells.len() as u64, "campaign")) ". "
            }
            noscript { p.scriptless { "Without JavaScript this page does not update. Reload it to see the current state." } }
            section aria-label="Cells" data-live={ "/studies/" (name) "/events" } { (sight(&web, &loaded).await?.markup(&loaded)) }
            div #tables.study data-tables={ "/studies/" (name) "/tables" } { (tables(&loaded)) }
            (medoids::section(&loaded))
        },
    ))
}

/// Sends the states of a study's cells whenever they change.
pub(super) async fn events(State(web): State<Web>, Path(name): Path<String>) -> Result<Events, PageError> {
    web.studies.loaded(&name).await?;
    let sights = web.sights.follow(format!("study {name}"));
    let look = move || {
        let (web, name) = (web.clone(), name.clone());
        async move {
            let loaded = web.studies.loaded(&name).await?;
            let sight = sight(&web, &loaded).await?;
            Ok::<_, PageError>(sight.markup(&loaded).into_string())
        }
    };
    Ok(follow(sights, look))
}

/// The current tables and plots of a study, for the script of its page.
pub(super) async fn current_tables(
    State(web): State<Web>,
    Path(name): Path<String>,
) -> Result<Markup, PageError> {
    Ok(tables(&*web.studies.loaded(&name).await?))
}

pub(super) async fn export(
    State(web): State<Web>,
    Path(name): Path<String>,
) -> Result<impl IntoResponse, PageError> {
    let loaded = web.studies.loaded(&name).await?;
    let name = loaded.outcome.study().name.as_str().to_owned();
    let page = loaded.report().await;
    let page = page.map_err(|error| Status::internal(error.to_string()))?;
    let headers = [
        (CONTENT_TYPE, "text/html; charset=utf-8".to_owned()),
        (
            CONTENT_DISPOSITION,
            format!("attachment; filename=\"{name}.html\""),
        ),
    ];
    Ok((headers, page))
}

async fn sight(web: &Web, loaded: &Loaded) -> Result<Sight, PageError> {
    let known = web.studies.known(&web.campaigns).await?;
    Ok(Sight::of(&loaded.jobs, &known))
}

fn tables(loaded: &Loaded) -> Markup {
    html! {
        @if let Some(problem) = &loaded.problem {
            p.error role="alert" { (problem) ". Until this is repaired, the judge's class counts for every individual." }
        }
        @if loaded.jobs.measured() == 0 {
            p.lead { "The tables and plots appear when the first cell is done." }
        } @else {
            @if loaded.jobs.measured() < loaded.outcome.study().cells.len() {
                p.lead { "From the " (grouped(loaded.jobs.measured() as u64)) " cells that are done." }
            }
            (PreEscaped(&loaded.tables))
        }
    }
}

impl From<Unusable> for Status {
    fn from(error: Unusable) -> Self {
        match error {
            Unusable::Store(error) => error.into_status(),
            Unusable::Answer(invalid) => invalid.into(),
            Unusable::Damaged(_) => Self::data_loss(error.to_string()),
            Unusable::Broken(_) => Self::internal(error.to_string()),
        }
    }
}

impl From<Unusable> for PageError {
    fn from(error: Unusable) -> Self {
        Self::Service(error.into())
    }
}
