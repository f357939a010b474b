//! How long the response to a request may take to begin. The limit is shorter than that of a silent connection, so that a
//! browser receives a page instead of a broken connection.

use super::page_error::PageError;
use axum::{extract::Request, middleware::Next, response::Response};
use murmuration_access::limits::PAGE_LIMIT;

/// Answers a request that takes too long with an error. An event stream begins at once, so the limit does not end it.
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
