//! The web pages, on the same port as gRPC. They show campaigns as they run, and have the forms in which people teach campaigns.
//!
//! `maud` makes the markup; style sheets and scripts are part of the binary, and need no build step. A page loads nothing from
//! another site. Without scripts, people can read campaigns and control them, but not label. The handlers pass every request on
//! to the services, which check the request and decide about it.

mod answers;
mod archived;
mod asked;
mod assets;
mod atlas;
mod behind_proxy;
mod by_example;
mod classes;
mod delete;
mod downloads;
mod found;
mod glossary;
mod guard;
mod history;
mod keys;
mod label;
mod layout;
mod learning;
mod list;
mod live;
mod login;
mod machines;
mod map;
mod motion;
mod new;
mod notes;
mod of_campaign;
mod page_error;
mod pages;
mod parts;
mod play;
mod progress;
mod robot_editor;
#[cfg(test)]
mod samples;
mod side_by_side;
mod stages;
mod studies;
mod taxonomy;
mod teach;
mod visitor;

pub use atlas::DrawnAtlas;
use axum::{
    http::{HeaderMap, HeaderValue, header::CONTENT_TYPE},
    middleware,
    response::{IntoResponse as _, Response},
};
use murmuration_access::{
    CostClass::{Bulk, Computing, Decision, Light, Reading, Streaming},
    Endpoint, GuardedRouter, Refusal, RequestHead,
    Requirement::{self, Nothing},
    Seats, requests,
};
use murmuration_engine::campaign::ListedCampaign;
use murmuration_engine::{campaign::Campaigns, maps::Maps};
use murmuration_model::CampaignId;
use murmuration_service::{CampaignApi, LabelApi, Recent, blame_the_client};
use murmuration_store::Store;
use page_error::PageError;
pub use play::Playground;
use std::{collections::HashMap, sync::Arc};
pub use studies::Studies;
pub use taxonomy::{FurtherStarts, Measurements, Reports};
use tonic::{Status, service::Routes};

const VIEWER: Requirement = Requirement::VIEWER;
const ANNOTATOR: Requirement = Requirement::ANNOTATOR;
const OPERATOR: Requirement = Requirement::OPERATOR;

/// The parts of a coordinator that the pages use.
#[derive(Debug, Clone)]
pub struct Web {
    pub campaigns: Campaigns,
    pub store: Store,
    /// Positions of behaviours in two dimensions.
    pub maps: Maps,
    pub archive: CampaignApi,
    pub labels: LabelApi,
    /// Simulator of swarms for the page Play.
    pub play: Playground,
    pub studies: Studies,
    pub reports: Reports,
    /// Latest message of each event stream.
    pub sights: Recent<String>,
    /// The list of campaigns that searches share.
    pub heads: Recent<Arc<Vec<ListedCampaign>>>,
    /// Values of the scalars by which lists are sorted, by the scalar's name.
    pub scalars: Recent<Arc<HashMap<CampaignId, f64>>>,
    pub atlas: DrawnAtlas,
    /// Measurements of taxonomies.
    pub measured: Measurements,
    /// Further starts of medoids.
    pub starts: FurtherStarts,
}

/// The pages, the probes and the gRPC services, for one port.
pub fn routes(services: GuardedRouter, web: Web, probes: GuardedRouter) -> GuardedRouter {
    let pages = pages().with_state(web).merge(probes);
    pages
        .wrapped(guard::limited)
        .merge(services.wrapped(blame_the_client))
}

/// Serves the routes at an endpoint.
pub fn behind(routes: GuardedRouter, endpoint: Arc<Endpoint>, seats: Seats) -> Routes {
    let public = endpoint.public.clone();
    let pages = routes
        .behind(endpoint.clone(), seats, nowhere)
        .layer(middleware::from_fn_with_state(endpoint, guard::protect))
        .layer(middleware::from_fn(requests::named));
    match public {
        Some(public) => behind_proxy::under(pages, public).into(),
        None => pages.into(),
    }
}

