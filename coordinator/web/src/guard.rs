//! Response headers that tell browsers what a page may load, which sites may embed it, and whether to keep it.

use super::{archived, page_error::negotiated};
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
use murmuration_access::{Door, Requirement};
use std::sync::Arc;

const POLICY: &str = "default-src 'none'; style-src 'self'; script-src 'self'; img-src 'self'; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// Sets these headers on every response but those of gRPC. Behind a log-in only responses that are
/// [archived](super::archived) may be kept.
pub(super) async fn protect(State(door): State<Arc<Door>>, request: Request, next: Next) -> Response {
    let accepts = request.headers().clone();
    let mut response = negotiated(next.run(request).await, &accepts);
    let is_for_anybody = response.extensions().get() == Some(&Requirement::Nothing);
    let headers = response.headers_mut();
    let kind = headers.get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    if kind.is_some_and(|kind| kind.starts_with(b"application/grpc")) {
        return response;
    }
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    // Without a referrer, browsers would not send the origin of a form either.
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("same-origin"));
    let says = headers.get(CACHE_CONTROL);
    let may_be_kept = says.is_some_and(|says| is_for_anybody || archived::is_kept(says));
    if door.access.tokens.is_some() && !may_be_kept {
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    }
    response
}
