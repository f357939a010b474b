//! What browsers may do with an answer: what a page of ours may load, who may show it, and who may keep it.

use super::archived;
use axum::{
    extract::{Request, State},
    http::{
        HeaderValue,
        header::{
            CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
        },
    },
    middleware::Next,
    response::Response,
};
use murmuration_access::{Door, is_for_anybody};
use std::sync::Arc;

const POLICY: &str = "default-src 'none'; style-src 'self'; script-src 'self'; img-src 'self'; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// Says it with every answer but those of gRPC. What is behind a log-in is kept by nobody, but for what is
/// [archived](super::archived).
pub(super) async fn protect(State(door): State<Arc<Door>>, request: Request, next: Next) -> Response {
    let is_for_anybody = is_for_anybody(&request);
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    if kind.is_some_and(|kind| kind.starts_with(b"application/grpc")) {
        return response;
    }
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    // With none at all, browsers would not say either that a form comes from a page of ours.
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("same-origin"));
    let says = headers.get(CACHE_CONTROL);
    let may_be_kept = says.is_some_and(|says| is_for_anybody || archived::is_kept(says));
    if door.access.tokens.is_some() && !may_be_kept {
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    }
    response
}
