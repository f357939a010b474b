//! Middleware of every page. It sets response headers for browsers: what a page can load, which sites can embed the page, and
//! whether to keep it. It also limits the time until a response begins.

use super::{
    archived,
    page_error::{PageError, negotiated},
};
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
use murmuration_access::{Endpoint, Requirement, limits::PAGE_LIMIT};
use std::sync::Arc;

const POLICY: &str = "default-src 'none'; style-src 'self'; script-src 'self'; img-src 'self'; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// Sets the headers on every response except those of gRPC. Behind a log-in, browsers can keep only [archived](super::archived)
/// responses and responses for anybody.
pub(super) async fn protect(State(endpoint): State<Arc<Endpoint>>, request: Request, next: Next) -> Response {
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
    // With a stricter policy, browsers would also omit the origin of forms.
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("same-origin"));
    let says = headers.get(CACHE_CONTROL);
    let may_be_kept = says.is_some_and(|says| is_for_anybody || archived::is_kept(says));
    if endpoint.access.tokens.is_some() && !may_be_kept {
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    }
    response
}

/// Answers a slow request with an error. An event stream begins at once, so that the limit does not end the stream.
pub(super) async fn limited(request: Request, next: Next) -> Response {
    let headers = request.headers().clone();
    answered_in_time(next.run(request), || PageError::Late.told(&headers)).await
}

async fn answered_in_time(
    answer: impl Future<Output = Response>,
    otherwise: impl FnOnce() -> Response,
) -> Response {
    match tokio::time::timeout(PAGE_LIMIT, answer).await {
        Ok(answer) => answer,
        Err(_) => otherwise(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::{
        body::to_bytes,
        http::{HeaderMap, HeaderValue, StatusCode, header::ACCEPT},
        response::IntoResponse as _,
    };
    use murmuration_access::limits::IDLE_LIMIT;
    use std::future;

    #[tokio::test(start_paused = true)]
    async fn what_takes_too_long_is_told_in_words_before_the_connection_is_closed() {
        for (accepts, begins) in [
            ("text/html,*/*", "<!DOCTYPE html>"),
            ("*/*", "this took longer than"),
        ] {
            let headers = HeaderMap::from_iter([(ACCEPT, HeaderValue::from_static(accepts))]);
            let begun = tokio::time::Instant::now();
            let told = answered_in_time(future::pending(), || PageError::Late.told(&headers)).await;
            assert!(begun.elapsed() < IDLE_LIMIT);
            assert_eq!(told.status(), StatusCode::GATEWAY_TIMEOUT);
            let body = to_bytes(told.into_body(), usize::MAX).await.unwrap();
            let text = String::from_utf8(body.to_vec()).unwrap();
            assert!(
                text.starts_with(begins) && text.contains("murmuration report"),
                "{text}"
            );
        }
        let soon = async { "soon".into_response() };
        let told = answered_in_time(soon, || PageError::Late.into_response()).await;
        assert_eq!(told.status(), StatusCode::OK);
    }
}