/// Renders a refusal, as a page or a line of text.
pub fn show_refusal(refusal: Refusal, request: &RequestHead) -> Response {
    login::show_refusal(refusal, request)
}

/// The routes of all pages and assets, and of the requests of scripts.
fn pages() -> GuardedRouter<Web> {
    GuardedRouter::default()
        .get("/", VIEWER, Reading, list::page)
        .get("/new", VIEWER, Light, new::page)
        .post("/new", OPERATOR, Decision, new::submitted)
        .get("/compare", VIEWER, Computing, side_by_side::page)
        .get("/glossary", VIEWER, Light, glossary::page)
        .get("/login", Nothing, Light, login::page)
        .post("/login", Nothing, Light, login::log_in)
        .get("/open", Nothing, Light, login::open)
        .post("/logout", Nothing, Light, login::log_out)
        .get("/events", VIEWER, Streaming, live::campaigns)
        .get("/play", VIEWER, Reading, play::page)
        // These, except `/play/search`, change nothing on disk. They are POSTs because a POST must come from our own pages.
        .post("/play/motion", VIEWER, Computing, play::motion)
        .post("/play/around", VIEWER, Computing, play::around)
        .post("/play/robot", VIEWER, Light, robot_editor::described)
        .post("/play/like", VIEWER, Computing, play::like)
        .post("/play/search", OPERATOR, Decision, play::search)
        .get("/studies", VIEWER, Reading, studies::list)
        .get("/studies/{name}", VIEWER, Reading, studies::page)
        .get("/studies/{name}/events", VIEWER, Streaming, studies::events)
        .get("/studies/{name}/tables", VIEWER, Reading, studies::current_tables)
        .get("/studies/{name}/report", VIEWER, Computing, studies::export)
        .get(
            "/studies/{name}/medoids/{cell}",
            VIEWER,
            Reading,
            studies::medoids::of_cell,
        )
        .post(
            "/studies/{name}/classes",
            ANNOTATOR,
            Decision,
            studies::medoids::judge,
        )
        .get("/campaigns/{id}", VIEWER, Computing, pages::campaign)
        .get("/campaigns/{id}/cards", VIEWER, Computing, pages::cards)
        .get("/campaigns/{id}/events", VIEWER, Streaming, live::campaign)
        .get(
            "/campaigns/{id}/generations",
            VIEWER,
            Reading,
            progress::generations,
        )
        .get("/campaigns/{id}/epochs", VIEWER, Reading, progress::epochs)
        .get("/campaigns/{id}/shown", VIEWER, Reading, progress::shown)
        .get("/campaigns/{id}/robot", VIEWER, Light, pages::robot)
        .get("/campaigns/{id}/behaviour", VIEWER, Light, list::behaviour)
        .get("/campaigns/{id}/individuals/{index}", VIEWER, Light, pages::image)
        .post("/campaigns/{id}/pause", OPERATOR, Decision, pages::pause)
        .post("/campaigns/{id}/resume", OPERATOR, Decision, pages::resume)
        .post("/campaigns/{id}/cancel", OPERATOR, Decision, pages::cancel)
        .post("/campaigns/{id}/refine", OPERATOR, Decision, learning::begin)
        .post("/campaigns/{id}/extend", OPERATOR, Decision, pages::extend)
        .post("/campaigns/{id}/notes", ANNOTATOR, Decision, notes::change)
        .get("/campaigns/{id}/delete", OPERATOR, Light, delete::page)
        .post("/campaigns/{id}/delete", OPERATOR, Decision, delete::delete)
        .get("/campaigns/{id}/label", VIEWER, Light, label::one)
        .get("/campaigns/{id}/sheet", VIEWER, Light, label::sheet)
        .get("/campaigns/{id}/map", VIEWER, Light, map::page)
        .get("/campaigns/{id}/taxonomy", VIEWER, Computing, taxonomy::page)
        .get(
            "/campaigns/{id}/taxonomy/changes",
            VIEWER,
            Computing,
            taxonomy::changes::page,
        )
        .get(
            "/campaigns/{id}/taxonomy/map.png",
            VIEWER,
            Computing,
            taxonomy::map::picture,
        )
        .get("/campaigns/{id}/atlas", VIEWER, Computing, atlas::page)
        .get("/campaigns/{id}/atlas/data", VIEWER, Computing, atlas::data)
        .get("/campaigns/{id}/atlas/map.png", VIEWER, Computing, atlas::picture)
        // `pieces` is a POST that changes nothing on disk, like `/play/motion`.
        .post("/campaigns/{id}/pieces", VIEWER, Computing, play::pieces)
        .get("/campaigns/{id}/report", VIEWER, Computing, taxonomy::export)
        .get(
            "/campaigns/{id}/contact-sheet.svg",
            VIEWER,
            Computing,
            taxonomy::contact_sheet,
        )
        .get(
            "/campaigns/{id}/figure.svg",
            VIEWER,
            Computing,
            taxonomy::figure::svg,
        )
        .get(
            "/campaigns/{id}/figure.pdf",
            VIEWER,
            Computing,
            taxonomy::figure::pdf,
        )
        .get("/campaigns/{id}/changes", VIEWER, Streaming, live::changes)
        .get(
            "/campaigns/{id}/individuals/{index}/motion",
            VIEWER,
            Computing,
            motion::motion,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/motion.gif",
            VIEWER,
            Computing,
            motion::gif,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/paths.png",
            VIEWER,
            Computing,
            motion::paths,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/paths.svg",
            VIEWER,
            Computing,
            motion::svg,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/starts",
            VIEWER,
            Computing,
            taxonomy::starts::page,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/starts/{place}",
            VIEWER,
            Computing,
            taxonomy::starts::picture,
        )
        .post(
            "/campaigns/{id}/individuals/{index}/search",
            OPERATOR,
            Computing,
            by_example::search,
        )
        .get("/campaigns/{id}/labels", VIEWER, Reading, teach::labels)
        .post("/campaigns/{id}/labels", ANNOTATOR, Decision, teach::answer)
        .post("/campaigns/{id}/questions", ANNOTATOR, Computing, teach::ask)
        .post("/campaigns/{id}/undo", ANNOTATOR, Bulk, teach::undo)
        .get("/campaigns/{id}/answers", VIEWER, Reading, answers::page)
        .get(
            "/campaigns/{id}/answers/standing",
            VIEWER,
            Reading,
            answers::standing,
        )
        .post("/campaigns/{id}/withdraw", ANNOTATOR, Bulk, answers::withdraw)
        .get("/campaigns/{id}/classes", VIEWER, Reading, classes::page)
        .get(
            "/campaigns/{id}/classes/details",
            VIEWER,
            Reading,
            classes::details,
        )
        .post("/campaigns/{id}/classes", ANNOTATOR, Decision, classes::change)
        .get("/campaigns/{id}/labels.csv", VIEWER, Reading, downloads::labels)
        .get("/campaigns/{id}/archive.csv", VIEWER, Reading, downloads::archive)
        .get("/campaigns/{id}/points", VIEWER, Reading, map::points)
        .get("/campaigns/{id}/points/axes", VIEWER, Computing, map::axes)
        .get(
            "/campaigns/{id}/points/neighbours",
            VIEWER,
            Computing,
            map::neighbours,
        )
        .get("/assets/{name}", Nothing, Light, assets::asset)
}

/// Answers a request for an address that is neither a page nor a service.
async fn nowhere(headers: HeaderMap) -> Response {
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    match kind.is_some_and(|kind| kind.starts_with(b"application/grpc")) {
        true => Status::unimplemented("this coordinator has no such service").into_http(),
        false => PageError::NoPage.into_response(),
    }
}
