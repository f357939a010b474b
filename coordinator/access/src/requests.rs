//! The id of a gRPC or page request. It is taken from the request's header or made here, and is in every log line about the
//! request and in the response.

use axum::{
    extract::Request,
    http::{HeaderMap, HeaderValue},
    middleware::Next,
    response::Response,
};
use murmuration_link::{TRACE_PARENT, follow};
use murmuration_proto::REQUEST_ID;
use std::{
    sync::{
        LazyLock,
        atomic::{AtomicU64, Ordering},
    },
    time::{Instant, SystemTime, UNIX_EPOCH},
};
use tracing::Instrument as _;

/// Maximum number of bytes of an id that a client gives.
const MAX_BYTES: usize = 64;

/// Gives a request its id, in the log and in the response.
pub async fn named(request: Request, next: Next) -> Response {
    let id = given(request.headers()).unwrap_or_else(made);
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let span = tracing::info_span!("request", id = id.to_str().unwrap_or_default());
    let parent = request.headers().get(TRACE_PARENT);
    if let Some(parent) = parent.and_then(|parent| parent.to_str().ok()) {
        follow(&span, parent);
    }
    async {
        let begun = Instant::now();
        let mut response = next.run(request).await;
        let (status, took) = (response.status().as_u16(), begun.elapsed());
        tracing::debug!(%method, path, status, ?took, "answered");
        response.headers_mut().insert(REQUEST_ID, id);
        response
    }
    .instrument(span)
    .await
}

/// The id in the header of the request, if it can be logged as it is.
fn given(headers: &HeaderMap) -> Option<HeaderValue> {
    let plain = |&byte: &u8| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte);
    let id = headers.get(REQUEST_ID)?;
    let bytes = id.as_bytes();
    ((1..=MAX_BYTES).contains(&bytes.len()) && bytes.iter().all(plain)).then(|| id.clone())
}

/// An id that no other request of this process or an earlier process has: the start of the process and a number.
fn made() -> HeaderValue {
    static START: LazyLock<u64> = LazyLock::new(|| {
        let age = SystemTime::now().duration_since(UNIX_EPOCH);
        age.map_or(0, |age| age.as_micros() as u64)
    });
    static NEXT: AtomicU64 = AtomicU64::new(1);
    let id = format!("{:x}-{}", *START, NEXT.fetch_add(1, Ordering::Relaxed));
    HeaderValue::try_from(id).unwrap_or(HeaderValue::from_static("unnamed"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given_as(id: &str) -> Option<HeaderValue> {
        given(&HeaderMap::from_iter([(
            REQUEST_ID.parse().unwrap(),
            id.parse().unwrap(),
        )]))
    }

    #[test]
    fn an_id_is_taken_if_it_can_be_logged_as_it_is() {
        let longest = "x".repeat(MAX_BYTES);
        for id in ["7", "b7e1-42", "A.b_c-1", longest.as_str()] {
            assert_eq!(given_as(id).unwrap(), id);
        }
        let too_long = "x".repeat(MAX_BYTES + 1);
        for id in ["", "two words", "\"quoted\"", "a=b", too_long.as_str()] {
            assert_eq!(given_as(id), None, "{id:?}");
        }
        assert_eq!(given(&HeaderMap::new()), None);
    }

    #[test]
    fn no_two_are_made_alike() {
        assert_ne!(made(), made());
    }
}
