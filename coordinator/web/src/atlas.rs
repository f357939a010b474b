//! The atlas of a campaign that evaluates all controllers of four speeds: its map, with the motion of the chosen controller
//! beside it. The coordinator simulates the motion itself, as it does for the page Play.

mod others;

use super::{
    Web,
    layout::{Part, atlas_of, campaign_page},
    of_campaign::OfCampaign,
    page_error::PageError,
    parts,
    play::SwarmView,
};
use axum::{
    body::Bytes,
    extract::{Path, State},
    http::header::CONTENT_TYPE,
    response::IntoResponse,
};
use maud::{Markup, html};
use murmuration_engine::blocking::in_background;
use murmuration_model::{ArchiveVersion, CampaignRecord};
use murmuration_report::{
    ReportError,
    atlas::{self, Atlas, AtlasEntry, Layout},
};
use murmuration_search::{
    filter::Score,
    interrupt::{Interrupt, Interrupted},
};
use murmuration_store::{ArchivedIndividual, Store, StoreError, kept::LatestAnswers};
use serde_json::json;
use std::sync::Arc;
use tonic::Status;

/// Number of individuals per read of the store.
const CHUNK: u64 = 4096;

/// Maximum size of all cached atlases in bytes; the latest atlas is kept at any size.
const MOST_BYTES: usize = 64 << 20;

/// Cache of the latest atlases, for the requests of their pages. A clone is cheap.
#[derive(Debug, Clone)]
pub struct DrawnAtlas(LatestAnswers<(ArchiveVersion, u64), Arc<Parts>>);

impl Default for DrawnAtlas {
    fn default() -> Self {
        Self(LatestAnswers::within(MOST_BYTES))
    }
}

/// The data and the picture of an atlas's page.
#[derive(Debug)]
struct Parts {
    /// The data, as JSON.
    data: Bytes,
    /// The picture, as PNG.
    picture: Bytes,
}

/// Why an atlas cannot be drawn.
#[derive(Debug, thiserror::Error)]
enum Undrawn {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

pub(super) async fn page(OfCampaign { web, record, visitor }: OfCampaign) -> Result<Markup, PageError> {
    let layout = atlas_of(&record).ok_or(PageError::NoPage)?;
    let others = others::others(&web, &record).await?;
    let (id, spec) = (&record.id, &record.spec);
    let swarm = json!(SwarmView::of(spec.model(), spec.world()));
    let content = html! {
        div.wide-bar {
            h1 { "Atlas" }
            @if let Some(others) = &others { (others.sliders()) }
        }
        @if record.individuals() == 0 {
            p.empty { "The map is empty until the first generation is complete." }
        } @else {
            @if record.individuals() < spec.evaluations() { p.lead { "The campaign goes on: load the page again to see more." } }
            div.columns.atlas data-swarm=(swarm.to_string()) {
                section.plane.scripted aria-label="All controllers" {
                    (atlas::canvas())
                    img #source src={ "/campaigns/" (id) "/atlas/map.png" } alt="" hidden;
                }
                section.side aria-label="The chosen controller" {
                    ul #classes aria-label="Classes: each button shows its controllers alone" {}
                    div.player.scripted {
                        div.stage { canvas role="img" aria-label="Motion of the chosen controller" {} p.waiting { "Choose a controller on the map." } }
                        div.transport {
                            button.toggle type="button" aria-label="Play" disabled {}
                            label { span.unseen { "Speed" } (parts::speeds()) }
                            output.step { "–" }
                        }
                    }
                    (parts::status_line())
                    div #chosen aria-live="polite" { p.reason { "Point at a controller." } }
                }
            }
            p.reason.scripted { (atlas::HOW) " Space plays and pauses the motion." }
            div.lead { (atlas::explained(spec, &layout, record.individuals())) }
        }
    };
    Ok(campaign_page(&record, Part::Atlas, &visitor, content))
}

/// The data of an atlas, which the script of its page draws.
pub(super) async fn data(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<impl IntoResponse, PageError> {
    let parts = parts_of(&web, &id).await?;
    Ok(([(CONTENT_TYPE, "application/json")], parts.data.clone()))
}

/// The picture of an atlas, with one pixel per controller.
pub(super) async fn picture(
    State(web): State<Web>,
    Path(id): Path<String>,
) -> Result<impl IntoResponse, PageError> {
    let parts = parts_of(&web, &id).await?;
    Ok(([(CONTENT_TYPE, "image/png")], parts.picture.clone()))
}

async fn parts_of(web: &Web, id: &str) -> Result<Arc<Parts>, PageError> {
    let record = web.campaigns.status(id).await?.record;
    let layout = atlas_of(&record).ok_or(PageError::NoPage)?;
    let wanted = (record.archive_version(), record.individuals());
    let (store, campaign) = (web.store.clone(), record.id.clone());
    // The two requests of a page, for data and picture, share one drawing of the archive.
    let draw = async {
        let parts = in_background(move |interrupt| Parts::draw(&store, &record, &layout, interrupt)).await?;
        Ok(Arc::new(
            parts.map_err(|error| Status::internal(error.to_string()))?,
        ))
    };
    let bytes = |parts: &Arc<Parts>| parts.data.len() + parts.picture.len();
    web.atlas.0.of(&campaign, wanted, bytes, draw).await
}

impl Parts {
    fn draw(
        store: &Store,
        record: &CampaignRecord,
        layout: &Layout,
        interrupt: &Interrupt,
    ) -> Result<Self, Undrawn> {
        let mut entries = Vec::new();
        let all = record.individuals();
        for first in (0..all).step_by(CHUNK as usize) {
            interrupt.check()?;
            let range = first..(first + CHUNK).min(all);
            let individuals = store.individuals(&record.id, record.spec.model(), range, false)?;
            entries.extend(individuals.into_iter().map(entry));
        }
        let atlas = Atlas {
            campaign: record.id.to_string(),
            digest: String::new(),
            spec: record.spec.clone(),
            entries,
        };
        let (data, picture) = atlas::for_page(&atlas, layout)?;
        Ok(Self {
            data: data.into(),
            picture: picture.into(),
        })
    }
}

fn entry(individual: ArchivedIndividual) -> AtlasEntry {
    AtlasEntry {
        seed: individual.seed,
        verdicts: individual.verdicts().collect(),
        features: individual.features(),
        score: Score::of(&individual.controller).total(),
        controller: individual.controller,
    }
}
