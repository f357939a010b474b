//! What keeps other sites' pages from using this one: the host asked for, the page that asks, and what a page may load.

use super::wrong::Wrong;
use crate::access::Door;
use axum::{
    extract::{Request, State},
    http::{
        HeaderMap, HeaderValue, Method,
        header::{CONTENT_SECURITY_POLICY, HOST, ORIGIN, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS},
        uri::Authority,
    },
    middleware::Next,
    response::{IntoResponse as _, Response},
};
use std::{net::IpAddr, sync::Arc};

const POLICY: &str = "default-src 'none'; style-src 'self'; script-src 'self'; img-src 'self'; connect-src 'self'; \
                      form-action 'self'; base-uri 'none'; frame-ancestors 'none'";

/// How pages are reached.
#[derive(Debug, Clone, Copy)]
struct Reached {
    /// Over TLS: under a name that the certificate vouches for.
    is_encrypted: bool,
    /// By whoever reaches the port, without a token.
    is_open: bool,
}

/// Turns away what does not come from a page of ours, and says what our pages may load.
pub(super) async fn guard(State(door): State<Arc<Door>>, request: Request, next: Next) -> Response {
    let reached = Reached {
        is_encrypted: door.is_encrypted,
        is_open: door.access.tokens.is_none(),
    };
    let authority = request.uri().authority();
    protected(
        match check(reached, request.method(), request.headers(), authority) {
            Ok(()) => next.run(request).await,
            Err(wrong) => wrong.into_response(),
        },
    )
}

/// Says what a page of ours may load, and who may show it.
pub(super) fn protected(mut response: Response) -> Response {
    let headers = response.headers_mut();
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    // With none at all, browsers would not say either that a form comes from a page of ours.
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("same-origin"));
    response
}

/// Where neither a certificate nor a token is asked for, the host must be named by its address, or be this machine: a name
/// of somebody else's may be made to point here. A request that changes something must come from a page of the same host.
fn check(
    reached: Reached,
    method: &Method,
    headers: &HeaderMap,
    authority: Option<&Authority>,
) -> Result<(), Wrong> {
    let named = headers.get(HOST).and_then(|host| host.to_str().ok());
    let host = named.and_then(|host| host.parse::<Authority>().ok());
    let host = host.or_else(|| authority.cloned());
    let host = host.ok_or(Wrong::Host)?;
    if reached.is_open && !reached.is_encrypted && !is_address(host.host()) {
        return Err(Wrong::Host);
    }
    if [Method::GET, Method::HEAD].contains(method) {
        return Ok(());
    }
    let scheme = if reached.is_encrypted {
        "https://"
    } else {
        "http://"
    };
    let origin = headers.get(ORIGIN).and_then(|origin| origin.to_str().ok());
    match origin.and_then(|origin| origin.strip_prefix(scheme)) {
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

    /// One person's machine; anything else has to be said.
    const OPEN: Reached = Reached {
        is_encrypted: false,
        is_open: true,
    };

    fn allowed(method: &Method, headers: &[(&'static str, &str)]) -> bool {
        allowed_where(OPEN, method, headers)
    }

    fn allowed_where(reached: Reached, method: &Method, headers: &[(&'static str, &str)]) -> bool {
        let headers = headers
            .iter()
            .map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()))
            .collect();
        check(reached, method, &headers, None).is_ok()
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

    #[test]
    fn under_tls_or_with_tokens_a_name_will_do_and_origins_still_count() {
        let named = [("host", "swarm.example:7700")];
        for (is_encrypted, scheme, other) in [(true, "https", "http"), (false, "http", "https")] {
            let reached = Reached {
                is_encrypted,
                is_open: false,
            };
            assert!(allowed_where(reached, &Method::GET, &named));
            let post = |scheme: &str, host: &str| {
                let origin = format!("{scheme}://{host}");
                allowed_where(reached, &Method::POST, &[named[0], ("origin", &origin)])
            };
            assert!(post(scheme, "swarm.example:7700"));
            assert!(!post(other, "swarm.example:7700") && !post(scheme, "evil.example"));
        }
    }
}
