//! The medoids of a study's cells, which people can judge again: each medoid has its picture, its motion and buttons for the
//! classes.

use super::loaded::Loaded;
use crate::{
    Web,
    page_error::{PageError, Refused},
    parts,
    play::SwarmView,
};
use axum::{
    Json,
    extract::{Path, State},
    http::StatusCode,
};
use maud::{Markup, html};
use murmuration_study::{JUDGE, MeasuredCell};
use murmuration_swarm::{Class, Invalid, counted, grouped};
use serde::Deserialize;
use serde_json::json;

/// The part of a study's page with the medoids. When a person opens a cell, the page's script requests the medoids of this cell.
pub(super) fn section(loaded: &Loaded) -> Markup {
    let (study, name) = (loaded.outcome.study(), loaded.outcome.study().name.as_str());
    let judged = || loaded.outcome.cells().filter(|cell| !last(cell).is_empty());
    html! {
        @if judged().next().is_some() {
            section #judging.scripted aria-labelledby="medoids-title" data-classes={ "/studies/" (name) "/classes" } {
                h2 #medoids-title { "The medoids" }
                p.lead {
                    "The last taxonomy of each cell, with the class that each medoid was given. Click a picture to play its motion, and a \
                     class to say what you see: the tables then use your class instead of the judge's, and mark it. The judge tells two more \
                     classes apart than the page Label offers: nested cycle and concave path, which few controllers of the paper's robots show."
                }
                (parts::who())
                (parts::status_line())
                div.beside {
                    div.player {
                        div.stage { canvas role="img" aria-label="Motion of the medoid that you clicked" {} p.waiting { "Click a picture." } }
                        div.transport {
                            button.toggle type="button" aria-label="Play" disabled {}
                            label { span.unseen { "Speed" } (parts::speeds()) }
                            output.step { "–" }
                        }
                    }
                    div {
                        @for cell in judged() {
                            details data-medoids={ "/studies/" (name) "/medoids/" (cell.measured.cell) } {
                                summary { (study.cell_in_words(cell.cell)) " · " (counted(last(&cell).len() as u64, "medoid")) }
                                div {}
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The medoids of the last taxonomy of a cell; empty if they were not judged.
fn last<'a>(cell: &MeasuredCell<'a>) -> &'a [u64] {
    let behaviours = cell.measured.behaviours.as_ref();
    let taxonomy = behaviours.and_then(|behaviours| behaviours.taxonomies.last());
    taxonomy.map_or(&[], |taxonomy| taxonomy.medoids.as_slice())
}

/// The medoids of the cell with this digest.
pub(crate) async fn of_cell(
    State(web): State<Web>,
    Path((name, digest)): Path<(String, String)>,
) -> Result<Markup, PageError> {
    let loaded = web.studies.loaded(&name).await?;
    let cell = loaded.outcome.cell(&digest).ok_or(PageError::NoPage)?;
    let (measured, spec) = (cell.measured, &cell.cell.spec);
    let swarm = json!(SwarmView::of(spec.model(), spec.world()));
    let known = web.studies.known(&web.campaigns).await?;
    Ok(html! {
        @if known.lost(&measured.campaign, loaded.jobs.read) {
            p.reason { "Campaign " (measured.campaign) " was deleted, and with it the pictures and motions of these individuals." }
        }
        ul.rejudged data-campaign=(measured.campaign) data-cell=(measured.cell) data-swarm=(swarm.to_string()) {
            @for &index in last(&cell) {
                @let (class, by) = loaded.outcome.class_of(measured, index);
                li data-index=(index) {
                    button.stage type="button" aria-label={ "Play individual " (grouped(index)) } {
                        img src={ "/campaigns/" (measured.campaign) "/individuals/" (index) } width="120" height="120" loading="lazy"
                            alt={ "Picture of individual " (grouped(index)) };
                    }
                    div {
                        p { "Individual " (grouped(index)) " · " span.by { (by) } }
                        div.given role="group" aria-label={ "Class of individual " (grouped(index)) } {
                            @for known in Class::ALL {
                                button.plain type="button" data-class=(known.name()) aria-pressed=((known == class).to_string()) {
                                    (known.words())
                                }
                            }
                            @if by != JUDGE { button.plain type="button" data-class="" { "The judge's class" } }
                        }
                    }
                }
            }
        }
    })
}

/// A request with a person's class for an individual.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GivenClass {
    /// Digest of the cell.
    cell: String,
    index: u64,
    /// Name of the class; empty for the judge's verdict.
    class: String,
    /// Name of the annotator.
    by: String,
}

/// Stores a person's class for an individual.
pub(crate) async fn judge(
    State(web): State<Web>,
    Path(name): Path<String>,
    Json(posted): Json<GivenClass>,
) -> Result<StatusCode, Refused> {
    let class = match posted.class.as_str() {
        "" => None,
        given => Some(class_of(given)?),
    };
    let kept = web
        .studies
        .judge(&name, posted.cell, posted.index, class, posted.by);
    kept.await?;
    Ok(StatusCode::NO_CONTENT)
}

fn class_of(name: &str) -> Result<Class, Invalid> {
    let class = Class::ALL.into_iter().find(|class| class.name() == name);
    class.ok_or_else(|| {
        let names = Class::ALL.map(Class::name).join(", ");
        Invalid::new("class", format!("{name:?}"), format!("one of {names}"))
    })
}
