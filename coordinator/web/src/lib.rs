//! The web pages, on the port that gRPC is served on: campaigns as they run, and what people teach them.
//!
//! `maud` makes the markup; style sheets and scripts are part of the binary, and need no build step. A page loads nothing
//! from another site. Without scripts people can read and steer campaigns; labelling needs scripts. The handlers pass every
//! request on to the services, which validate and decide.

mod answers;
mod archived;
mod assets;
mod atlas;
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
mod named;
mod new;
mod of_campaign;
mod page_error;
mod pages;
mod parts;
mod play;
mod progress;
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
    extract::Request,
    http::{HeaderMap, HeaderValue, header::CONTENT_TYPE},
    middleware,
    response::{IntoResponse as _, Response},
};
use murmuration_access::{
    Door, GuardedRouter, Refusal,
    Requirement::{self, Nothing},
    requests,
};
use murmuration_engine::{campaign::Campaigns, maps::Maps};
use murmuration_service::{CampaignApi, LabelApi, blame_the_client};
use murmuration_store::Store;
use page_error::PageError;
pub use play::Playground;
use std::sync::Arc;
pub use studies::Studies;
pub use taxonomy::Judged;
use tonic::{Status, service::Routes};

const VIEWER: Requirement = Requirement::VIEWER;
const ANNOTATOR: Requirement = Requirement::ANNOTATOR;
const OPERATOR: Requirement = Requirement::OPERATOR;

/// The parts of a coordinator that the pages use.
#[derive(Debug, Clone)]
pub struct Web {
    pub campaigns: Campaigns,
    pub store: Store,
    /// Where behaviours lie in two dimensions.
    pub maps: Maps,
    pub archive: CampaignApi,
    pub labels: LabelApi,
    /// Where swarms are simulated for people who play.
    pub play: Playground,
    pub studies: Studies,
    pub atlas: DrawnAtlas,
    /// The judge's latest verdicts on medoids.
    pub judged: Judged,
}

/// The pages and probes beside the gRPC services, on one port.
pub fn routes(services: GuardedRouter, web: Web, probes: GuardedRouter) -> GuardedRouter {
    let pages = pages().with_state(web).merge(probes);
    pages
        .wrapped(guard::limited)
        .merge(services.wrapped(blame_the_client))
}

/// Those routes, served at a door.
pub fn behind(routes: GuardedRouter, door: Arc<Door>) -> Routes {
    routes
        .behind(door.clone(), nowhere)
        .layer(middleware::from_fn_with_state(door, guard::protect))
        .layer(middleware::from_fn(requests::named))
        .into()
}

/// Renders a refusal, as a page or a line of text.
pub fn show_refusal(refusal: Refusal, request: &Request) -> Response {
    login::show_refusal(refusal, request)
}

