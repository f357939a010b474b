//! The web page: campaigns as they run, on the port that gRPC is served on.
//!
//! Pages are made here with `maud` and need no build step; the style sheet and the one script are part of the binary.
//! Without scripts everything works but stands still. Nothing is loaded from anywhere else.

mod actions;
mod guard;
mod live;
mod pages;
mod wrong;

use crate::{campaign::Campaigns, store::Store};
use axum::{
    Router,
    http::{
        HeaderMap, HeaderValue,
        header::{CACHE_CONTROL, CONTENT_TYPE},
    },
    middleware,
    response::{IntoResponse, Response},
    routing::{get, post},
};
use tonic::{Status, service::Routes};
use wrong::Wrong;

/// What the pages show, and who does what they ask for.
#[derive(Debug, Clone)]
pub(crate) struct Web {
    pub(crate) campaigns: Campaigns,
    pub(crate) store: Store,
}

/// The pages beside the gRPC services, on one port.
pub(crate) fn beside(services: Routes, web: Web) -> Routes {
    let both = pages(web).merge(services.into_axum_router());
    both.fallback(nowhere).into()
}

/// Every page, and what they are made of.
fn pages(web: Web) -> Router {
    Router::new()
        .route("/", get(pages::campaigns).post(actions::start))
        .route("/events", get(live::campaigns))
        .route("/campaigns/{id}", get(pages::campaign))
        .route("/campaigns/{id}/events", get(live::campaign))
        .route("/campaigns/{id}/individuals/{index}", get(pages::image))
        .route("/campaigns/{id}/pause", post(actions::pause))
        .route("/campaigns/{id}/resume", post(actions::resume))
        .route("/campaigns/{id}/cancel", post(actions::cancel))
        .route("/style.css", get(|| asset("text/css", include_str!("style.css"))))
        .route(
            "/live.js",
            get(|| asset("text/javascript", include_str!("live.js"))),
        )
        .layer(middleware::from_fn(guard::guard))
        .with_state(web)
}

/// Neither a page nor a service.
async fn nowhere(headers: HeaderMap) -> Response {
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    match kind.is_some_and(|kind| kind.starts_with(b"application/grpc")) {
        true => Status::unimplemented("this coordinator has no such service").into_http(),
        false => Wrong::NoPage.into_response(),
    }
}

async fn asset(kind: &'static str, text: &'static str) -> impl IntoResponse {
    ([(CONTENT_TYPE, kind), (CACHE_CONTROL, "no-cache")], text)
}
