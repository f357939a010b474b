//! The web pages, on the port that gRPC is served on: campaigns as they run, and what people teach them.
//!
//! Pages are made here with `maud` and need no build step; style sheets and scripts are part of the binary. Nothing is
//! loaded from anywhere else. Without scripts campaigns can be read and steered; to label takes scripts. What those ask
//! for is asked of the services in turn: nothing is decided here.

mod actions;
mod archived;
mod assets;
mod examples;
mod guard;
mod label;
mod layout;
mod live;
mod login;
mod map;
mod motion;
mod page_error;
mod pages;
mod parts;
mod patience;
mod refused;
mod taxonomy;
mod teach;
mod visitor;

use axum::{
    Extension, Router,
    extract::DefaultBodyLimit,
    http::{HeaderMap, HeaderValue, Uri, header::CONTENT_TYPE},
    middleware,
    response::{IntoResponse as _, Response},
    routing::{get, post},
};
use murmuration_access::{Door, Refusal, admit, limits::MAX_POST, requests};
use murmuration_engine::{campaign::Campaigns, maps::Maps};
use murmuration_service::{CampaignApi, LabelApi, blame_the_client};
use murmuration_store::Store;
use page_error::PageError;
use std::sync::Arc;
use tonic::{Status, service::Routes};

/// What the pages show, and who does what they ask for.
#[derive(Debug, Clone)]
pub struct Web {
    /// The campaigns at work.
    pub campaigns: Campaigns,
    /// What is on disk.
    pub store: Store,
    /// Where behaviours lie in two dimensions.
    pub maps: Maps,
    /// What gRPC's clients ask of archives.
    pub archive: CampaignApi,
    /// What they ask of labels.
    pub labels: LabelApi,
}

/// The pages and what machines ask for beside the gRPC services, on one port, for whom its door lets in.
pub fn beside(services: Routes, web: Web, probes: Router, door: Arc<Door>) -> Routes {
    let pages = pages(web).layer(Extension(door.clone()));
    let pages = pages.merge(probes).layer(middleware::from_fn(patience::limited));
    let services = services
        .into_axum_router()
        .layer(middleware::from_fn(blame_the_client));
    let all = pages.merge(services);
    all.fallback(nowhere)
        .layer(middleware::from_fn_with_state(door.clone(), admit))
        .layer(middleware::from_fn_with_state(door, guard::protect))
        .layer(middleware::from_fn(requests::named))
        .into()
}

/// The answer to who may not come in, where a page was asked for.
pub fn turn_away(refusal: Refusal, uri: &Uri, headers: &HeaderMap) -> Response {
    login::turned_away(refusal, uri, headers)
}

/// Every page, and what they are made of.
fn pages(web: Web) -> Router {
    Router::new()
        .route("/", get(pages::campaigns).post(actions::start))
        .route("/login", get(login::page).post(login::log_in))
        .route("/logout", post(login::log_out))
        .route("/events", get(live::campaigns))
        .route("/campaigns/{id}", get(pages::campaign))
        .route("/campaigns/{id}/events", get(live::campaign))
        .route("/campaigns/{id}/individuals/{index}", get(pages::image))
        .route("/campaigns/{id}/pause", post(actions::pause))
        .route("/campaigns/{id}/resume", post(actions::resume))
        .route("/campaigns/{id}/cancel", post(actions::cancel))
        .route("/campaigns/{id}/refine", post(actions::refine))
        .route("/campaigns/{id}/label", get(label::one))
        .route("/campaigns/{id}/sheet", get(label::sheet))
        .route("/campaigns/{id}/map", get(map::page))
        .route("/campaigns/{id}/taxonomy", get(taxonomy::page))
        .route("/campaigns/{id}/report", get(taxonomy::export))
        .route("/campaigns/{id}/changes", get(live::changes))
        .route("/campaigns/{id}/individuals/{index}/motion", get(motion::motion))
        .route("/campaigns/{id}/labels", get(teach::labels).post(teach::answer))
        .route("/campaigns/{id}/questions", post(teach::ask))
        .route("/campaigns/{id}/undo", post(teach::undo))
        .route("/campaigns/{id}/classes", post(teach::create))
        .route("/campaigns/{id}/points", get(map::points))
        .route("/campaigns/{id}/points/axes", get(map::axes))
        .route("/campaigns/{id}/points/neighbours", get(map::neighbours))
        .route("/assets/{name}", get(assets::asset))
        .layer(DefaultBodyLimit::max(MAX_POST))
        .with_state(web)
}

/// Neither a page nor a service.
async fn nowhere(headers: HeaderMap) -> Response {
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    match kind.is_some_and(|kind| kind.starts_with(b"application/grpc")) {
        true => Status::unimplemented("this coordinator has no such service").into_http(),
        false => PageError::NoPage.into_response(),
    }
}
