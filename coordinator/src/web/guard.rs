//! What keeps other sites' pages from using this one: the host asked for, the page that asks, and what a page may load.

use super::wrong::Wrong;
use axum::{
    extract::Request,
    http::{
        HeaderMap, HeaderValue, Method,
        header::{CONTENT_SECURITY_POLICY, HOST, ORIGIN, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS},
        uri::Authority,
    },
    middleware::Next,
    response::{IntoResponse as _, Response},
};
use std::net::IpAddr;

const POLICY: &str = "default-src 'none'; style-src 'self'; script-src 'self'; img-src 'self'; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// Turns away what does not come from a page of ours, and says what our pages may load.
pub(super) async fn guard(request: Request, next: Next) -> Response {
    let mut response = match check(request.method(), request.headers(), request.uri().authority()) {
        Ok(()) => next.run(request).await,
        Err(wrong) => wrong.into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    // With none at all, browsers would not say either that a form comes from a page of ours.
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("same-origin"));
    response
}

/// The host must be named by its address, or be this machine: a name of somebody else's may be made to point here. A
/// request that changes something must come from a page of the same host.
fn check(method: &Method, headers: &HeaderMap, authority: Option<&Authority>) -> Result<(), Wrong> {
    let named = headers.get(HOST).and_then(|host| host.to_str().ok());
    let host = named.and_then(|host| host.parse::<Authority>().ok());
    let host = host.or_else(|| authority.cloned());
    let host = host.ok_or(Wrong::Host)?;
    if !is_address(host.host()) {
        return Err(Wrong::Host);
    }
    if [Method::GET, Method::HEAD].contains(method) {
        return Ok(());
    }
    let origin = headers.get(ORIGIN).and_then(|origin| origin.to_str().ok());
    match origin.and_then(|origin| origin.strip_prefix("http://")) {
        Some(origin) if origin == host.as_str() => Ok(()),
        _ => Err(Wrong::Origin),
    }
}

fn is_address(host: &str) -> bool {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    bare == "localhost" || bare.parse::<IpAddr>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed(method: &Method, headers: &[(&'static str, &str)]) -> bool {
        let headers = headers
            .iter()
            .map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()))
            .collect();
        check(method, &headers, None).is_ok()
    }

    #[test]
    fn only_addresses_and_this_machine_are_hosts() {
        for host in ["127.0.0.1:7700", "localhost:7700", "[::1]:7700", "192.168.0.7:80"] {
            assert!(allowed(&Method::GET, &[("host", host)]), "{host}");
        }
        for host in ["evil.example:7700", "localhost.evil.example", ""] {
            assert!(!allowed(&Method::GET, &[("host", host)]), "{host}");
        }
        assert!(!allowed(&Method::GET, &[]));
    }

    #[test]
    fn only_our_own_pages_change_anything() {
        let post = |origin: &str| allowed(&Method::POST, &[("host", "127.0.0.1:7700"), ("origin", origin)]);
        assert!(post("http://127.0.0.1:7700"));
        for origin in [
            "http://evil.example",
            "http://127.0.0.1:8000",
            "null",
            "https://127.0.0.1:7700",
        ] {
            assert!(!post(origin), "{origin}");
        }
        assert!(!allowed(&Method::POST, &[("host", "127.0.0.1:7700")]));
    }
}