/// Every page, and every asset and request of their scripts.
fn pages() -> GuardedRouter<Web> {
    GuardedRouter::default()
        .get("/", VIEWER, list::page)
        .get("/new", VIEWER, new::page)
        .post("/new", OPERATOR, new::submitted)
        .get("/compare", VIEWER, side_by_side::page)
        .get("/glossary", VIEWER, glossary::page)
        .get("/login", Nothing, login::page)
        .post("/login", Nothing, login::log_in)
        .post("/logout", Nothing, login::log_out)
        .get("/events", VIEWER, live::campaigns)
        .get("/play", VIEWER, play::page)
        // These two change nothing; what is posted must come from a page of ours.
        .post("/play/motion", VIEWER, play::motion)
        .post("/play/like", VIEWER, play::like)
        .post("/play/search", OPERATOR, play::search)
        .get("/studies", VIEWER, studies::list)
        .get("/studies/{name}", VIEWER, studies::page)
        .get("/studies/{name}/events", VIEWER, studies::events)
        .get("/studies/{name}/tables", VIEWER, studies::current_tables)
        .get("/studies/{name}/report", VIEWER, studies::export)
        .get(
            "/studies/{name}/medoids/{cell}",
            VIEWER,
            studies::medoids::of_cell,
        )
        .post("/studies/{name}/classes", ANNOTATOR, studies::medoids::judge)
        .get("/campaigns/{id}", VIEWER, pages::campaign)
        .get("/campaigns/{id}/events", VIEWER, live::campaign)
        .get("/campaigns/{id}/generations", VIEWER, progress::generations)
        .get("/campaigns/{id}/epochs", VIEWER, progress::epochs)
        .get("/campaigns/{id}/shown", VIEWER, progress::shown)
        .get("/campaigns/{id}/robot", VIEWER, pages::robot)
        .get("/campaigns/{id}/behaviour", VIEWER, list::behaviour)
        .get("/campaigns/{id}/individuals/{index}", VIEWER, pages::image)
        .post("/campaigns/{id}/pause", OPERATOR, pages::pause)
        .post("/campaigns/{id}/resume", OPERATOR, pages::resume)
        .post("/campaigns/{id}/cancel", OPERATOR, pages::cancel)
        .post("/campaigns/{id}/refine", OPERATOR, pages::refine)
        .get("/campaigns/{id}/delete", OPERATOR, delete::page)
        .post("/campaigns/{id}/delete", OPERATOR, delete::delete)
        .get("/campaigns/{id}/label", VIEWER, label::one)
        .get("/campaigns/{id}/sheet", VIEWER, label::sheet)
        .get("/campaigns/{id}/map", VIEWER, map::page)
        .get("/campaigns/{id}/taxonomy", VIEWER, taxonomy::page)
        .get(
            "/campaigns/{id}/taxonomy/changes",
            VIEWER,
            taxonomy::changes::page,
        )
        .get("/campaigns/{id}/taxonomy/map.png", VIEWER, taxonomy::map::picture)
        .get("/campaigns/{id}/atlas", VIEWER, atlas::page)
        .get("/campaigns/{id}/atlas/data", VIEWER, atlas::data)
        .get("/campaigns/{id}/atlas/map.png", VIEWER, atlas::picture)
        // Changes nothing, as the motion of the page Play.
        .post("/campaigns/{id}/pieces", VIEWER, play::pieces)
        .get("/campaigns/{id}/report", VIEWER, taxonomy::export)
        .get(
            "/campaigns/{id}/contact-sheet.svg",
            VIEWER,
            taxonomy::contact_sheet,
        )
        .get("/campaigns/{id}/changes", VIEWER, live::changes)
        .get(
            "/campaigns/{id}/individuals/{index}/motion",
            VIEWER,
            motion::motion,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/motion.gif",
            VIEWER,
            motion::gif,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/paths.svg",
            VIEWER,
            motion::svg,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/starts",
            VIEWER,
            taxonomy::starts::page,
        )
        .get(
            "/campaigns/{id}/individuals/{index}/starts/{place}",
            VIEWER,
            taxonomy::starts::picture,
        )
        .get("/campaigns/{id}/labels", VIEWER, teach::labels)
        .post("/campaigns/{id}/labels", ANNOTATOR, teach::answer)
        .post("/campaigns/{id}/questions", ANNOTATOR, teach::ask)
        .post("/campaigns/{id}/undo", ANNOTATOR, teach::undo)
        .get("/campaigns/{id}/answers", VIEWER, answers::page)
        .get("/campaigns/{id}/answers/standing", VIEWER, answers::standing)
        .post("/campaigns/{id}/withdraw", ANNOTATOR, answers::withdraw)
        .get("/campaigns/{id}/classes", VIEWER, classes::page)
        .get("/campaigns/{id}/classes/details", VIEWER, classes::details)
        .post("/campaigns/{id}/classes", ANNOTATOR, classes::change)
        .get("/campaigns/{id}/labels.csv", VIEWER, downloads::labels)
        .get("/campaigns/{id}/archive.csv", VIEWER, downloads::archive)
        .get("/campaigns/{id}/points", VIEWER, map::points)
        .get("/campaigns/{id}/points/axes", VIEWER, map::axes)
        .get("/campaigns/{id}/points/neighbours", VIEWER, map::neighbours)
        .get("/assets/{name}", Nothing, assets::asset)
}

/// Answers requests for an address that is neither a page nor a service.
async fn nowhere(headers: HeaderMap) -> Response {
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    match kind.is_some_and(|kind| kind.starts_with(b"application/grpc")) {
        true => Status::unimplemented("this coordinator has no such service").into_http(),
        false => PageError::NoPage.into_response(),
    }
}
